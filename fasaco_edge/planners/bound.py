"""How short a covering walk can be at best."""

from __future__ import annotations

import numpy as np

from fasaco_edge.kernels.bound import covering_bound
from fasaco_edge.planners.graph import flat_end, flat_start
from fasaco_edge.planners.problem import CoverageProblem


def lower_bound_steps(problem: CoverageProblem) -> int:
    """Return a number of steps that no walk which solves ``problem`` can beat.

    Turns do not enter it. The proof stands in ``kernels.bound``.
    """
    required = problem.to_cover.astype(np.uint8)
    return covering_bound(problem.lattice.steps, required, flat_start(problem), flat_end(problem))
