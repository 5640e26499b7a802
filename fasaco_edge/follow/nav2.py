"""Nav2's controller as follower: paths, poses, heartbeats and replies in, requests out.

A goal is a piece of the path that begins at the robot. The next goal is sent before the robot
reaches the end of the last goal, so that Nav2 switches without a stop. Where the path returns to
itself, the next piece begins only shortly before the present goal ends: a controller continues at
the nearest part of a path, and would skip the rest of the present goal. The last pose of a goal has
the heading of the path beyond it, so that the robot turns there until the next goal arrives. A
robot that cannot turn on the spot gets pieces of a curve, each driven forward or backward as a
whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from fasaco_edge.follow.pieces import (
    COAST_M,
    LEAST_M,
    STEP_M,
    TIP_M,
    PathByLength,
    PathDriven,
    SentPiece,
    end_of_piece,
)
from fasaco_edge.follow.standstill import Tries, floor_ahead
from fasaco_edge.follow.supervision import FollowerState, Patience, Reason, Supervision
from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.wire.messages.nav2_goals import ABORTED, CANCELED, ERRORS, SUCCEEDED, Ending
from fasaco_edge.wire.messages.path_points import PathPoints

# The next goal begins at most this far before the end of the last goal [m], plus the distance
# driven in this time [s].
AHEAD_M, AHEAD_S = 0.5, 3.0
# The next goal is sent when the robot is this near to the goal's start [m].
EARLY_M = 0.05
# Length of a path's beginning; a robot farther than this from the beginning does not drive the path
# [m].
BEGINNING_M = 1.0
# An unanswered goal counts as accepted once the robot has moved this far on it [m].
DRIVES_M = 0.15
# A goal that Nav2 reports as done is not done if the robot is farther than this from its end [m].
DONE_M = 0.5
# Pause after an error before the next goal [s]. It doubles with each error, up to the
# maximum. It starts again once the robot has moved PROGRESS_M [m], or once the path leads in
# another direction, measured to its point LEADS_M [m] ahead of the robot.
RETRY_S, MOST_RETRY_S = 1.0, 30.0
PROGRESS_M, LEADS_M = 0.5, 0.5
# A robot stands if it has moved less than MOVED_M [m] during STANDS_S [s], or, near the end of its
# goal, during ARRIVED_S [s]. Then the result is queried again, as a reply may be lost; after
# GIVE_UP_S [s] the goal is given up.
MOVED_M, STANDS_S, ARRIVED_S, GIVE_UP_S = 0.05, 3.0, 1.0, 20.0

# A server that ends a query for a result within this time, without a reply, is gone [s].
GONE_S = 290.0
# Positions are filtered with this time constant [s], to find out whether the robot stands.
STEADY_S = 1.0

# Nav2 gives no error code if another client's goal has replaced a goal; Humble has no error codes.
NO_CODE = "without a code; does another program send goals, too?"


@dataclass(frozen=True, slots=True)
class SendPiece:
    """A request to begin a goal: to follow points [m] in a frame.

    Attributes:
        id: id of the goal.
        end_yaw: heading at the last point [rad]; None to keep the heading of arrival.
        is_back: whether it is driven backward: headings are opposite to the motion.
    """

    id: bytes
    points: list[Point]
    frame: str
    end_yaw: float | None = None
    is_back: bool = False


@dataclass(frozen=True, slots=True)
class AskResult:
    """A query for the result of a goal; the reply arrives when the goal has ended."""

    id: bytes


@dataclass(frozen=True, slots=True)
class CancelGoal:
    """A request to cancel a goal; it is repeated until the server confirms it."""

    id: bytes


Request = SendPiece | AskResult | CancelGoal


class Nav2Follower(Supervision):
    """Sends the newest path to Nav2's controller, piece by piece, while all inputs are up to date.

    Args:
        near: least distance between separate stretches of a piece [m], see ``pieces``.
        speed: largest speed of the robot [m/s].
        new_id: makes the id of a goal.
        patience: timeouts of pose and status.
        radius: radius of the robot's disc [m]; 0 if unknown.
        is_curved: whether the robot cannot turn on the spot, so that paths are curves.
    """

    def __init__(
        self,
        near: float,
        speed: float,
        new_id: Callable[[], bytes],
        patience: Patience,
        radius: float = 0.0,
        *,
        is_curved: bool = False,
    ) -> None:
        super().__init__(patience)
        self._near, self._ahead = near, AHEAD_M + AHEAD_S * speed
        self._new_id = new_id
        self._radius, self._is_curved = radius, is_curved
        # The robot's position, and the filtered position.
        self._here: Point = (0.0, 0.0)
        self._steady: Point = (0.0, 0.0)
        self._moved_last: tuple[Point, float] | None = None
        self._path: PathDriven | None = None
        # The path that replaces the present path, once Nav2 has answered the pending request.
        self._next: PathByLength | None = None
        # The goal that Nav2 drives, and the goal sent but not answered yet.
        self._active: SentPiece | None = None
        self._pending: SentPiece | None = None
        self._asked_at = -math.inf
        self._tries = Tries(PROGRESS_M, RETRY_S, MOST_RETRY_S)
        self._is_canceled = False
        self._trouble_of_nav2: Reason | None = None
        # Requests that the next step returns.
        self._requests: list[Request] = []

    def step(self, now: float) -> list[Request]:
        """Return the requests to send to Nav2 now."""
        if not self._supervised(self._drive, now):
            self._stop()
        if self.state in (FollowerState.STANDS, FollowerState.GIVEN_UP) and self._path:
            self.ahead = floor_ahead(self._here, self._toward(self._path), self._radius)
        return self._taken()

    def end(self) -> list[Request]:
        """Return the requests that end all goals."""
        self._stop()
        return self._taken()

    def take_unsent(self, goal_id: bytes, why: str, now: float) -> None:
        """Take in that a goal could not be sent."""
        if self._pending is not None and self._pending.id == goal_id:
            self._pending = None
            self._fail(FollowerState.NO_NAV2, why, now)

    def take_accepted(self, goal_id: bytes, accepted: bool | None, why: str, now: float) -> None:
        """Take in whether Nav2 accepted a goal; None if it did not answer, and then cancel it."""
        if self._pending is None or self._pending.id != goal_id:
            return
        goal, self._pending = self._pending, None
        if accepted:
            if self._active is None:
                # Only the first goal restarts the timeout of a standing robot, its successors do
                # not.
                self._moved_last = None
            self._active, self._is_canceled = goal, False
            self._trouble_of_nav2 = None
            self._asked_at = now
            self._requests.append(AskResult(goal_id))
            return
        if accepted is None:
            self._requests.append(CancelGoal(goal_id))
        state = FollowerState.REFUSED if accepted is False else FollowerState.NO_NAV2
        self._fail(state, why or "is its controller server active?", now)

    def take_ending(self, goal_id: bytes, ending: Ending | None, why: str, now: float) -> None:
        """Take in how a goal ended; None if that is unknown, which cancels the goal."""
        if self._active is None or self._active.id != goal_id:
            return
        goal, self._active = self._active, None
        if ending is None:
            self._requests.append(CancelGoal(goal_id))
        if self._pending is not None:
            # Nav2 switches to the next goal.
            return
        if ending is None:
            self._fail(FollowerState.NO_NAV2, why, now)
        elif ending.status == SUCCEEDED:
            if (path := self._path) is None:
                return
            far = math.dist(self._here, path.line.at(goal.end))
            if far > DONE_M and goal.end - path.way > DONE_M:
                self._fail(
                    FollowerState.GIVEN_UP, f"reported as done {far:.1f} m before the end", now
                )
            else:
                path.finish(goal)
        elif ending.status == ABORTED:
            code = ending.code
            error = f"{code} {ERRORS.get(code, 'no code')}" if code else NO_CODE
            why = f"{error}: {ending.message}" if ending.message else error
            self._fail(FollowerState.GIVEN_UP, why, now)
        elif ending.status == CANCELED:
            self._is_canceled = True
            words = "drives on once the path leads in another direction"
            self._fail(FollowerState.CANCELED, words, now, for_good=True)
        else:
            self._fail(FollowerState.NO_NAV2, "Nav2 does not know the goal: was it restarted?", now)

    def take_silence(self, goal_id: bytes, waited_s: float, now: float) -> None:
        """Take in that a result's query ended without a reply; if it ended soon, Nav2 is gone."""
        if waited_s < GONE_S:
            self.take_ending(goal_id, None, "its server has gone", now)
        elif self._active is not None and self._active.id == goal_id:
            self._requests.append(AskResult(goal_id))

    def _drive(self, now: float) -> bool:
        """Send the goals that are due; return whether the path can be driven from here."""
        if self._path is not None:
            self._tries.moved_to(self._here)
            # The robot may also be on an unanswered goal, as answers may be lost.
            self._path.advance(self._here, self._active or self._pending)
            self._believe_motion(self._path, now)
        if self._next is not None and self._pending is None and not self._join(self._next, now):
            return False
        assert self._path is not None
        path, goal = self._path, self._pending or self._active
        whole = path.line.length(path.way + 2 * self._ahead)
        if goal is None:
            self._begin(path, whole, now)
        elif goal is self._active:
            self._watch(path, goal, now)
            if goal.end - path.way <= self._ahead and goal.end < whole:
                self._send_next(path, goal)
        return True

    def _believe_motion(self, path: PathDriven, now: float) -> None:
        """Treat a goal as accepted once the robot drives it."""
        goal = self._pending
        if goal is None or self._active is not None:
            return
        # Half of a short goal is enough: it may end before the robot gets further.
        least = min(max(0.5 * (goal.end - goal.start), DRIVES_M), COAST_M)
        if path.way - goal.start > least:
            self.take_accepted(goal.id, accepted=True, why="", now=now)

    def _begin(self, path: PathDriven, whole: float, now: float) -> None:
        if self._trouble_of_nav2 is not None:
            self.state, self.detail = self._trouble_of_nav2
        if whole - path.way <= STEP_M:
            self.state, self.detail = FollowerState.DRIVEN, ""
        elif self._tries.may_try(self._toward(path), now):
            self._send(path, path.way)

    def _send_next(self, path: PathDriven, goal: SentPiece) -> None:
        if goal.next_start is None:
            goal.next_start = path.start_after(goal, self._ahead, self._near)
        is_there = path.is_near_end(self._here, goal, TIP_M + EARLY_M)
        if goal.next_start - path.way <= EARLY_M or (is_there and goal.next_start < math.inf):
            self._send(path, max(goal.next_start, path.way))

    def _send(self, path: PathDriven, start: float) -> None:
        end = end_of_piece(path.line, start, self._near)
        goal = self._pending = SentPiece(self._new_id(), start, end)
        points = [path.line.at(way) for way in path.line.ways(start, end)]
        yaw, is_back = path.heading_after(goal), path.line.is_back(start + LEAST_M)
        self._requests.append(SendPiece(goal.id, points, self.path_frame, yaw, is_back))

    def _join(self, line: PathByLength, now: float) -> bool:
        """Switch to a new path if it begins near the robot; return whether it begins there.

        If the path does not change up to the end of Nav2's goal, Nav2 keeps the goal.
        """
        way, far = line.nearest(self._here, 0.0, line.length(BEGINNING_M))
        if far > BEGINNING_M:
            self.state, self.detail = FollowerState.PATH_ELSEWHERE, f"{far:.2f} m away"
            return False
        goal, before = self._active, self._path
        self._path, self._next = (path := PathDriven(line, way)), None
        if self._tries.may_try(self._toward(path), now):
            self._trouble_of_nav2 = None
        if goal is None:
            return True
        assert before is not None
        shift = before.shift_to(line, way, goal)
        if shift is None:
            # Nav2 switches from its present goal to this goal.
            self._send(path, way)
        else:
            goal.start, goal.end = goal.start + shift, goal.end + shift
            # The path may change beyond the goal.
            goal.next_start = None
        return True

    def _watch(self, path: PathDriven, goal: SentPiece, now: float) -> None:
        """Query the result again, or give up the goal, if the robot stands."""
        if self._moved_last is None or math.dist(self._steady, self._moved_last[0]) > MOVED_M:
            self._moved_last = (self._steady, now)
        stands_s = now - self._moved_last[1]
        longest_s = ARRIVED_S if goal.end - path.way <= DONE_M else STANDS_S
        if stands_s <= longest_s:
            return
        if stands_s > STANDS_S:
            self.state, self.detail = FollowerState.STANDS, f"for {stands_s:.0f} s"
        if stands_s > GIVE_UP_S:
            self._requests.append(CancelGoal(goal.id))
            self._active = None
            self._fail(FollowerState.GIVEN_UP, f"stood for {stands_s:.0f} s without an error", now)
        elif now - self._asked_at > longest_s:
            self._asked_at = now
            self._requests.append(AskResult(goal.id))

    def _fail(
        self, state: FollowerState, detail: str, now: float, *, for_good: bool = False
    ) -> None:
        self._trouble_of_nav2 = (state, detail)
        if self._path is not None:
            self._tries.note_failure(self._here, self._toward(self._path), now, for_good=for_good)

    def _toward(self, path: PathDriven) -> float:
        """Return the direction from the robot to the path's point LEADS_M ahead [rad]."""
        x, y = path.line.at(path.way + LEADS_M)
        return math.atan2(y - self._here[1], x - self._here[0])

    def _stop(self) -> None:
        self._requests += [CancelGoal(goal.id) for goal in (self._active, self._pending) if goal]
        self._active = self._pending = None

    def _taken(self) -> list[Request]:
        requests, self._requests = self._requests, []
        return requests

    def _moved_to(self, pose: Pose2D, now: float) -> None:
        share = 1.0 - math.exp((self._pose_at - now) / STEADY_S)
        (x, y), self._here = self._steady, (pose.x, pose.y)
        self._steady = (x + share * (pose.x - x), y + share * (pose.y - y))

    def _have(self, points: PathPoints) -> None:
        self._next = PathByLength(points, is_curved=self._is_curved)

    def _withdraw(self) -> None:
        self._path = self._next = None
        self._stop()
        if self._is_canceled:
            self._is_canceled = False
            self._tries.forget()
