"""Masks of pixels: dilation by a distance, and connected patches.

The results are exact; only numpy is used. Distances are between the centres of pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]

# Number of pixels evaluated at a time: distances along rows take eight bytes each.
BLOCK_PIXELS = 1_000_000
FAR = 2**30


def within(mask: Mask, distance: float) -> Mask:
    """Return which pixels are within ``distance`` [pixels] of a marked one, bool (rows, cols).

    A pixel is near a marked one ``d`` rows away if their distance along the row is at most half of
    the width that a disc has at the height ``d``.

    Args:
        mask: bool (rows, cols).
        distance: from centre to centre; below 0, no pixel is near.
    """
    near = np.zeros_like(mask)
    if distance < 0 or not mask.any():
        return near
    (rows, cols), reach = mask.shape, int(distance)
    some = max(BLOCK_PIXELS // cols, 2 * reach, 1)
    for start in range(0, rows, some):
        first, stop = max(start - reach, 0), min(start + some + reach, rows)
        along = _along_rows(mask[first:stop])
        for step in range(-reach, reach + 1):
            here, end = max(start, first - step), min(start + some, rows, stop - step)
            if here >= end:
                continue
            half = int(math.sqrt(distance * distance - step * step))
            near[here:end] |= along[here + step - first : end + step - first] <= half
    return near


def through(free: Mask, mask: Mask, steps: int) -> Mask:
    """Return the free pixels that are reached from marked ones by steps through free pixels.

    Args:
        free, mask: free and marked pixels, bool (rows, cols).
        steps: largest number of steps over edges.
    """
    found = mask & free
    for _ in range(steps):
        more = found.copy()
        more[1:] |= found[:-1]
        more[:-1] |= found[1:]
        more[:, 1:] |= found[:, :-1]
        more[:, :-1] |= found[:, 1:]
        more &= free
        found = more
    return found


def _along_rows(mask: Mask) -> NDArray[np.int32]:
    """Return the distance of the nearest marked pixel in the same row; ``FAR`` or more if none."""
    index = np.arange(mask.shape[1], dtype=np.int32)
    left = np.maximum.accumulate(np.where(mask, index, np.int32(-FAR)), axis=1)
    right = np.minimum.accumulate(np.where(mask, index, np.int32(FAR))[:, ::-1], axis=1)[:, ::-1]
    nearest: NDArray[np.int32] = np.minimum(index - left, right - index)
    return nearest


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """The patches of a mask: pixels connected by their edges.

    Attributes:
        shape: shape of the mask.
        starts, ends: first pixel and exclusive end of each run of pixels in a row, int64 (n,);
            flat indices into rows one pixel longer than the mask's.
        of_run: index of the patch of each run, int64 (n,), 0 .. count - 1.
        count: number of patches.
    """

    shape: tuple[int, int]
    starts: NDArray[np.int64]
    ends: NDArray[np.int64]
    of_run: NDArray[np.int64]
    count: int

    @classmethod
    def of(cls, mask: Mask) -> Patches:
        """Return the patches of ``mask``, bool (rows, cols)."""
        rows, cols = mask.shape
        # An unmarked pixel at the end of each row separates it from the next.
        flat = np.zeros(rows * (cols + 1) + 1, np.int8)
        flat[1:].reshape(rows, cols + 1)[:, :cols] = mask
        change = np.diff(flat)
        starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
        one, other = _touching(starts, ends, cols + 1)
        roots, of_run = np.unique(_joined(len(starts), one, other), return_inverse=True)
        return cls((rows, cols), starts, ends, of_run, len(roots))

    @property
    def pixels(self) -> NDArray[np.int64]:
        """Number of pixels of each patch, int64 (count,)."""
        counts: NDArray[np.int64] = np.zeros(self.count, np.int64)
        np.add.at(counts, self.of_run, self.ends - self.starts)
        return counts

    def nearest_to(self, col: float, row: float) -> Mask:
        """Return the patch nearest to a point [pixels], bool (rows, cols), or an empty mask."""
        rows, cols = self.shape
        change = np.zeros(rows * (cols + 1), np.int8)
        if self.count:
            of_row, first = np.divmod(self.starts, cols + 1)
            last = first + (self.ends - self.starts) - 1
            across = np.clip(col - 0.5, first, last) - (col - 0.5)
            run = int(np.argmin(across**2 + (of_row + 0.5 - row) ** 2))
            chosen = self.of_run == self.of_run[run]
            change[self.starts[chosen]] = 1
            change[self.ends[chosen]] = -1
        inside = np.cumsum(change, dtype=np.int8, out=change).view(np.bool_)
        return inside.reshape(rows, cols + 1)[:, :cols]


def _touching(
    starts: NDArray[np.int64], ends: NDArray[np.int64], row: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pairs of runs that touch, in successive rows of ``row`` pixels."""
    first = np.searchsorted(ends, starts + row, side="right")
    stop = np.searchsorted(starts, ends + row, side="left")
    counts = np.maximum(stop - first, 0)
    one = np.repeat(np.arange(len(starts)), counts)
    begin = np.repeat(np.cumsum(counts) - counts, counts)
    other = np.repeat(first, counts) + np.arange(len(one)) - begin
    return one, other


def _joined(count: int, one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return for each of ``count`` nodes the smallest node that pairs connect it with."""
    root = np.arange(count)
    while True:
        a, b = root[one], root[other]
        apart = a != b
        if not apart.any():
            return root
        np.minimum.at(root, np.maximum(a[apart], b[apart]), np.minimum(a[apart], b[apart]))
        while (root[root] != root).any():
            root = root[root]
