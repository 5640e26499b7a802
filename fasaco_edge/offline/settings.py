"""Settings of a plan: where it ends, which line it is for, and how to search."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from numbers import Integral, Real

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.paper.colony import ColonyConfig, parse_velocities
from fasaco_edge.planners.registry import PLANNERS

# Where a walk ends, other than in a cell.
ANYWHERE, HOME = "anywhere", "home"
# The line through the cells' centres; the others are in ``planners.line``.
CELLS, THOROUGH = "cells", "thorough"
# What the cells of a line over the floor lie along; or an angle [deg].
WALLS, AXES = "walls", "axes"
MOST_ANGLE_DEG = 360.0
# The search's default budget [s], and the colony's settings that serve local search best. The
# colony alone is the paper's, and walks to its end.
BUDGET_S = 1.0
SEARCH_Q0, PAPER_Q0 = 0.98, 0.7
SEARCH_VISIBILITY, PAPER_VISIBILITY = "fewest-open", "neighbour"


# By annotation: what a member has to be, NumPy's numbers included.
_KINDS: dict[str, tuple[type, str]] = {
    "str": (str, "be a text"),
    "bool": (bool, "be True or False"),
    "int": (Integral, "be a whole number"),
    "float": (Real, "be a number"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """How to search for a walk.

    Attributes:
        planner: one of ``planners.registry``.
        local_search: whether a planner that can do so improves its walks; the paper's
            colony alone where False.
        ants, velocities, beta, alpha, tau0, seed: of the colony, see ``ColonyConfig``; velocities
            as text, like 8:1.
        q0, visibility: the same; None for what serves best with local search, or without.
        threads: that ants walk on; the walk is the same for any number.
        budget_s: time after which the search ends with its best walk [s]; None for 1 s with local
            search, and no end without.
        target_gap: end once the walk is proven to be within this share of the optimum; None for
            never.

    Raises:
        BadConfiguration: a value is impossible.
    """

    planner: str = "fasaco"
    local_search: bool = True
    ants: int = 1000
    velocities: str = "8:1"
    q0: float | None = None
    visibility: str | None = None
    beta: float = 2.0
    alpha: float = 0.1
    tau0: float = 0.1
    seed: int = 0
    threads: int = 1
    budget_s: float | None = None
    target_gap: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            kind, expectation = _KINDS[str(field.type).removesuffix(" | None")]
            value = getattr(self, field.name)
            is_open = value is None and str(field.type).endswith("None")
            require(is_open or isinstance(value, kind), field.name, expectation, value)
        known = ", ".join(PLANNERS)
        require(self.planner in PLANNERS, "planner", f"be one of {known}", self.planner)
        require(1 <= self.threads <= 64, "threads", "be in 1..64", self.threads)
        if self.budget_s is not None:
            possible = math.isfinite(self.budget_s) and self.budget_s > 0.0
            require(possible, "budget", "be finite and above 0 s", self.budget_s)
        if self.target_gap is not None:
            possible = 0.0 <= self.target_gap <= 10.0
            require(possible, "target gap", "be in [0, 10]", self.target_gap)

    @property
    def has_local_search(self) -> bool:
        """Whether walks are improved by local search."""
        return self.local_search and bool(PLANNERS[self.planner].with_local_search)

    @property
    def most_s(self) -> float | None:
        """The budget [s]; None for no end."""
        if self.budget_s is None and self.has_local_search:
            return BUDGET_S
        return self.budget_s

    def colony(self) -> ColonyConfig:
        """Return the colony.

        Raises:
            BadConfiguration: a value is impossible.
        """
        q0, visibility = PAPER_Q0, PAPER_VISIBILITY
        if self.has_local_search:
            q0, visibility = SEARCH_Q0, SEARCH_VISIBILITY
        return ColonyConfig(
            ants=self.ants,
            velocities=parse_velocities(self.velocities),
            q0=q0 if self.q0 is None else self.q0,
            seed=self.seed,
            visibility=self.visibility or visibility,
            beta=self.beta,
            alpha=self.alpha,
            tau0=self.tau0,
        )


def default_line(search: Search, *, has_floor: bool) -> str:
    """Return which line is made where none is asked for.

    The paper's planners drive through the centres of cells, and a coverage grid has no floor.
    """
    return THOROUGH if has_floor and search.has_local_search else CELLS


def require(condition: bool, name: str, expectation: str, value: object) -> None:
    """Raise BadConfiguration where a value, of that name, is not as expected."""
    if not condition:
        raise BadConfiguration(f"{name} must {expectation}, got {value}")
