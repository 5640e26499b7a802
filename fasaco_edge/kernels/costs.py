"""Cost of a walk."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import lean_kernel


@lean_kernel
def walk_cost(walk: NDArray[np.int32], step_us: int, quarter_turn_us: int) -> int:
    """Return the cost [us] of a walk of flat cells, int32 (n,) with n >= 1.

    A half turn is two quarter-turns; before the first step there is no turn.
    """
    quarters = 0
    if quarter_turn_us:
        for index in range(2, walk.size):
            # A step is one difference of index and its opposite the negated one. (With one
            # column, east is the same as north; but then there are no steps east.)
            before = walk[index - 1] - walk[index - 2]
            after = walk[index] - walk[index - 1]
            if after == -before:
                quarters += 2
            elif after != before:
                quarters += 1
    return int((walk.size - 1) * step_us + quarters * quarter_turn_us)
