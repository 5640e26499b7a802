"""Holes of the ground, and a test whether a loop encloses one.

The moves of the local search change a walk within unit squares. They cannot change
whether the walk passes an obstacle on one side an odd or an even number of times: the
parity of a walk's steps is a chain over the two-element field, a square adds a boundary,
and the invariant is the chain's class in the first homology of the ground. Changing the
class takes a loop around a hole. To find one, each hole has a ray to the east, and a loop
encloses some hole if the rays it crosses do not cancel out.

A hole is a connected set of squares with a missing step; the outside is no hole.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import EAST, NORTH
from fasaco_edge.kernels.jit import as_value, inner_kernel, kernel
from fasaco_edge.kernels.local_search.walk_array import Ground
from fasaco_edge.kernels.random import draw


@inner_kernel
def _has(ground: Ground, cell: int, direction: int) -> bool:
    return bool(ground.steps[cell] >> direction & 1)


@inner_kernel
def _is_whole(ground: Ground, corner: int) -> bool:
    """Return whether the square north-east of ``corner`` has all four steps."""
    north = ground.offsets[NORTH]
    return (
        _has(ground, corner, EAST)
        and _has(ground, corner, NORTH)
        and _has(ground, corner + 1, NORTH)
        and _has(ground, corner + north, EAST)
    )


@inner_kernel
def _flood(
    ground: Ground, first: int, seen: NDArray[np.uint8], queue: NDArray[np.int32], bound: int
) -> None:
    """Mark all squares that are connected to ``first`` across missing steps."""
    north = ground.offsets[NORTH]
    queue[0] = first
    seen[first] = 1
    head, tail = 0, 1
    while head < tail:
        square = queue[head]
        head += 1
        beside = (square + 1, square + north, square - 1, square - north)
        closed = (
            _has(ground, square + 1, NORTH),
            _has(ground, square + north, EAST),
            _has(ground, square, NORTH),
            _has(ground, square, EAST),
        )
        for side in range(4):
            after = beside[side]
            if closed[side] or not 0 <= after < bound or seen[after]:
                continue
            seen[after] = 1
            queue[tail] = after
            tail += 1


@kernel
def rays(ground: Ground, rays_crossed: NDArray[np.int64]) -> int:
    """Set the rays; return the number of holes.

    Args:
        ground: framed by cells without steps.
        rays_crossed: out, int64 (n,): which rays the step to the north of a cell
            crosses, as a sum (exclusive or) of one random number for each ray.
            Steps along a row cross none.
    """
    size, north = ground.bound, ground.offsets[NORTH]
    bound = size - north - 1
    seen = np.zeros(size, np.uint8)
    queue = np.empty(size, np.int32)
    numbers = np.full(1, 88172645463325252, np.uint64)
    rays_crossed[:] = 0
    _flood(ground, as_value(0), seen, queue, bound)
    holes, ray = 0, 0
    for square in range(bound):
        # A ray ends with its row: the frame has no step to cross.
        if square % north == 0:
            ray = 0
        rays_crossed[square] = ray
        if not seen[square] and not _is_whole(ground, square):
            _flood(ground, square, seen, queue, bound)
            ray ^= draw(numbers)
            holes += 1
    return holes
