"""Registry of planners, the only list of their names.

A new planner is a factory in a module here, a row of ``PLANNERS`` and a test; configuration and
command line take the names from here. Factories are imported on use, so that reading the names does
not load numba.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import NamedTuple, cast

from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import CoveragePlanner

Factory = Callable[[ColonyConfig, int], CoveragePlanner]


class Entry(NamedTuple):
    """Factories of a planner as "module:callable", the module in ``fasaco_edge.planners``.

    Each takes the colony's configuration and a number of threads.

    Attributes:
        factory: the planner as published.
        about: description for the command line's help.
        with_local_search: the planner with local search; "" for none.
    """

    factory: str
    about: str
    with_local_search: str = ""


PLANNERS = {
    "fasaco": Entry(
        "paper.fasaco:Fasaco", "ants", with_local_search="search.near_optimal:NearOptimal"
    ),
    "aco": Entry("paper.fasaco:plain_aco", "fasaco at velocity 1"),
    "stc": Entry("paper.baselines:stc", "spanning-tree coverage"),
    "spiral-stc": Entry("paper.baselines:spiral_stc", "the paper's baseline"),
    "zigzag": Entry("paper.baselines:zigzag", "the paper's baseline"),
}
PLANNER_NAMES = tuple(PLANNERS)


def planner_of(
    name: str, colony: ColonyConfig, threads: int = 1, local_search: bool = False
) -> CoveragePlanner:
    """Return the planner ``name``; with local search if requested and available."""
    entry = PLANNERS[name]
    place = (local_search and entry.with_local_search) or entry.factory
    module, _, factory = place.partition(":")
    make = cast(Factory, getattr(import_module(f"fasaco_edge.planners.{module}"), factory))
    return make(colony, threads)
