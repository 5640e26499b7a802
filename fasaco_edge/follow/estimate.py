"""Where the robot is between two poses: the newest one, moved on by what was sent since.

Poses come ten times a second, say, and velocities go out twenty times. A command takes a while to
move the base, and a pose to be heard of: together that is the delay. What is wanted is where the
robot is once all that was sent has moved it, so a pose is moved on by what was sent since the delay
before it came. How long that is shows where the robot starts, brakes and turns: the poses move as
the commands say, so much later.

A pose far from where the robot can be is not believed at once: a localiser that errs for a moment
must not make the robot turn. One that stays where it is after a jump is believed after a while.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.motion import limited

# A pose further off than this from where the robot should be is a jump [m, rad].
JUMP_M, JUMP_RAD = 0.3, 0.8
# After so many poses that agree with each other a jump is believed.
AGREEING = 5
# Without a pose for so long the robot may be anywhere [s].
FORGET_S = 2.0
# What was sent is remembered so long [s].
REMEMBER_S = 1.0
# Delays that are told apart [s], the one that is assumed at first, and how fast old poses count
# less, from one pose to the next.
DELAYS_S = tuple(0.03 * step for step in range(12))
FIRST_DELAY_S = DELAYS_S[1]
FORGETTING = 0.98
# What was sent shows the delay only where it changed by so much.
VARIED_M_S, VARIED_RAD_S = 0.05, 0.2
# What is known of the pose counts less from one pose to the next, and has gone after some times
# this [s]: poses scatter.
BLEND_S = 0.15


@dataclass(frozen=True, slots=True)
class Limits:
    """What the base can do.

    Attributes:
        speed: [m/s].
        acceleration: up and down [m/s^2].
        turn_rate: on the spot [rad/s].
        turn_acceleration: [rad/s^2].
        steered: largest bend that is steered while driving [rad].
    """

    speed: float
    acceleration: float
    turn_rate: float
    turn_acceleration: float
    steered: float


@dataclass(frozen=True, slots=True)
class Command:
    """A velocity.

    Attributes:
        speed: forward [m/s].
        turn_rate: counter-clockwise [rad/s].
    """

    speed: float = 0.0
    turn_rate: float = 0.0


STAND = Command()


class PoseEstimate:
    """Poses and commands in, the robot's pose at any time out.

    Args:
        limits: of the base, which does what is sent as fast as it can.

    Attributes:
        jump: how far the newest pose is from where the robot should be [m], and how far turned
            [rad]; None where it is believed.
        pose_at: when the newest pose that is believed came [s]; None before there is one.
        measured: the newest pose as it came.
        delay: between a command and its effect on a pose that comes [s].
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.jump: tuple[float, float] | None = None
        self.pose_at: float | None = None
        self.delay = FIRST_DELAY_S
        self._unlike = [0.0] * len(DELAYS_S)
        self._pose = Pose2D(0.0, 0.0)
        self.measured = self._pose
        self._doubted: Pose2D | None = None
        self._agreeing = 0
        self._sent = deque[tuple[float, Command]]()

    def take(self, pose: Pose2D, now: float) -> None:
        """Take a pose in, as it comes."""
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
        """Note what is sent to the base, from now on in force."""
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
        """How fast the robot drives, once it has done what was sent [m/s]."""
        return self._sent[-1][1].speed if self._sent else 0.0

    def at(self, now: float) -> Pose2D:
        """Return where the robot is once it has done what was sent until ``now``."""
        assert self.pose_at is not None
        pose = self._pose
        for seconds, command in self._between(self.pose_at - self.delay, now):
            pose = moved(pose, command, seconds)
        return pose

    def _between(self, since: float, until: float) -> Iterator[tuple[float, Command]]:
        """Yield what was in force between two times, each for how long [s]."""
        for index, (begins, command) in enumerate(self._sent):
            ends = self._sent[index + 1][0] if index + 1 < len(self._sent) else until
            seconds = min(ends, until) - max(begins, since)
            if seconds > 0.0:
                yield seconds, command

    def _measure_delay(self, pose: Pose2D, now: float) -> None:
        """Compare turn and way since the pose before with what was sent, so much earlier."""
        before = self.pose_at
        speeds, turns = [c.speed for _, c in self._sent], [c.turn_rate for _, c in self._sent]
        if before is None or not self._sent:
            return
        if max(speeds) - min(speeds) < VARIED_M_S and max(turns) - min(turns) < VARIED_RAD_S:
            return  # what hardly changes shows nothing
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

    def _believe(self, pose: Pose2D, now: float, measured: Pose2D) -> None:
        self._measure_delay(measured, now)
        self.measured = measured
        self._pose, self.pose_at = pose, now
        self.jump, self._doubted, self._agreeing = None, None, 0


def moved(pose: Pose2D, command: Command, seconds: float) -> Pose2D:
    """Return where a robot comes to that moves so for a short time."""
    turn = command.turn_rate * seconds
    heading = pose.yaw + 0.5 * turn
    way = command.speed * seconds
    return Pose2D(
        pose.x + way * math.cos(heading),
        pose.y + way * math.sin(heading),
        math.remainder(pose.yaw + turn, math.tau),
    )


def _between_poses(pose: Pose2D, other: Pose2D, share: float) -> Pose2D:
    """Return the pose at a share of the way from one to another."""
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
    """Return how far two poses are from each other, and how far turned [m, rad]."""
    far = math.hypot(pose.x - other.x, pose.y - other.y)
    return far, abs(math.remainder(pose.yaw - other.yaw, math.tau))
