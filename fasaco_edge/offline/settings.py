"""Settings of a plan: its end, its line, and its search."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from numbers import Integral, Real

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.paper.colony import ColonyConfig, parse_velocities
from fasaco_edge.planners.registry import PLANNERS

# Ends of a walk other than a cell.
ANYWHERE, HOME = "anywhere", "home"
# The line through cell centres, and the default line over the floor; see ``planners.line``.
CELLS, THOROUGH = "cells", "thorough"
# Directions of the rows of cells for a line over the floor, other than an angle [deg].
WALLS, AXES = "walls", "axes"
# Default time budget of a planner with local search [s]; other planners have none. Values of q0 in
# equation (4), Carr and Wang 2022: the best with local search, and the paper's.
BUDGET_S = 2.0
SEARCH_Q0, PAPER_Q0 = 0.9, 0.7
# Planner whose settings apply to a planner of the user's own.
LIKE_OWN = "fasaco"

# Type checks by annotation, including NumPy's numbers.
_KINDS: dict[str, tuple[type, str]] = {
    "str": (str, "be a text"),
    "int": (Integral, "be a whole number"),
    "float": (Real, "be a number"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Settings of a search.

    Attributes:
        planner: one of ``planners.registry``.
        ants, velocities, visibility, beta, alpha, tau0, seed: see ``ColonyConfig``; velocities as
            text, like 8:1.
        q0: see ``ColonyConfig``; None for the value that suits the planner.
        threads: number of threads of the ants; the walk is the same for any number.
        budget_s: time limit of the search for walks and a line [s]. With local search, the first
            walk and line are always completed. Default: 2 s with local search, no limit without,
            60 s for a planner of your own, which is ended then.
        swept: share of the reachable floor that the line has to sweep in the least time; then three
            stages are completed regardless of the budget. None for floor worth its time.

    Raises:
        BadConfiguration: a value is invalid.
    """

    planner: str = "colony-search"
    ants: int = 1000
    velocities: str = "8:1"
    q0: float | None = None
    visibility: str = "neighbour"
    beta: float = 2.0
    alpha: float = 0.1
    tau0: float = 0.1
    seed: int = 0
    threads: int = 1
    budget_s: float | None = None
    swept: float | None = None

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
        if self.swept is not None:
            require(
                0.0 < self.swept <= 1.0, "swept", "be a share in (0, 1], such as 0.99", self.swept
            )

    @property
    def has_local_search(self) -> bool:
        """Whether the planner has local search."""
        return PLANNERS[self.planner].has_local_search

    @property
    def most_s(self) -> float | None:
        """The time budget [s]; None for no limit."""
        if self.budget_s is None and self.has_local_search:
            return BUDGET_S
        return self.budget_s

    def colony(self) -> ColonyConfig:
        """Return the configuration of the colony.

        Raises:
            BadConfiguration: a value is invalid.
        """
        q0 = SEARCH_Q0 if self.has_local_search else PAPER_Q0
        return ColonyConfig(
            ants=self.ants,
            velocities=parse_velocities(self.velocities),
            q0=q0 if self.q0 is None else self.q0,
            seed=self.seed,
            visibility=self.visibility,
            beta=self.beta,
            alpha=self.alpha,
            tau0=self.tau0,
        )


def default_line(search: Search, *, has_floor: bool) -> str:
    """Return the default line.

    It leads through cell centres for the paper's planners, and on a coverage grid, without floor.
    """
    return THOROUGH if has_floor and search.has_local_search else CELLS


def require(condition: bool, name: str, expectation: str, value: object) -> None:
    """Raise BadConfiguration unless the condition on a named value holds."""
    if not condition:
        raise BadConfiguration(f"{name} must {expectation}, got {value}")
