"""A robot's control loop: it wakes at a fixed rate, works a little, and sleeps.

A separate process, ``python -m fasaco_edge.bench.control_loop HZ SECONDS``, prints the wake-up
latency of each tick to standard output, in microseconds, a line each. Deadlines are absolute: one
late wake-up does not delay the next.
"""

from __future__ import annotations

import ctypes
import gc
import math
import sys
import time

CLOCK_MONOTONIC, TIMER_ABSTIME = 1, 1
SECOND_NS = 1_000_000_000
# Work of a tick: a regulator for each of two wheels, their odometry, and a scan to search.
BEAMS = 100
KP, KI, KD = 0.8, 0.2, 0.01


class _Timespec(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long))


def run(hz: int, seconds: float) -> list[int]:
    """Run for a time [s]; return how late each tick began [ns]."""
    sleep_until = ctypes.CDLL(None).clock_nanosleep
    period_ns, late_ns = SECOND_NS // hz, []
    robot = _Robot()
    gc.disable()
    deadline = time.monotonic_ns() + period_ns
    for _ in range(round(hz * seconds)):
        until = _Timespec(*divmod(deadline, SECOND_NS))
        while sleep_until(CLOCK_MONOTONIC, TIMER_ABSTIME, ctypes.byref(until), None):
            pass  # a signal came
        late_ns.append(time.monotonic_ns() - deadline)
        robot.tick(1.0 / hz)
        deadline += period_ns
    return late_ns


class _Robot:
    """State of the controlled robot."""

    def __init__(self) -> None:
        self.x = self.y = self.yaw = 0.0
        self._speeds, self._sums, self._errors = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]

    def tick(self, dt_s: float) -> None:
        """Regulate two wheels, integrate their odometry, and search the nearest beam."""
        for wheel, wanted in enumerate((0.3, 0.25)):
            error = wanted - self._speeds[wheel]
            self._sums[wheel] += error * dt_s
            change = (error - self._errors[wheel]) / dt_s
            self._speeds[wheel] += dt_s * (KP * error + KI * self._sums[wheel] + KD * change)
            self._errors[wheel] = error
        left, right = self._speeds
        self.yaw = math.remainder(self.yaw + (right - left) / 0.3 * dt_s, math.tau)
        self.x += 0.5 * (left + right) * math.cos(self.yaw) * dt_s
        self.y += 0.5 * (left + right) * math.sin(self.yaw) * dt_s
        beams = (2.0 + math.sin(self.yaw + 0.06 * beam) for beam in range(BEAMS))
        if min(beams) < 0.5:
            self._speeds = [0.0, 0.0]


if __name__ == "__main__":
    print(*(late // 1000 for late in run(int(sys.argv[1]), float(sys.argv[2]))), sep="\n")
