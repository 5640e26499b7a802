"""Docking and undocking by Nav2's docking server: the daemon's state and poses in, requests out.

The path ends in front of the dock. Once the daemon's state is ``charging`` there, the docking
server moves the robot in; before the next path is driven, it moves the robot out again. No clock,
no session.

``DockingNode`` sends the requests to the server as queries, and handles its replies once a cycle.
"""

from __future__ import annotations

import enum
import logging
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from fasaco_edge.bus.session import Bus
from fasaco_edge.follow.actions import (
    ActionClient,
    AskResult,
    CancelGoal,
    Request,
    SendGoal,
    goal_error,
)
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.follow.supervision import Supervision
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.messages.nav2_goals import (
    DOCK_ERRORS,
    GOAL_ID_BYTES,
    UNKNOWN,
    DockEnding,
    decode_dock_ending,
    decode_undock_ending,
    encode_dock,
    encode_undock,
)
from fasaco_edge.wire.ros_keys import DOCK_ROBOT, UNDOCK_ROBOT

# Distance from the dock's pose within which the robot is in its dock [m].
DOCKED_M = 0.1
# Pause after an error before the next goal [s], doubled each time up to the maximum.
RETRY_S, MOST_RETRY_S = 10.0, 300.0
# Period of queries for the result, as a reply may be lost; time after which a goal is given up [s].
RESULT_EVERY_S, GIVE_UP_S = 20.0, 1200.0
# States of the daemon in which the robot undocks; and those in which docking is cancelled.
UNDOCKS = ("planning", "covering", "returning", "degraded")
CANCELS = ("planning", "covering", "returning", "paused", "idle", "done")


class Move(enum.Enum):
    """Motions of the docking server."""

    DOCK = "docking"
    UNDOCK = "undocking"


DockRequest = tuple[Move, Request]


@dataclass(slots=True)
class _Goal:
    move: Move
    id: bytes
    sent_at: float
    asked_at: float = -math.inf
    is_accepted: bool = False
    is_cancelled: bool = False


class Docking:
    """Decides when the docking server moves the robot.

    Args:
        dock: the robot's pose in the dock.
        approach: distance in front of the dock at which paths end [m].
        new_id: makes the id of a goal.

    Attributes:
        holds: why the robot must not drive along its path now; "" if it may.
        trouble: the last error, or "".
    """

    def __init__(self, dock: Pose2D, approach: float, new_id: Callable[[], bytes]) -> None:
        self.holds = self.trouble = ""
        self._dock, self._approach, self._new_id = dock, approach, new_id
        # Whether the robot is in the dock; None before its first pose.
        self._is_docked: bool | None = None
        self._goal: _Goal | None = None
        self._requests: list[DockRequest] = []
        self._retry_at, self._retry_s = -math.inf, RETRY_S

    def step(
        self, now: float, state: str, here: Pose2D | None, *, drives: bool
    ) -> list[DockRequest]:
        """Return the requests to the docking server now.

        Args:
            now: the time [s].
            state: the daemon's state; "" before the first status.
            here: the robot's pose; None if unknown.
            drives: whether there is a path to drive.
        """
        if here is not None:
            far = math.hypot(here.x - self._dock.x, here.y - self._dock.y)
            if self._is_docked is None:
                # The robot may have been switched on in its dock.
                self._is_docked = far <= max(DOCKED_M, 0.5 * self._approach)
            elif self._goal is None and far > self._approach + 2.0 * DOCKED_M:
                self._is_docked = False
        if (goal := self._goal) is not None:
            self._watch(goal, now, state)
        elif here is not None and now >= self._retry_at:
            if state == "charging" and not self._is_docked:
                self._start(Move.DOCK, now)
            elif self._is_docked and drives and state in UNDOCKS:
                self._start(Move.UNDOCK, now)
        is_in = bool(self._is_docked) and drives
        self.holds = self._goal.move.value if self._goal else "in its dock" if is_in else ""
        requests, self._requests = self._requests, []
        return requests

    def end(self) -> list[DockRequest]:
        """Return the requests that end the goal; the next pose shows whether it is docked."""
        self._is_docked = None
        if (goal := self._goal) is None:
            return []
        self._goal = None
        return [(goal.move, CancelGoal(goal.id))]

    def take_accepted(self, goal_id: bytes, accepted: bool | None, why: str, now: float) -> None:
        """Take in whether the server accepted a goal; None without an answer."""
        goal = self._goal
        if goal is None or goal.id != goal_id:
            return
        if accepted:
            # Its result is queried at the next step.
            goal.is_accepted, goal.asked_at = True, -math.inf
            return
        if accepted is None:
            self._cancel(goal)
        self._fail(why or "refused: is the docking server active?", now)

    def take_ending(self, goal_id: bytes, ending: DockEnding | None, why: str, now: float) -> None:
        """Take in how a goal ended; None if the reply is malformed."""
        goal = self._goal
        if goal is None or goal.id != goal_id:
            return
        if ending is None:
            self._cancel(goal)
            self._fail(why, now)
        elif ending.is_done:
            self._goal, self.trouble = None, ""
            self._is_docked = goal.move is Move.DOCK
            self._retry_at, self._retry_s = now, RETRY_S
        elif goal.is_cancelled:
            self._goal = None
        elif ending.status == UNKNOWN:
            self._fail("the docking server does not know the goal: was it restarted?", now)
        else:
            self._fail(goal_error(ending, DOCK_ERRORS, "no code"), now)

    def take_silence(self, goal_id: bytes, waited_s: float, now: float) -> None:
        """Do nothing: ``step`` queries the result again."""

    def _start(self, move: Move, now: float) -> None:
        self._goal = _Goal(move, self._new_id(), now, asked_at=now)
        self._requests.append((move, SendGoal(self._goal.id)))

    def _cancel(self, goal: _Goal) -> None:
        self._requests.append((goal.move, CancelGoal(goal.id)))

    def _watch(self, goal: _Goal, now: float, state: str) -> None:
        """Query the result again; cancel an unwanted goal; give up a goal that never ends."""
        if goal.move is Move.DOCK and state in CANCELS and not goal.is_cancelled:
            goal.is_cancelled = True
            self._cancel(goal)
        if now - goal.sent_at > GIVE_UP_S:
            self._cancel(goal)
            self._fail("did not end", now)
        elif goal.is_accepted and now - goal.asked_at > RESULT_EVERY_S:
            goal.asked_at = now
            self._requests.append((goal.move, AskResult(goal.id)))

    def _fail(self, why: str, now: float) -> None:
        assert self._goal is not None
        self.trouble = f"{self._goal.move.value}: {why}"
        self._goal = None
        self._retry_at = now + self._retry_s
        self._retry_s = min(2.0 * self._retry_s, MOST_RETRY_S)


log = logging.getLogger(__name__)


class DockingNode:
    """Takes the daemon's state and the robot's pose, and has the docking server move the robot."""

    def __init__(self, bus: Bus, settings: FollowSettings) -> None:
        dock: Any = settings.dock
        pose = Pose2D(*dock["pose"])
        new_id = partial(os.urandom, GOAL_ID_BYTES)
        docking = self._docking = Docking(pose, dock["approach_m"], new_id)
        names = dock["id"], dock["type"]
        client = partial(ActionClient, bus, settings.ros, sender=docking, clock=time.monotonic)
        # For each motion its client, and the payload that begins a goal of an id.
        self._actions: dict[Move, tuple[ActionClient, Callable[[bytes], bytes]]] = {
            Move.DOCK: (
                client(dock["dock_action"], DOCK_ROBOT, read_ending=decode_dock_ending),
                lambda goal_id: encode_dock(goal_id, pose, dock["frame"], *names),
            ),
            Move.UNDOCK: (
                client(dock["undock_action"], UNDOCK_ROBOT, read_ending=decode_undock_ending),
                lambda goal_id: encode_undock(goal_id, dock["type"]),
            ),
        }
        self._logged = ("", "")

    def turn(self, state: str, follower: Supervision) -> None:
        """Run a cycle; the follower is held while the docking server moves the robot."""
        for client, _ in self._actions.values():
            client.turn()
        docking, pose = self._docking, follower.newest_pose
        self._ask(docking.step(time.monotonic(), state, pose, drives=follower.has_path))
        follower.held = docking.holds
        (held, trouble), self._logged = self._logged, (docking.holds, docking.trouble)
        if docking.trouble and docking.trouble != trouble:
            log.warning("dock: %s", docking.trouble)
        if docking.holds and docking.holds != held:
            log.info("dock: %s", docking.holds)

    def end(self) -> None:
        """End the goals."""
        self._ask(self._docking.end())

    def _ask(self, requests: list[DockRequest]) -> None:
        for move, request in requests:
            client, goal_of = self._actions[move]
            client.ask(request, goal_of(request.id))
