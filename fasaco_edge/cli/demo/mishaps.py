"""Mishaps of a demo of several robots: a daemon that is killed, a network that is split."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Callable, Sequence
from contextlib import ExitStack

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings

# How long the network stays split [s]: real time, as in the timeouts of robots for each other.
SPLIT_S = 15.0


class Mishaps:
    """What goes wrong in a demo, and when.

    The network has a router at each end, and one in the middle that both connect to: without it,
        robots at one end do not receive messages from those at the other.

    Args:
        kill_after_s, split_after_s: simulated time until the event [s]; None for never.
        ends: endpoints of the two routers.
        say: prints the events.
    """

    def __init__(
        self,
        kill_after_s: float | None,
        split_after_s: float | None,
        ends: Sequence[str],
        say: Callable[[str], None],
    ) -> None:
        self._kill_after_s, self._split_after_s = kill_after_s, split_after_s
        self._ends, self._say = tuple(ends), say
        self._between = ExitStack()
        self._heals_at: float | None = None

    def __enter__(self) -> Mishaps:
        if self._split_after_s is not None:
            self._join_ends()
        return self

    def __exit__(self, *_: object) -> None:
        self._between.close()

    def _join_ends(self) -> None:
        self._between.enter_context(open_bus(BusSettings("router", self._ends, ())))

    def step(self, now: float, sim_s: float, victim: Sequence[subprocess.Popen[bytes]]) -> bool:
        """Carry out the mishaps that are due; return whether the victim is killed now.

        Args:
            now: monotonic time [s].
            sim_s: simulated time [s].
            victim: processes of the robot that may be killed, its daemon first.
        """
        if self._split_after_s is not None and sim_s >= self._split_after_s:
            self._split_after_s, self._heals_at = None, now + SPLIT_S
            self._between.close()
            self._say(f"the network is split for {SPLIT_S:.0f} s")
        if self._heals_at is not None and now >= self._heals_at:
            self._heals_at = None
            self._join_ends()
            self._say("the network is whole again")
        if self._kill_after_s is None or sim_s < self._kill_after_s:
            return False
        self._kill_after_s = None
        daemon, *others = victim
        daemon.kill()
        for process in others:
            # Without messages of its daemon a base stands; its program then writes the result of
            # its drive.
            process.send_signal(signal.SIGTERM)
        return True
