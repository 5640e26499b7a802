"""Planners of the simulated missions: the daemon's, and the paper's."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import CoveragePlanner
from fasaco_edge.planners.registry import planner_of
from tests.benchmarks.harness import planner_for

DAEMON = "near-optimal"


class Contender(NamedTuple):
    """A planner, and whether its ants walk on the mission's living trail.

    Attributes:
        make: returns the planner, by the seed of all its streams.
        on_trail: whether; if not, each plan is made from scratch.
        about: what it is.
    """

    make: Callable[[int], CoveragePlanner]
    on_trail: bool
    about: str


def _papers(name: str) -> Callable[[int], CoveragePlanner]:
    return lambda seed: planner_of(name, ColonyConfig(seed=seed))


CONTENDERS = {
    DAEMON: Contender(planner_for, True, "the daemon's: paths are repaired by local search"),
    "fasaco": Contender(_papers("fasaco"), True, "the paper's, 1,000 ants, on the living trail"),
    "fasaco-anew": Contender(_papers("fasaco"), False, "the same, each plan from scratch"),
    "aco": Contender(_papers("aco"), True, "velocity 1, on the living trail"),
    "aco-anew": Contender(_papers("aco"), False, "the same, each plan from scratch"),
    "spiral-stc": Contender(_papers("spiral-stc"), False, "the paper's baseline, each plan anew"),
    "zigzag": Contender(_papers("zigzag"), False, "the paper's baseline, each plan anew"),
}
