"""The pose estimate between two poses: the newest pose, advanced by the commands sent since.

Poses arrive, for example, ten times a second, and velocities are sent twenty times. A command takes
a while to move the base, and a pose to arrive: together that is the delay. The estimate is the pose
after all sent commands have taken effect: a pose is advanced by the commands sent from one delay
before its arrival on. The delay is measured when the robot starts, brakes and turns: the poses
follow the commands after it.

A pose far from the expected one is not accepted at once: a momentary error of the localiser must
not make the robot turn. After a jump, poses that agree with each other are accepted after a while.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.motion import limited

# A pose further than this from the expected one is a jump [m, rad].
JUMP_M, JUMP_RAD = 0.3, 0.8
# A jump is accepted after this many poses that agree with each other.
AGREEING = 5
# Timeout of the pose: after it the robot may be anywhere [s].
FORGET_S = 2.0
# Commands are stored for this long [s].
REMEMBER_S = 1.0
# Candidate delays [s], the initial one, and the decay of old poses from one pose to the next.
DELAYS_S = tuple(0.03 * step for step in range(12))
FIRST_DELAY_S = DELAYS_S[1]
FORGETTING = 0.98
# Least change of the commands from which the delay can be measured.
VARIED_M_S, VARIED_RAD_S = 0.05, 0.2
# Time constant of the pose filter [s]: poses scatter.
BLEND_S = 0.15


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of the base.

    Attributes:
        speed: [m/s].
        acceleration: up and down [m/s^2].
        turn_rate: on the spot [rad/s].
        turn_acceleration: [rad/s^2].
        steered: largest bend that is steered while driving [rad].
        turn_radius: of the tightest arc [m]; 0 if it turns on the spot.
    """

    speed: float
    acceleration: float
    turn_rate: float
    turn_acceleration: float
    steered: float
    turn_radius: float = 0.0


@dataclass(frozen=True, slots=True)
class Command:
    """A velocity.

    Attributes:
        speed: forward [m/s]; below 0 backward.
        turn_rate: counter-clockwise [rad/s].
    """

    speed: float = 0.0
    turn_rate: float = 0.0


STAND = Command()


class PoseEstimate:
    """Poses and commands in, the robot's pose at any time out.

    Args:
        limits: of the base, which executes commands as fast as it can.

        Attributes:
            jump: distance [m] and angle [rad] of the newest pose from the expected one; None if it
                is accepted.
            pose_at: arrival of the newest accepted pose [s]; None before there is one.
            measured: the newest pose, unfiltered.
            commanded: motion along x and y [m] and turn [rad] that the commands up to that pose
                should have caused, along the measured headings.
            delay: between a command and its effect on an arriving pose [s].
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.jump: tuple[float, float] | None = None
        self.pose_at: float | None = None
        self.delay = FIRST_DELAY_S
        self._unlike = [0.0] * len(DELAYS_S)
        self._pose = Pose2D(0.0, 0.0)
        self.measured = self._pose
        self.commanded = (0.0, 0.0, 0.0)
        self._doubted: Pose2D | None = None
        self._agreeing = 0
        self._sent = deque[tuple[float, Command]]()

    def take(self, pose: Pose2D, now: float) -> None:
        """Take in a pose on arrival."""
        if self.pose_at is None or now - self.pose_at > FORGET_S:
            self._believe(pose, now, pose)
            return
        here = self.at(now - self.delay)
        if _is_near(pose, here):
            share = 1.0 - math.exp((self.pose_at - now) / BLEND_S)
            self._believe(_between_poses(here, pose, share), now, pose)
            return
        self.jump = _apart(pose, here)
        agrees = self._doubted is not None and _is_near(pose, self._doubted)
        self._agreeing = self._agreeing + 1 if agrees else 1
        self._doubted = pose
        if self._agreeing >= AGREEING:
            self._believe(pose, now, pose)

    def sent(self, command: Command, now: float) -> None:
        """Note the command sent to the base, in force from now on."""
        if self._sent:
            before, last = self._sent[-1]
            seconds = now - before
            command = Command(
                limited(last.speed, command.speed, self._limits.acceleration * seconds),
                limited(
                    last.turn_rate, command.turn_rate, self._limits.turn_acceleration * seconds
                ),
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
        assert self.pose_at is not None
        pose = self._pose
        for seconds, command in self._between(self.pose_at - self.delay, now):
            pose = moved(pose, command, seconds)
        return pose

    def _between(self, since: float, until: float) -> Iterator[tuple[float, Command]]:
        """Yield the commands in force between two times, with their durations [s]."""
        for index, (begins, command) in enumerate(self._sent):
            ends = self._sent[index + 1][0] if index + 1 < len(self._sent) else until
            seconds = min(ends, until) - max(begins, since)
            if seconds > 0.0:
                yield seconds, command

    def _measure_delay(self, pose: Pose2D, now: float) -> None:
        """Compare the motion since the last pose with the commands sent earlier, for each delay."""
        before = self.pose_at
        speeds, turns = [c.speed for _, c in self._sent], [c.turn_rate for _, c in self._sent]
        if before is None or not self._sent:
            return
        if max(speeds) - min(speeds) < VARIED_M_S and max(turns) - min(turns) < VARIED_RAD_S:
            return  # almost constant commands do not show the delay
        turned = math.remainder(pose.yaw - self.measured.yaw, math.tau)
        went = math.hypot(pose.x - self.measured.x, pose.y - self.measured.y)
        for index, delay in enumerate(DELAYS_S):
            turn = way = 0.0
            for seconds, command in self._between(before - delay, now - delay):
                turn += seconds * command.turn_rate
                way += seconds * command.speed
            unlike = (turned - turn) ** 2 + (went - way) ** 2
            self._unlike[index] = FORGETTING * self._unlike[index] + unlike
        self.delay = DELAYS_S[self._unlike.index(min(self._unlike))]

    def _add_commanded(self, now: float) -> None:
        """Add the motion commanded since the last pose."""
        if self.pose_at is None:
            return
        here, turned = self.measured, 0.0
        for seconds, command in self._between(self.pose_at - self.delay, now - self.delay):
            here = moved(here, command, seconds)
            turned += command.turn_rate * seconds
        x, y, turn = self.commanded
        went = (here.x - self.measured.x, here.y - self.measured.y)
        self.commanded = (x + went[0], y + went[1], turn + turned)

    def _believe(self, pose: Pose2D, now: float, measured: Pose2D) -> None:
        self._measure_delay(measured, now)
        self._add_commanded(now)
        self.measured = measured
        self._pose, self.pose_at = pose, now
        self.jump, self._doubted, self._agreeing = None, None, 0


def moved(pose: Pose2D, command: Command, seconds: float) -> Pose2D:
    """Return the pose after moving with a command for a short time."""
    turn = command.turn_rate * seconds
    heading = pose.yaw + 0.5 * turn
    way = command.speed * seconds
    return Pose2D(
        pose.x + way * math.cos(heading),
        pose.y + way * math.sin(heading),
        math.remainder(pose.yaw + turn, math.tau),
    )


def _between_poses(pose: Pose2D, other: Pose2D, share: float) -> Pose2D:
    """Return the pose interpolated between two poses."""
    turn = math.remainder(other.yaw - pose.yaw, math.tau)
    return Pose2D(
        pose.x + share * (other.x - pose.x),
        pose.y + share * (other.y - pose.y),
        math.remainder(pose.yaw + share * turn, math.tau),
    )


def _is_near(pose: Pose2D, other: Pose2D) -> bool:
    far, turned = _apart(pose, other)
    return far <= JUMP_M and turned <= JUMP_RAD


def _apart(pose: Pose2D, other: Pose2D) -> tuple[float, float]:
    """Return distance and angle between two poses [m, rad]."""
    far = math.hypot(pose.x - other.x, pose.y - other.y)
    return far, abs(math.remainder(pose.yaw - other.yaw, math.tau))
