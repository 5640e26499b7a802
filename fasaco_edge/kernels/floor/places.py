"""Places: pixels where the robot's centre may be, and the floor that its tool reaches from them.

In each cell of the lattice the robot stands at one place, the nearest to the cell's middle. Where
the straight way between the stands of two neighbours is blocked, one bend may lead round.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.floor.capsule import is_clear
from fasaco_edge.kernels.jit import kernel, lean_kernel
from fasaco_edge.kernels.lattice.footprint import Placement

# Bends are looked for at every so many-th pixel.
BEND_STEP = 2
# A way round a corner is at most so many times as long as a cell is wide.
LONGEST_BEND = 3.0


@lean_kernel
def find_places(blocked: NDArray[np.int32], radius: float, places: NDArray[np.bool_]) -> None:
    """Mark the pixels at whose centre the robot's disc touches nothing blocked.

    Args:
        blocked: int32 (rows, cols + 1), see ``capsule.is_clear``.
        radius: of the robot [pixels].
        places: bool (rows, cols), filled in.
    """
    rows, cols = places.shape
    reach = int(radius)
    for i in range(rows):
        for j in range(cols):
            # Most pixels of a wall, and of what is unknown, are told by their own row.
            from_col, to_col = max(j - reach, 0), min(j + reach, cols - 1)
            if blocked[i, to_col + 1] != blocked[i, from_col]:
                places[i, j] = False
            else:
                y, x = float(i), float(j)
                places[i, j] = is_clear(blocked, y, x, y, x, radius)


@kernel
def connected(places: NDArray[np.bool_], row: int, col: int) -> NDArray[np.bool_]:
    """Return the places that are joined to one of them by their edges, bool (rows, cols)."""
    rows, cols = places.shape
    found = np.zeros((rows, cols), np.bool_)
    waiting = np.empty(rows * cols, np.int32)
    waiting[0] = row * cols + col
    found[row, col] = True
    count = 1
    while count:
        count -= 1
        i, j = waiting[count] // cols, waiting[count] % cols
        for di, dj in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            y, x = i + di, j + dj
            if 0 <= y < rows and 0 <= x < cols and places[y, x] and not found[y, x]:
                found[y, x] = True
                waiting[count] = y * cols + x
                count += 1
    return found


@kernel
def within(marked: NDArray[np.bool_], radius: float) -> NDArray[np.bool_]:
    """Return the pixels whose centre is within ``radius`` of a marked one's, bool (rows, cols)."""
    rows, cols = marked.shape
    far = np.int32(1 << 20)
    beside = np.empty((rows, cols), np.int32)
    for i in range(rows):
        distance = far
        for j in range(cols):
            distance = np.int32(0) if marked[i, j] else np.int32(min(distance + 1, far))
            beside[i, j] = distance
        distance = far
        for j in range(cols - 1, -1, -1):
            distance = np.int32(0) if marked[i, j] else np.int32(min(distance + 1, far))
            beside[i, j] = min(beside[i, j], distance)
    found = np.zeros((rows, cols), np.bool_)
    most = int(radius + 1e-9)
    for di in range(-most, most + 1):
        half = int(np.sqrt(radius * radius - di * di + 1e-6))
        for i in range(max(0, -di), min(rows, rows - di)):
            here, there = found[i], beside[i + di]
            for j in range(cols):
                here[j] |= there[j] <= half
    return found


@lean_kernel
def choose_stands(
    blocked: NDArray[np.int32],
    places: NDArray[np.bool_],
    placement: Placement,
    row0: int,
    col0: int,
    stands: NDArray[np.float64],
    distances: NDArray[np.float64],
) -> None:
    """Find for each cell the place nearest to its middle; the middle itself if that is clear.

    Args:
        blocked, places: of the raster, whose pixel (0, 0) is around the point (0, 0).
        placement: where the lattice's cells lie on it; its radius is the robot's.
        row0, col0: the first cell (row, col) of the arrays.
        stands: float64 (rows, cols, 2): y, x [pixels], filled in; NaN where there is no place.
        distances: float64 (rows, cols), scratch.
    """
    rows, cols = distances.shape
    ux, uy = placement.ux, placement.uy
    per_cell = ux * ux + uy * uy
    is_level = uy == 0.0
    distances.fill(np.inf)
    stands.fill(np.nan)
    for i in range(places.shape[0]):
        for j in range(places.shape[1]):
            if not places[i, j]:
                continue
            dx, dy = j - placement.x0, i - placement.y0
            across, up = (ux * dx + uy * dy) / per_cell, (ux * dy - uy * dx) / per_cell
            row, col = int(np.floor(up)), int(np.floor(across))
            # Middles on a level lattice are rounded to pixels alike in a row: lanes stay straight.
            x = placement.x0 + ux * (col + 0.5) - uy * (row + 0.5)
            y = placement.y0 + uy * (col + 0.5) + ux * (row + 0.5)
            if is_level:
                x, y = np.floor(x + 0.5), np.floor(y + 0.5)
            square = (j - x) * (j - x) + (i - y) * (i - y)
            row -= row0
            col -= col0
            if 0 <= row < rows and 0 <= col < cols and square < distances[row, col]:
                distances[row, col] = square
                stands[row, col, 0], stands[row, col, 1] = i, j
                if square <= 0.5 and is_clear(blocked, y, x, y, x, placement.radius):
                    stands[row, col, 0], stands[row, col, 1] = y, x
                    distances[row, col] = -1.0


@lean_kernel
def _bend(
    blocked: NDArray[np.int32],
    places: NDArray[np.bool_],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    margin: int,
    longest: float,
    radius: float,
    bend: NDArray[np.float64],
) -> bool:
    """Find the place over which the way from a to b is shortest; False where there is none."""
    rows, cols = places.shape
    best = longest
    for i in range(
        max(int(min(a[0], b[0])) - margin, 0),
        min(int(max(a[0], b[0])) + margin + 1, rows),
        BEND_STEP,
    ):
        for j in range(
            max(int(min(a[1], b[1])) - margin, 0),
            min(int(max(a[1], b[1])) + margin + 1, cols),
            BEND_STEP,
        ):
            if not places[i, j]:
                continue
            length = np.sqrt((i - a[0]) ** 2 + (j - a[1]) ** 2)
            length += np.sqrt((i - b[0]) ** 2 + (j - b[1]) ** 2)
            y, x = float(i), float(j)
            if (
                length < best
                and is_clear(blocked, a[0], a[1], y, x, radius)
                and is_clear(blocked, y, x, b[0], b[1], radius)
            ):
                best = length
                bend[0], bend[1] = y, x
    return best < longest


@lean_kernel
def link_stands(
    blocked: NDArray[np.int32],
    places: NDArray[np.bool_],
    stands: NDArray[np.float64],
    cell: float,
    radius: float,
    steps: NDArray[np.uint8],
    bends: NDArray[np.float64],
) -> None:
    """Find the steps between the stands of neighbours.

    Args:
        blocked, places: of the raster.
        stands: float64 (rows, cols, 2), see ``choose_stands``.
        cell: edge of a cell [pixels].
        radius: of the robot [pixels].
        steps: uint8 (rows, cols), filled in: bit ``1 << direction`` for each legal step.
        bends: float64 (rows, cols, 2, 2), filled in: where the step east, and the step north, has
            a bend, y, x [pixels]; NaN for a straight one.
    """
    rows, cols = steps.shape
    steps.fill(0)
    bends.fill(np.nan)
    for row in range(rows):
        for col in range(cols):
            a = stands[row, col]
            if np.isnan(a[0]):
                continue
            for axis in range(2):
                far_row, far_col = row + axis, col + 1 - axis
                if far_row >= rows or far_col >= cols or np.isnan(stands[far_row, far_col, 0]):
                    continue
                b = stands[far_row, far_col]
                if not is_clear(blocked, a[0], a[1], b[0], b[1], radius):
                    longest, bend = LONGEST_BEND * cell, bends[row, col, axis]
                    if not _bend(blocked, places, a, b, int(cell), longest, radius, bend):
                        continue
                there, back = (EAST, WEST) if axis == 0 else (NORTH, SOUTH)
                steps[row, col] |= 1 << there
                steps[far_row, far_col] |= 1 << back
