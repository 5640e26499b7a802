"""Requests to Nav2: goals, questions for their results, cancellations until Nav2 confirms them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.grid.geometry import Point
from fasaco_edge.wire.messages.follow_path import ENDED_BEFORE, NO_SUCH_GOAL, TAKEN

# A cancellation is asked for again after so long [s].
CANCEL_EVERY_S = 1.0
# So many goals are cancelled at a time, the newest ones: Nav2 drives no other.
MOST_CANCELLED = 8


@dataclass(frozen=True, slots=True)
class SendGoal:
    """Have Nav2 follow points [m] in a frame."""

    id: bytes
    points: list[Point]
    frame: str


@dataclass(frozen=True, slots=True)
class AskResult:
    """Ask how a goal ended; the answer comes when it has."""

    id: bytes


@dataclass(frozen=True, slots=True)
class CancelGoal:
    """Have Nav2 end a goal."""

    id: bytes


Request = SendGoal | AskResult | CancelGoal


@dataclass(slots=True)
class _Cancellation:
    """A goal that is to end, and when that was last asked for [s]."""

    asked_at: float = -math.inf
    # Whether Nav2 has said if it took the goal: before, it may not know it yet.
    is_known: bool = True


class Cancellations:
    """The goals that Nav2 is to end, and has not confirmed yet."""

    def __init__(self) -> None:
        self._goals: dict[bytes, _Cancellation] = {}

    def add(self, goal_id: bytes, *, is_known: bool = True) -> None:
        """Have a goal end; ``is_known`` tells whether Nav2 has answered it."""
        self._goals[goal_id] = _Cancellation(is_known=is_known)
        while len(self._goals) > MOST_CANCELLED:
            del self._goals[next(iter(self._goals))]

    def drop(self, goal_id: bytes) -> None:
        """Take in that a goal has ended, or never went out."""
        self._goals.pop(goal_id, None)

    def take_accepted(self, goal_id: bytes, accepted: bool | None) -> None:
        """Take in whether Nav2 took a goal; None where it did not say."""
        if goal_id not in self._goals:
            return
        if accepted is False:
            del self._goals[goal_id]
        else:
            self._goals[goal_id] = _Cancellation()

    def take_answer(self, goal_id: bytes, code: int | None) -> None:
        """Take in what Nav2 said of a cancellation; None where it said nothing."""
        goal = self._goals.get(goal_id)
        if goal and goal.is_known and code in (TAKEN, NO_SUCH_GOAL, ENDED_BEFORE):
            del self._goals[goal_id]

    def due(self, now: float) -> list[Request]:
        """Return the cancellations to ask for now, each every ``CANCEL_EVERY_S``."""
        due = [one for one, goal in self._goals.items() if now - goal.asked_at >= CANCEL_EVERY_S]
        for goal_id in due:
            self._goals[goal_id].asked_at = now
        return [CancelGoal(goal_id) for goal_id in due]
