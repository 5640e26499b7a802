"""Doing: the mission's activity in a step, and its reason."""

from __future__ import annotations

from typing import NamedTuple

from fasaco_edge.mission.core.events import PathUpdate, PlanRequest, State


class Doing(NamedTuple):
    """The mission's activity.

    Attributes:
        state: of the mission.
        reason: why; "" for the number of the path.
        path: a path to publish.
        plan: a plan to make.
    """

    state: State
    reason: str
    path: PathUpdate | None = None
    plan: PlanRequest | None = None
