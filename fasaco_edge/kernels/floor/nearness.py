"""Nearness: how much of a line leads nearer to what is blocked than the robot's clearance."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.capsule import is_clear
from fasaco_edge.kernels.jit import lean_inner_kernel

# Edges are checked in pieces of at most this length [pixels].
PIECE = 4.0


@lean_inner_kernel
def near_px(
    blocked: NDArray[np.uint64],
    points: NDArray[np.float64],
    first: int,
    last: int,
    robot: float,
    clear: float,
) -> float:
    """Return the length of edges without clearance [pixels], with the precision of a piece.

    A piece with more than half of the clearance counts half.

    Args:
        blocked: uint64 (rows, words), see ``bits``.
        points: float64 (n, 2): y, x [pixels].
        first, last: points where the first edge begins, and the last one ends.
        robot, clear: radius of the robot, and with its clearance [pixels].
    """
    half = 0.5 * (robot + clear)
    length = 0.0
    for number in range(first, last):
        ay, ax = points[number, 0], points[number, 1]
        by, bx = points[number + 1, 0], points[number + 1, 1]
        if is_clear(blocked, ay, ax, by, bx, clear):
            continue
        edge = np.sqrt((by - ay) * (by - ay) + (bx - ax) * (bx - ax))
        parts = max(int(np.ceil(edge / PIECE)), 1)
        dy, dx = (by - ay) / parts, (bx - ax) / parts
        near = 0
        for part in range(parts):
            y, x = ay + part * dy, ax + part * dx
            if not is_clear(blocked, y, x, y + dy, x + dx, clear):
                near += 1
                near += not is_clear(blocked, y, x, y + dy, x + dx, half)
        length += 0.5 * near * edge / parts
    return length
