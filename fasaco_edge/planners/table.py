"""All planners by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from fasaco_edge.planners.baselines import SpanningTree, spiral_stc, zigzag
from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.fasaco import Fasaco
from fasaco_edge.planners.near_optimal import NearOptimal
from fasaco_edge.planners.planner import CoveragePlanner

# Each alone, as the paper has them. Each is made from the colony's configuration and
# a number of threads; what has no ants needs neither.
PLANNERS: dict[str, Callable[[ColonyConfig, int], CoveragePlanner]] = {
    "fasaco": Fasaco,
    "aco": lambda colony, threads: Fasaco(replace(colony, velocities=(1,)), threads, name="aco"),
    "stc": lambda colony, threads: SpanningTree(),
    "spiral-stc": lambda colony, threads: spiral_stc(),
    "zigzag": lambda colony, threads: zigzag(),
}


def planner_of(
    name: str, colony: ColonyConfig, threads: int, local_search: bool
) -> CoveragePlanner:
    """Return the planner ``name``; fasaco with local search where that is asked for."""
    if name == "fasaco" and local_search:
        return NearOptimal(colony, threads)
    return PLANNERS[name](colony, threads)
