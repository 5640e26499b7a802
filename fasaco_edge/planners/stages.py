"""Stages of the warm-up: their names, their order, and which of them a plan or a mission needs."""

from __future__ import annotations

from fasaco_edge.planners.registry import PLANNER_NAMES

LATTICE, CHANGES, REACH, AREAS = "lattice", "changes of the map", "reachability", "areas"
ROOMS = "rooms"
WALKS, BOUND = "shortest walks", "lower bound"
LOCAL_SEARCH, REPAIR, LINE = "local search", "repair", "driven line"
CURVES = "curves"
WINDOWS, SHARES = "windows of the walk", "shares of a fleet"
# Stages in the order in which they are compiled; the stages of a plan come first.
_FOR_PLANS = (LATTICE, REACH, WALKS, BOUND, LOCAL_SEARCH, WINDOWS, REPAIR, LINE)
STAGES = tuple(dict.fromkeys((*_FOR_PLANS, CHANGES, AREAS, ROOMS, SHARES, CURVES, *PLANNER_NAMES)))
# Stages that share few kernels with the others: a second process compiles them.
APART = (LINE, CHANGES, AREAS, ROOMS, SHARES, CURVES)


def stages_of_plan(planner: str, *, has_curves: bool = False) -> tuple[str, ...]:
    """Return the stages that a plan needs, by a planner's name.

    ``has_curves``: for a robot with a turning radius.
    """
    more = (planner,) if planner in PLANNER_NAMES else ()
    return tuple(dict.fromkeys((*_FOR_PLANS, *((CURVES,) if has_curves else ()), *more)))


def stages_of_mission(planner: str, *, has_fleet: bool, has_curves: bool) -> tuple[str, ...]:
    """Return the stages that a mission needs, by its planner's name; others would take memory."""
    needed = {planner, *((SHARES,) if has_fleet else ()), *((CURVES,) if has_curves else ())}
    spared = {*PLANNER_NAMES, SHARES, CURVES} - needed
    return tuple(stage for stage in STAGES if stage not in spared)
