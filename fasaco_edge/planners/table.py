"""All planners by name."""

from __future__ import annotations

from collections.abc import Callable

from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.fasaco import Fasaco
from fasaco_edge.planners.planner import CoveragePlanner

PLANNERS: dict[str, Callable[[ColonyConfig], CoveragePlanner]] = {
    "fasaco": Fasaco,
}
