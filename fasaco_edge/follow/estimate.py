"""Pose estimate between two poses: the newest pose, advanced by the commands sent since.

Poses arrive about ten times a second, and commands are sent twenty times a second. The delay is the
time from a command to the arrival of a pose that shows its effect. The estimate is the pose after
all sent commands have taken effect. The newest pose shows the commands sent up to one delay before
it arrived; the estimate is this pose, advanced by all later commands. The delay is measured when
the robot starts, brakes and turns: it is the shift in time at which poses and commands fit best.

A pose far from the expected one is not accepted at once, so that a momentary error of the localiser
does not turn the robot. After a jump, several poses that agree with each other are accepted.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.motion import limited

# A pose farther than this from the expected one is a jump [m, rad].
JUMP_M, JUMP_RAD = 0.3, 0.8
# A jump is accepted after this many poses that agree with each other.
AGREEING = 5
# Time without a pose after which any pose is accepted [s].
FORGET_S = 2.0
# Commands are stored for this long [s].
REMEMBER_S = 1.0
# Candidate delays, the initial delay [s], and the factor by which each pose reduces old mismatches.
DELAYS_S = tuple(0.03 * step for step in range(12))
FIRST_DELAY_S = DELAYS_S[1]
FORGETTING = 0.98
# Least change of the commands from which the delay can be measured.
VARIED_M_S, VARIED_RAD_S = 0.05, 0.2
# Time constant of the filter against noise of the poses [s].
BLEND_S = 0.15


@dataclass(frozen=True, slots=True)
class BaseLimits:
    """The limits of the base.

    Attributes:
        speed: largest speed [m/s].
        acceleration: largest acceleration and deceleration [m/s^2].
        turn_rate: largest turn rate on the spot [rad/s].
        turn_acceleration: largest change of the turn rate [rad/s^2].
        steered: largest bend that is steered while driving [rad].
        turn_radius: radius of the tightest arc [m]; 0 if it turns on the spot.
    """

    speed: float
    acceleration: float
    turn_rate: float
    turn_acceleration: float
    steered: float
    turn_radius: float = 0.0


@dataclass(frozen=True, slots=True)
class VelocityCommand:
    """A velocity.

    Attributes:
        speed: forward [m/s]; below 0 backward.
        turn_rate: counter-clockwise [rad/s].
    """

    speed: float = 0.0
    turn_rate: float = 0.0


STAND = VelocityCommand()


class PoseEstimate:
    """Estimates the robot's pose at any time from poses and commands.

    Args:
        limits: limits of the base, which follows commands as fast as these allow.

    Attributes:
        jump: distance [m] and angle [rad] of the newest pose from the expected one; None if it is
            accepted.
        measured: the newest accepted pose, unfiltered.
        commanded: the motion that all commands up to ``measured`` should have caused: x, y [m],
            computed with the measured headings, and turn [rad].
        delay: time from a command to the arrival of a pose that shows its effect [s].
    """

    def __init__(self, limits: BaseLimits) -> None:
        self._limits = limits
        self.jump: tuple[float, float] | None = None
        self.delay = FIRST_DELAY_S
        # Mismatch between poses and commands, for each candidate delay.
        self._mismatches = [0.0] * len(DELAYS_S)
        # The filtered pose, and the arrival of the newest accepted pose.
        self._pose, self._pose_at = Pose2D(0.0, 0.0), -math.inf
        self.measured, self.commanded = self._pose, (0.0, 0.0, 0.0)
        self._doubted, self._agreeing = self._pose, 0
        self._sent = deque[tuple[float, VelocityCommand]]()

    def take(self, pose: Pose2D, now: float) -> None:
        """Take in a pose on arrival."""
        if now - self._pose_at > FORGET_S:
            self._accept(pose, pose, now)
            return
        here = self.at(now - self.delay)
        if _is_near(pose, here):
            share = 1.0 - math.exp((self._pose_at - now) / BLEND_S)
            turn = math.remainder(pose.yaw - here.yaw, math.tau)
            x, y = here.x + share * (pose.x - here.x), here.y + share * (pose.y - here.y)
            blended = Pose2D(x, y, math.remainder(here.yaw + share * turn, math.tau))
            self._accept(blended, pose, now)
            return
        self.jump = _apart(pose, here)
        self._agreeing = self._agreeing + 1 if _is_near(pose, self._doubted) else 1
        self._doubted = pose
        if self._agreeing >= AGREEING:
            self._accept(pose, pose, now)

    def sent(self, command: VelocityCommand, now: float) -> None:
        """Note a command sent to the base now."""
        if self._sent:
            (before, last), limits = self._sent[-1], self._limits
            faster, rate = limits.acceleration * (now - before), limits.turn_acceleration
            command = VelocityCommand(
                limited(last.speed, command.speed, faster),
                limited(last.turn_rate, command.turn_rate, rate * (now - before)),
            )
        self._sent.append((now, command))
        while self._sent[0][0] < now - REMEMBER_S:
            self._sent.popleft()

    @property
    def speed(self) -> float:
        """The robot's speed after all sent commands have taken effect [m/s]."""
        return self._sent[-1][1].speed if self._sent else 0.0

    def at(self, now: float) -> Pose2D:
        """Return the robot's pose after all commands sent until ``now`` have taken effect."""
        pose = self._pose
        for seconds, command in self._between(self._pose_at - self.delay, now):
            pose = moved(pose, command, seconds)
        return pose

    def _between(self, since: float, until: float) -> Iterator[tuple[float, VelocityCommand]]:
        """Yield the commands in force between two times, with their durations [s]."""
        for index, (begins, command) in enumerate(self._sent):
            ends = self._sent[index + 1][0] if index + 1 < len(self._sent) else until
            seconds = min(ends, until) - max(begins, since)
            if seconds > 0.0:
                yield seconds, command

    def _measure_delay(self, pose: Pose2D, now: float) -> None:
        """Compare the motion since the last pose with the commands sent earlier, for each delay."""
        speeds, turns = [c.speed for _, c in self._sent], [c.turn_rate for _, c in self._sent]
        if max(speeds) - min(speeds) < VARIED_M_S and max(turns) - min(turns) < VARIED_RAD_S:
            return  # almost constant commands do not show the delay
        went, _ = _apart(pose, self.measured)
        turned = math.remainder(pose.yaw - self.measured.yaw, math.tau)
        for index, delay in enumerate(DELAYS_S):
            turn = way = 0.0
            for seconds, command in self._between(self._pose_at - delay, now - delay):
                turn += seconds * command.turn_rate
                way += seconds * command.speed
            mismatch = (turned - turn) ** 2 + (went - way) ** 2
            self._mismatches[index] = FORGETTING * self._mismatches[index] + mismatch
        self.delay = DELAYS_S[self._mismatches.index(min(self._mismatches))]

    def _accept(self, pose: Pose2D, measured: Pose2D, now: float) -> None:
        if self._sent and self._pose_at > -math.inf:
            self._measure_delay(measured, now)
            here, (x, y, turned) = self.measured, self.commanded
            for seconds, command in self._between(self._pose_at - self.delay, now - self.delay):
                here = moved(here, command, seconds)
                turned += command.turn_rate * seconds
            self.commanded = (x + here.x - self.measured.x, y + here.y - self.measured.y, turned)
        self._pose, self.measured, self._pose_at = pose, measured, now
        self.jump, self._agreeing = None, 0


def moved(pose: Pose2D, command: VelocityCommand, seconds: float) -> Pose2D:
    """Return the pose after moving with a command for a short time."""
    turn = command.turn_rate * seconds
    heading = pose.yaw + 0.5 * turn
    way = command.speed * seconds
    return Pose2D(
        pose.x + way * math.cos(heading),
        pose.y + way * math.sin(heading),
        math.remainder(pose.yaw + turn, math.tau),
    )


def _is_near(pose: Pose2D, other: Pose2D) -> bool:
    far, turned = _apart(pose, other)
    return far <= JUMP_M and turned <= JUMP_RAD


def _apart(pose: Pose2D, other: Pose2D) -> tuple[float, float]:
    """Return distance and angle between two poses [m, rad]."""
    far = math.hypot(pose.x - other.x, pose.y - other.y)
    return far, abs(math.remainder(pose.yaw - other.yaw, math.tau))
