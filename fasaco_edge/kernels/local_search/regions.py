"""Regions of a large ground: changed cells of a walk, and its parts cut out and put back.

Each stretch of the walk outside of the region becomes one jump in the region's own walk, between
the border cells where the walk leaves and re-enters. Jumps and border cells do not change
(``needed`` is FIXED, no step leads there). So an improvement of the region's walk improves the
whole walk, which stays connected. When the region is put back, the outside stretches are copied in
the order and direction in which the region's walk now visits them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import NORTH
from fasaco_edge.kernels.jit import inlined, lean_kernel
from fasaco_edge.kernels.local_search.walk_array import (
    FIXED,
    FRAME,
    ROOM_BITS,
    Ground,
    axis_of,
    copy,
)


@lean_kernel
def changed_cells(
    ground: Ground,
    before: NDArray[np.int32],
    walk: NDArray[np.int32],
    times: NDArray[np.int32],
    cells: NDArray[np.int32],
) -> int:
    """List the cells at steps with different multiplicities in two walks.

    Args:
        ground: where both walks lie; cells without a step are left out.
        before, walk: int32 (m,), (n,).
        times: int32 (cells of the ground, 2), all 0: working memory.
        cells: out, int32 (2 * (m + n),): a cell may be listed more than once.

    Returns:
        The number listed.
    """
    for index in range(walk.size - 1):
        one, other = walk[index], walk[index + 1]
        times[min(one, other), axis_of(one, other)] += 1
    for index in range(before.size - 1):
        one, other = before[index], before[index + 1]
        times[min(one, other), axis_of(one, other)] -= 1
    listed = 0
    for steps in (walk, before):
        for index in range(steps.size - 1):
            one, other = steps[index], steps[index + 1]
            if times[min(one, other), axis_of(one, other)] == 0:
                continue
            for cell in (one, other):
                if ground.steps[cell]:
                    cells[listed] = cell
                    listed += 1
    return listed


@lean_kernel
def neighbourhood(
    ground: Ground,
    cells: NDArray[np.int32],
    radius: int,
    labels: NDArray[np.int32],
    label: int,
    found: NDArray[np.int32],
) -> int:
    """Label some cells, and the cells around them.

    Args:
        ground: where they lie.
        cells: int32 (n,).
        radius: steps from them to the rim.
        labels: int32 (cells of the ground,), changed in place.
        label: a label that no cell has yet.
        found: out, int32 (capacity,), the labelled cells, nearest first; no more are
            labelled than fit.

    Returns:
        The number labelled.
    """
    size = 0
    for cell in cells:
        if labels[cell] != label and size < found.size:
            labels[cell] = label
            found[size] = cell
            size += 1
    first = 0
    for _ in range(radius):
        last = size
        for index in range(first, last):
            cell = found[index]
            for direction in range(4):
                beside = cell + ground.offsets[direction]
                is_open = ground.steps[cell] >> direction & 1 and labels[beside] != label
                if is_open and size < found.size:
                    labels[beside] = label
                    found[size] = beside
                    size += 1
        first = last
    return size


# Entries of ``Jumps.limits``.
BEFORE, AFTER = 0, 1


class RegionBox(NamedTuple):
    """A region: the cells with its label, and the rectangle they lie in.

    Its own ground is the rectangle with a frame around it.

    Attributes:
        labels: int32 (n,), label of each cell of the large ground.
        label: the region's.
        row, col: the rectangle's first row and column in the large ground.
        rows, cols: its size.
    """

    labels: NDArray[np.int32]
    label: int
    row: int
    col: int
    rows: int
    cols: int


class Jumps(NamedTuple):
    """The parts of the whole walk outside a region; jump i is the region's cell ``bound + i``.

    Attributes:
        ends: int32 (jumps, 2), the cells of the region's ground a jump leads between.
        sections: int32 (jumps, 2), first and last visit of the whole walk that the jump
            stands for.
        limits: int64 (2,): visits up to BEFORE come before the region's walk, visits from AFTER on
            come after it.
    """

    ends: NDArray[np.int32]
    sections: NDArray[np.int32]
    limits: NDArray[np.int64]


@inlined
def _bound(box: RegionBox) -> int:
    """Return the number of cells of the region's ground with its frame."""
    return (box.rows + 2 * FRAME) * (box.cols + 2 * FRAME)


@inlined
def _local(ground: Ground, box: RegionBox, cell: int) -> int:
    """Return a cell of the large ground, inside or just beside the box, as a cell of the region."""
    width = ground.offsets[NORTH]
    row, col = cell // width - box.row, cell % width - box.col
    return int((row + FRAME) * (box.cols + 2 * FRAME) + col + FRAME)


@inlined
def _large(ground: Ground, box: RegionBox, cell: int) -> int:
    """Return a cell of the region as a cell of the large ground."""
    width = box.cols + 2 * FRAME
    row, col = cell // width - FRAME + box.row, cell % width - FRAME + box.col
    return int(row * ground.offsets[NORTH] + col)


@lean_kernel
def cut_ground(ground: Ground, box: RegionBox, region: Ground) -> int:
    """Fill the region's steps and needs; return how many cells it has."""
    region.steps[:] = 0
    region.needed[:] = FIXED
    width, cells = ground.offsets[NORTH], 0
    for row in range(box.row, box.row + box.rows):
        for col in range(box.col, box.col + box.cols):
            cell = row * width + col
            if box.labels[cell] != box.label or ground.steps[cell] == 0:
                continue
            mask = ground.steps[cell] & ROOM_BITS
            for direction in range(4):
                beside = cell + ground.offsets[direction]
                if ground.steps[cell] >> direction & 1 and box.labels[beside] == box.label:
                    mask |= 1 << direction
            here = _local(ground, box, cell)
            region.steps[here] = mask
            region.needed[here] = ground.needed[cell]
            cells += 1
    return cells


@lean_kernel
def cut_walk(
    ground: Ground, box: RegionBox, cells: NDArray[np.int32], walk: NDArray[np.int32], jumps: Jumps
) -> tuple[int, int]:
    """Write the parts of a walk that lie in the region, with jumps between them.

    Args:
        ground: the large ground.
        box: the region.
        cells: int32 (length,), the whole walk.
        walk: out, int32 (capacity,), the region's walk.
        jumps: out.

    Returns:
        Length of the region's walk and number of jumps; (0, 0) if the walk does not enter the
        region or does not fit.
    """
    bound, limits = _bound(box), jumps.limits
    length, made, visit = 0, 0, 0
    while visit < cells.size and box.labels[cells[visit]] != box.label:
        visit += 1
    if visit == cells.size:
        return 0, 0
    limits[BEFORE], limits[AFTER] = 0, cells.size
    if visit > 0:
        limits[BEFORE] = visit - 1
        walk[0] = _local(ground, box, cells[visit - 1])
        length = 1
    while visit < cells.size:
        if length + 4 > walk.size:
            return 0, 0
        here = _local(ground, box, cells[visit])
        walk[length] = here
        length += 1
        if box.labels[cells[visit]] == box.label:
            visit += 1
            continue
        first = visit
        while visit < cells.size and box.labels[cells[visit]] != box.label:
            visit += 1
        if visit == cells.size:
            limits[AFTER] = first + 1
            break
        if made == jumps.sections.shape[0]:
            return 0, 0
        there = _local(ground, box, cells[visit - 1])
        walk[length], walk[length + 1] = bound + made, there
        length += 2
        jumps.ends[made, 0], jumps.ends[made, 1] = here, there
        jumps.sections[made, 0], jumps.sections[made, 1] = first, visit - 1
        made += 1
    return length, made


@lean_kernel
def put_back(
    ground: Ground,
    box: RegionBox,
    cells: NDArray[np.int32],
    walk: NDArray[np.int32],
    jumps: Jumps,
    out: NDArray[np.int32],
) -> int:
    """Write the whole walk with the region's parts as they are now; return its length.

    Args:
        ground, box, cells, jumps: as in ``cut_walk``.
        walk: int32 (m,), the region's walk.
        out: int32 (capacity,), long enough.
    """
    bound, sections, limits = _bound(box), jumps.sections, jumps.limits
    length = limits[BEFORE]
    copy(cells, out, length)
    written = False
    for cell in walk:
        if cell < bound:
            if not written:
                out[length] = _large(ground, box, cell)
                length += 1
            written = False
            continue
        # The cell before the jump is the section's first, or its last.
        first, last = sections[cell - bound, 0], sections[cell - bound, 1]
        forward = cells[first] == out[length - 1]
        for index in range(1, last - first + 1):
            out[length] = cells[first + index] if forward else cells[last - index]
            length += 1
        written = True
    for index in range(limits[AFTER], cells.size):
        out[length] = cells[index]
        length += 1
    return int(length)
