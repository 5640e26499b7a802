"""What a search has done: counted, so that it can be done again."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SearchWork:
    """Work of a search in counts; with problem, planner and seed they repeat its path.

    Attributes:
        ants: ants that walked, and the sweeps that a search begins with.
        kicks: how often a local search left a local optimum.
        proposals: moves that a local search tried.
    """

    ants: int = 0
    kicks: int = 0
    proposals: int = 0

    def __add__(self, other: SearchWork) -> SearchWork:
        return SearchWork(
            self.ants + other.ants, self.kicks + other.kicks, self.proposals + other.proposals
        )

    def reaches(self, limit: SearchWork) -> bool:
        """Tell whether every count has come to that of ``limit``."""
        return (
            self.ants >= limit.ants
            and self.kicks >= limit.kicks
            and self.proposals >= limit.proposals
        )


NO_WORK = SearchWork()


@dataclass(frozen=True, slots=True)
class SearchProgress:
    """How far a search is; what a stopping criterion is asked with.

    Attributes:
        work: what it has done so far.
        cost_s: cost of the best walk so far [s].
        steps: its steps.
        lower_bound_steps: no walk has fewer steps; 0 where no bound is known.
    """

    work: SearchWork
    cost_s: float
    steps: int
    lower_bound_steps: int = 0

    @property
    def gap(self) -> float | None:
        """How much longer than the bound the best walk is; None without a bound."""
        return gap_to(self.lower_bound_steps, self.steps)


def gap_to(lower_bound_steps: int, steps: int) -> float | None:
    """Return ``steps / lower_bound_steps - 1``; None where the bound is 0, not known.

    One division of whole numbers: 115 steps over a bound of 100 are 0.15 and not a bit more.
    """
    return (steps - lower_bound_steps) / lower_bound_steps if lower_bound_steps > 0 else None
