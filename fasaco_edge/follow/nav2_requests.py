"""Requests to Nav2: goals, queries for results, cancellations repeated until confirmed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.grid.geometry import Point
from fasaco_edge.wire.messages.follow_path import ENDED_BEFORE, NO_SUCH_GOAL, TAKEN

# Retry period of a cancellation [s].
CANCEL_EVERY_S = 1.0
# Limit on the goals cancelled at a time, the newest ones: Nav2 drives no other.
MOST_CANCELLED = 8


@dataclass(frozen=True, slots=True)
class SendGoal:
    """A request to follow points [m] in a frame.

    Attributes:
        end_yaw: heading at the last point [rad]; None for that with which the robot arrives.
        is_back: whether it is driven backward: headings are opposite to the way.
    """

    id: bytes
    points: list[Point]
    frame: str
    end_yaw: float | None = None
    is_back: bool = False


@dataclass(frozen=True, slots=True)
class AskResult:
    """A query for the result of a goal; the reply comes when it has ended."""

    id: bytes


@dataclass(frozen=True, slots=True)
class CancelGoal:
    """A request to cancel a goal."""

    id: bytes


Request = SendGoal | AskResult | CancelGoal


@dataclass(slots=True)
class _Cancellation:
    """A goal to cancel, and the time of the last request [s]."""

    asked_at: float = -math.inf
    # Whether Nav2 has answered the goal: before that it may not know it yet.
    is_known: bool = True


class Cancellations:
    """The goals to cancel that Nav2 has not confirmed yet."""

    def __init__(self) -> None:
        self._goals: dict[bytes, _Cancellation] = {}

    def add(self, goal_id: bytes, *, is_known: bool = True) -> None:
        """Cancel a goal; ``is_known``: whether Nav2 has answered it."""
        self._goals[goal_id] = _Cancellation(is_known=is_known)
        while len(self._goals) > MOST_CANCELLED:
            del self._goals[next(iter(self._goals))]

    def drop(self, goal_id: bytes) -> None:
        """Take in that a goal has ended, or was never sent."""
        self._goals.pop(goal_id, None)

    def take_accepted(self, goal_id: bytes, accepted: bool | None) -> None:
        """Take in whether Nav2 accepted a goal; None without an answer."""
        if goal_id not in self._goals:
            return
        if accepted is False:
            del self._goals[goal_id]
        else:
            self._goals[goal_id] = _Cancellation()

    def take_answer(self, goal_id: bytes, code: int | None) -> None:
        """Take in Nav2's answer to a cancellation; None without one."""
        goal = self._goals.get(goal_id)
        if goal and goal.is_known and code in (TAKEN, NO_SUCH_GOAL, ENDED_BEFORE):
            del self._goals[goal_id]

    def due(self, now: float) -> list[Request]:
        """Return the cancellations to send now, each every ``CANCEL_EVERY_S``."""
        due = [one for one, goal in self._goals.items() if now - goal.asked_at >= CANCEL_EVERY_S]
        for goal_id in due:
            self._goals[goal_id].asked_at = now
        return [CancelGoal(goal_id) for goal_id in due]
