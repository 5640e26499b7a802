"""Places: pixels where the robot's centre may be, and the floor that its tool reaches from them.

In each cell of the lattice the robot stands at one place, the nearest to the cell's centre (the
stand). If the straight segment between the stands of two neighbours is blocked, one bend may avoid
the obstacle.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.floor.bits import NONE, ONE, WORD, Bits, is_marked, spread
from fasaco_edge.kernels.floor.capsule import TOUCH, is_clear, is_clear_but, is_near
from fasaco_edge.kernels.jit import inlined, kernel, lean_inner_kernel, lean_kernel
from fasaco_edge.kernels.lattice.footprint import Box, Placement

# Bends are searched at every n-th pixel.
BEND_STEP = 2
# Longest path round a corner, in edges of a cell.
LONGEST_BEND = 3.0
# Row of a missing blocker.
FAR = -1_000_000
# Tolerance for points on the border of cells or pixels, and for distances: results must not depend
# on where the raster begins.
TIE = 1e-6


def disc_rows(radius: float) -> NDArray[np.int64]:
    """Return the reach of a disc around a pixel's centre in its own row and the following ones.

    int64 (n,): number of pixels it touches on either side of the middle one, at index i for the row
    i rows above or below. A pixel is a square, as for ``capsule.is_clear``.
    """
    radius -= TOUCH
    rows = np.arange(int(np.ceil(radius - 0.5)) + 1)
    nearest = np.maximum(rows - 0.5, 0.0)
    reach: NDArray[np.int64] = np.ceil(np.sqrt(radius * radius - nearest * nearest) - 0.5).astype(
        np.int64
    )
    return reach


def places_of(blocked: Bits, disc: NDArray[np.int64]) -> Bits:
    """Return the pixels at whose centre a disc touches nothing blocked.

    Args:
        blocked: uint64 (rows, words), see ``bits``. A rim as wide as the disc must be blocked.
        disc: see ``disc_rows``.
    """
    return ~spread(blocked, disc)


def within(marked: Bits, radius: float) -> Bits:
    """Return the pixels whose centre is within ``radius`` of the centre of a marked pixel.

    Args:
        marked: uint64 (rows, words), see ``bits``.
        radius: [pixels].
    """
    away = np.arange(int(radius + 1e-9) + 1)
    return spread(marked, np.sqrt(radius * radius - away * away + 1e-6).astype(np.int64))


@kernel
def connected(places: NDArray[np.bool_], row: int, col: int) -> NDArray[np.bool_]:
    """Return the places that are connected to one place by their edges, bool (rows, cols)."""
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


@inlined
def _cell_of(placement: Placement, i: int, j: int) -> tuple[int, int]:
    """Return the cell (row, col) in which a pixel's centre lies."""
    ux, uy = placement.ux, placement.uy
    per_cell = ux * ux + uy * uy
    dx, dy = j - placement.x0, i - placement.y0
    across, up = (ux * dx + uy * dy) / per_cell, (ux * dy - uy * dx) / per_cell
    return int(np.floor(up + TIE)), int(np.floor(across + TIE))


@lean_kernel
def keep_in_cells(
    found: NDArray[np.uint64],
    placement: Placement,
    chosen: NDArray[np.bool_],
    cell: tuple[int, int],
    corner: tuple[int, int],
) -> None:
    """Keep only the pixels of a part of the raster that lie in chosen cells.

    Args:
        found: uint64 (rows, words), the part, see ``bits``; changed.
        placement: of the lattice's cells on the raster.
        chosen: bool (rows, cols) of the lattice.
        cell: first cell (row, col) of ``chosen``.
        corner: first pixel (row, col) of the part.
    """
    is_level = placement.uy == 0.0
    for i in range(found.shape[0]):
        # On an axis-aligned lattice a row of pixels lies in one row of cells, mostly the same as
        # the row of pixels before.
        row = _cell_of(placement, corner[0] + i, corner[1])[0] - cell[0]
        if is_level and not 0 <= row < chosen.shape[0]:
            for word in range(found.shape[1]):
                found[i, word] = NONE
            continue
        for word in range(found.shape[1]):
            bits = found[i, word]
            if bits == NONE:
                continue
            first = corner[1] + WORD * word
            kept = NONE
            for bit in range(WORD):
                if (bits >> np.uint64(bit)) & ONE:
                    at = _cell_of(placement, corner[0] + i, first + bit)
                    row, col = at[0] - cell[0], at[1] - cell[1]
                    inside = 0 <= row < chosen.shape[0] and 0 <= col < chosen.shape[1]
                    if inside and chosen[row, col]:
                        kept |= ONE << np.uint64(bit)
            found[i, word] = kept


@inlined
def _pixels_of(placement: Placement, row: int, col: int, shape: tuple[int, int]) -> Box:
    """Return the smallest box of existing pixels that contains a cell."""
    ux, uy = placement.ux, placement.uy
    x = placement.x0 + ux * (col + 0.5) - uy * (row + 0.5)
    y = placement.y0 + uy * (col + 0.5) + ux * (row + 0.5)
    half = 0.5 * (abs(ux) + abs(uy))
    return Box(
        max(int(np.ceil(y - half - TIE)), 0),
        max(int(np.ceil(x - half - TIE)), 0),
        min(int(np.floor(y + half + TIE)) + 1, shape[0]),
        min(int(np.floor(x + half + TIE)) + 1, shape[1]),
    )


@lean_inner_kernel
def _step_aside(
    blocked: NDArray[np.uint64],
    places: NDArray[np.uint64],
    placement: Placement,
    cell: tuple[int, int],
    clear: float,
    stand: NDArray[np.float64],
) -> None:
    """Move a stand without clearance to a place of its cell that has it, if near enough."""
    y, x = stand[0], stand[1]
    if is_clear(blocked, y, x, y, x, clear):
        return
    rows, cols = places.shape[0], places.shape[1] << 6
    margin = int(np.ceil(clear - placement.radius)) + 1
    nearest = np.inf
    for i in range(max(int(y) - margin, 0), min(int(y) + margin + 2, rows)):
        for j in range(max(int(x) - margin, 0), min(int(x) + margin + 2, cols)):
            square = (j - x) * (j - x) + (i - y) * (i - y)
            if (
                square < nearest - TIE
                and is_marked(places, i, j)
                and _cell_of(placement, i, j) == cell
                and is_clear(blocked, i, j, i, j, clear)
            ):
                nearest = square
                stand[0], stand[1] = i, j


@lean_kernel
def choose_stands(
    blocked: NDArray[np.uint64],
    places: NDArray[np.uint64],
    placement: Placement,
    stale: NDArray[np.bool_],
    row0: int,
    col0: int,
    clear: float,
    stands: NDArray[np.float64],
) -> None:
    """Find the place nearest to the middle of each stale cell, or the middle itself if it is clear.

    A place nearby that keeps the robot's clearance is preferred.

    Args:
        blocked, places: uint64 (rows, words), see ``bits``, of the raster, whose pixel (0, 0) is
            around the point (0, 0).
        placement: where the lattice's cells lie on the raster; its radius is the robot's.
        stale: bool (rows, cols): the cells to compute.
        row0, col0: the first cell (row, col) of the arrays.
        clear: radius of the robot with its clearance [pixels].
        stands: float64 (rows, cols, 2): y, x [pixels], filled in; NaN where there is no place.
    """
    ux, uy = placement.ux, placement.uy
    is_level = uy == 0.0
    rows, cols = places.shape[0], places.shape[1] << 6
    for row, col in np.ndindex(stale.shape):
        if not stale[row, col]:
            continue
        stands[row, col, 0] = stands[row, col, 1] = np.nan
        # Centres on an axis-aligned lattice are rounded alike in a row: lanes stay straight.
        x = placement.x0 + ux * (col + col0 + 0.5) - uy * (row + row0 + 0.5)
        y = placement.y0 + uy * (col + col0 + 0.5) + ux * (row + row0 + 0.5)
        if is_level:
            x, y = np.floor(x + 0.5 + TIE), np.floor(y + 0.5 + TIE)
        i, j = int(np.floor(y + 0.5)), int(np.floor(x + 0.5))
        is_near = 0 <= i < rows and 0 <= j < cols and is_marked(places, i, j)
        if (
            is_near
            and _cell_of(placement, i, j) == (row + row0, col + col0)
            and is_clear(blocked, y, x, y, x, placement.radius)
        ):
            stands[row, col, 0], stands[row, col, 1] = y, x
            if clear > placement.radius:
                cell = row + row0, col + col0
                _step_aside(blocked, places, placement, cell, clear, stands[row, col])
            continue
        nearest = np.inf
        box = _pixels_of(placement, row + row0, col + col0, (rows, cols))
        for i in range(box.row0, box.row1):
            for j in range(box.col0, box.col1):
                square = (j - x) * (j - x) + (i - y) * (i - y)
                if (
                    square < nearest - TIE
                    and is_marked(places, i, j)
                    and _cell_of(placement, i, j) == (row + row0, col + col0)
                ):
                    nearest = square
                    stands[row, col, 0], stands[row, col, 1] = i, j
        if nearest <= 0.5 + TIE and is_clear(blocked, y, x, y, x, placement.radius):
            stands[row, col, 0], stands[row, col, 1] = y, x
        if clear > placement.radius and nearest < np.inf:
            cell = row + row0, col + col0
            _step_aside(blocked, places, placement, cell, clear, stands[row, col])


@lean_inner_kernel
def _bend(
    blocked: NDArray[np.uint64],
    places: NDArray[np.uint64],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    margin: int,
    longest: float,
    radius: float,
    bend: NDArray[np.float32],
    blockers: NDArray[np.int64],
) -> bool:
    """Find the place over which the path from a to b is shortest; False if there is none.

    ``blockers``, int64 (2, 2), is a cache: the pixels, row and col, that last blocked the segments
    from a and to b. Mostly they block the next segments, too, and testing them is fast.
    """
    blockers[:] = FAR
    rows, cols = places.shape[0], places.shape[1] << 6
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
            if not is_marked(places, i, j):
                continue
            length = np.sqrt((i - a[0]) ** 2 + (j - a[1]) ** 2)
            length += np.sqrt((i - b[0]) ** 2 + (j - b[1]) ** 2)
            y, x = float(i), float(j)
            if (
                length < best - TIE
                and not is_near(blockers[0, 0], blockers[0, 1], a[0], a[1], y, x, radius)
                and not is_near(blockers[1, 0], blockers[1, 1], y, x, b[0], b[1], radius)
                and is_clear_but(blocked, a[0], a[1], y, x, radius, blockers[0])
                and is_clear_but(blocked, y, x, b[0], b[1], radius, blockers[1])
            ):
                best = length
                bend[0], bend[1] = y, x
    return best < longest


@lean_kernel
def link_stands(
    blocked: NDArray[np.uint64],
    places: NDArray[np.uint64],
    placement: Placement,
    stale: NDArray[np.bool_],
    stands: NDArray[np.float64],
    steps: NDArray[np.uint8],
    bends: NDArray[np.float32],
    blockers: NDArray[np.int64],
) -> None:
    """Find the steps of stale cells to the neighbours in the east and in the north.

    Args:
        blocked, places: of the raster.
        placement: of the lattice's cells on the raster.
        stale: bool (rows, cols): the cells to compute.
        stands: float64 (rows, cols, 2), see ``choose_stands``.
        steps: uint8 (rows, cols), changed: bit ``1 << direction`` for each legal step.
        bends: float32 (rows, cols, 2, 2), changed: where the step east, and the step north, has
            a bend, y, x [pixels]; NaN for a straight one.
        blockers: int64 (2, 2), memory.
    """
    rows, cols = steps.shape
    radius = placement.radius
    cell = np.sqrt(placement.ux * placement.ux + placement.uy * placement.uy)
    for row, col in np.ndindex(stale.shape):
        if not stale[row, col]:
            continue
        # No step leads out of the arrays.
        if col == 0:
            steps[row, col] &= 15 - (1 << WEST)
        if row == 0:
            steps[row, col] &= 15 - (1 << SOUTH)
        a = stands[row, col]
        for axis in range(2):
            there, back = (EAST, WEST) if axis == 0 else (NORTH, SOUTH)
            far_row, far_col = row + axis, col + 1 - axis
            bend = bends[row, col, axis]
            bend[0] = bend[1] = np.nan
            steps[row, col] &= 15 - (1 << there)
            if far_row >= rows or far_col >= cols:
                continue
            steps[far_row, far_col] &= 15 - (1 << back)
            b = stands[far_row, far_col]
            if np.isnan(a[0]) or np.isnan(b[0]):
                continue
            if not is_clear(blocked, a[0], a[1], b[0], b[1], radius):
                longest = LONGEST_BEND * cell
                if not _bend(blocked, places, a, b, int(cell), longest, radius, bend, blockers):
                    continue
            steps[row, col] |= 1 << there
            steps[far_row, far_col] |= 1 << back
