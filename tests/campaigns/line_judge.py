"""A judge of lines: whether a robot that drives one from point to point touches anything.

A line may begin where the robot's disc does not fit: it leads out without coming nearer to
anything. A robot that is shut in drives back along its track with a smaller margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from fasaco_edge.kernels.floor.bits import Bits
from fasaco_edge.kernels.floor.capsule import is_clear

Pixel = tuple[float, float]

# Tolerance for rounding [pixels].
NEAR_PX = 1e-3
# Distance by which the way back may lead nearer to a wall [pixels of the map].
BACK_PX = 1.5
# Step in the search for a radius [pixels].
STEP_PX = 0.125
# Largest number of points with which a line leads out.
MOST_LEADING = 3
BACK = "drives back along its track"


def why_touching(
    blocked: Bits, points: Sequence[Pixel], radius: float, reason: str, map_px: float
) -> str:
    """Return where a line touches what is not free; "" for nowhere.

    Args:
        blocked: uint64 (rows, words): pixels that are not free.
        points: y, x [pixels]; the first one is the robot's, or its place on the line.
        radius: of the robot [pixels].
        reason: why the line was published.
        map_px: edge of a pixel of the map [pixels].
    """
    radius -= NEAR_PX
    if reason.endswith(BACK):
        return _first_wall(blocked, points, max(radius - BACK_PX * map_px, radius / 2) - STEP_PX)
    leading = points[:MOST_LEADING]
    fits = (n for n, point in enumerate(leading) if is_clear(blocked, *point, *point, radius))
    begin = next(fits, None)
    if begin is None:
        # Not one that stands deep in a wall: its pose is no place for it.
        return f"a line that never leads out of {points[0]}" if len(points) > 1 else ""
    room = radius
    while room > 0.0 and not is_clear(blocked, *points[0], *points[0], room):
        room -= STEP_PX
    # On its way to the line it may stand anywhere.
    return _first_wall(blocked, points[: begin + 1], room - 2 * STEP_PX) or _first_wall(
        blocked, points[max(begin, 1) :], radius
    )


def _first_wall(blocked: Bits, points: Sequence[Pixel], radius: float) -> str:
    for start, end in pairwise(points):
        if radius > 0.0 and not is_clear(blocked, *start, *end, radius):
            return f"a wall at {start}, {end}"
    return ""
