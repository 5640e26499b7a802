"""Registry of planners, the only list of their names.

Configuration and command line take the names from here. Factories are imported on use, so that
reading the names does not load numba.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import NamedTuple, cast

from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import CoveragePlanner

Factory = Callable[[ColonyConfig, int], CoveragePlanner]


class Entry(NamedTuple):
    """Row of a planner.

    Attributes:
        factory: "module:callable", the module in ``fasaco_edge.planners``; it takes the colony's
            configuration and a number of threads.
        about: description for the command line's help.
        has_local_search: whether it searches until stopped, and takes a direction for its lanes.
    """

    factory: str
    about: str
    has_local_search: bool = False


PLANNERS = {
    "colony-search": Entry(
        "search.near_optimal:NearOptimal",
        "local search; in every other perturbation ants rebuild a part of the walk along the "
        "pheromone trail",
        has_local_search=True,
    ),
    "fasaco": Entry("paper.fasaco:Fasaco", "the paper's colony, without local search"),
    "aco": Entry("paper.fasaco:plain_aco", "fasaco at velocity 1"),
    "stc": Entry("paper.baselines:stc", "spanning-tree coverage"),
    "spiral-stc": Entry("paper.baselines:spiral_stc", "the paper's baseline"),
    "zigzag": Entry("paper.baselines:zigzag", "the paper's baseline"),
}
PLANNER_NAMES = tuple(PLANNERS)


def planner_of(name: str, colony: ColonyConfig, threads: int = 1) -> CoveragePlanner:
    """Return the planner ``name``."""
    module, _, factory = PLANNERS[name].factory.partition(":")
    make = cast(Factory, getattr(import_module(f"fasaco_edge.planners.{module}"), factory))
    return make(colony, threads)
