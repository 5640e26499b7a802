"""Sweep tally: how often the line ahead sweeps each pixel of the floor to be swept.

Floor that is swept already, not asked for, or out of the tool's reach gets the offset ``NEVER`` in
the count, so sweeping it never improves a line.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Window
from fasaco_edge.kernels.floor.open_floor import (
    CAUSE,
    CAUSE_SHIFT,
    OPEN,
    PASSED,
    SWEPT,
    WANTED,
    pass_line,
    set_causes,
    set_open,
)
from fasaco_edge.kernels.floor.sweeps import BLOCK, NEVER, Scratch, Sweeps, sweep_edges
from fasaco_edge.mission.line.unswept import OUT_OF_REACH, Unswept
from fasaco_edge.planners.line import blocks_of, left_in_blocks, memory_for_moves


def _causes() -> NDArray[np.uint8]:
    """Return the ``Unswept`` value of each pixel state, uint8 (256,); AHEAD for open pixels."""
    state = np.arange(256, dtype=np.uint8)
    causes: NDArray[np.uint8] = (state & np.uint8(CAUSE)) >> np.uint8(CAUSE_SHIFT)
    causes[state & np.uint8(WANTED | SWEPT | OPEN) == WANTED] = Unswept.PASSED
    causes[state & np.uint8(OPEN) != 0] = Unswept.AHEAD
    return causes


_CAUSE_OF = _causes()
assert Unswept.BESIDE == Unswept.AHEAD - 1
NO_MASK = np.zeros((0, 0), np.bool_)


class SweepTally:
    """Sweep counts on the fine raster of a floor.

    Attributes:
        sweeps: the counts, as the kernels use them.
        unit_m: edge of a pixel [m].
    """

    def __init__(self, floor: FloorMap) -> None:
        shape = floor.geometry.rows, floor.geometry.cols
        self.unit_m = floor.geometry.resolution
        # Per pixel: flags WANTED, OPEN, SWEPT and PASSED, and why it is out of reach.
        self._state = np.zeros(shape, np.uint8)
        self.sweeps = Sweeps(np.full(shape, NEVER, np.int16), np.zeros(blocks_of(shape), np.int32))
        # Numbers of wanted pixels, of wanted pixels that are swept, and of open pixels.
        self._wanted_pixels = self._swept_pixels = self._open_pixels = 0
        # Number of pixels out of reach, by cause; the first element is unused.
        self._beyond_pixels = np.zeros(len(OUT_OF_REACH) + 1, np.int64)
        # Window of the pixels that the line has passed.
        self._passed: Window | None = None
        self._tool = floor.discs.tool_m / 2 / self.unit_m
        self._scratch: Scratch = memory_for_moves().capsules

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the raster."""
        rows, cols = self._state.shape
        return rows, cols

    def move(self, shape: tuple[int, int], by: tuple[int, int]) -> None:
        """Move to a raster of another shape, (rows, cols), and shift."""
        rows, cols = self.shape
        old, new = Window(*by, by[0] + rows, by[1] + cols), Window(0, 0, *shape)
        for part in old.without(new):
            lost = self._state[part.slices_in(old)]
            self._wanted_pixels -= int(np.count_nonzero(lost & WANTED))
            self._swept_pixels -= int(np.count_nonzero(lost & (WANTED | SWEPT) == WANTED | SWEPT))
            self._open_pixels -= int(np.count_nonzero(lost & OPEN))
            self._beyond_pixels -= _count_causes(lost)
        self._state = carried(self._state, old, new)
        self._passed = self._passed and self._passed.moved(*by).intersection(Window(0, 0, *shape))
        counts = carried(self.sweeps.counts, old, new, NEVER)
        self.sweeps = Sweeps(counts, left_in_blocks(counts))

    def exchange(self, goes: NDArray[np.float64], comes: NDArray[np.float64]) -> None:
        """Subtract edges and add others, float64 (n, 4): y, x and y, x of their ends [pixels]."""
        for edges, times in ((goes, -1), (comes, 1)):
            sweep_edges(self.sweeps, edges, self._tool, times, self._scratch)

    def set_open(
        self, part: Window, wanted: NDArray[np.bool_] | None, swept: NDArray[np.bool_]
    ) -> None:
        """Set the floor to sweep in a window of the raster.

        Args:
            part: window of the raster.
            wanted: bool (rows, cols) of ``part``, the floor asked for; None for no change.
            swept: bool (rows, cols) of ``part``, the floor that the robot has swept.
        """
        more_wanted, more_swept, more_open = set_open(
            self.sweeps,
            self._state,
            (part.row0, part.col0),
            NO_MASK if wanted is None else np.ascontiguousarray(wanted),
            swept,
        )
        self._wanted_pixels += more_wanted
        self._swept_pixels += more_swept
        self._open_pixels += more_open

    def set_causes(self, part: Window, causes: NDArray[np.uint8]) -> None:
        """Set why pixels of a window are out of reach, uint8 (rows, cols), see ``causes_of``."""
        set_causes(self._state, (part.row0, part.col0), causes, self._beyond_pixels)

    def pass_line(self, points: NDArray[np.float64]) -> None:
        """Note that the robot has passed a part of its line, float64 (n, 2), y, x [pixels].

        Poses show later whether it swept the floor there. The robot does not return for the rest
        before the end of its path, as poses after a detour seldom show more.
        """
        self._open_pixels -= pass_line(self.sweeps, self._state, points, self._tool, self._scratch)
        (row0, col0), (row1, col1) = points.min(axis=0), points.max(axis=0)
        reach = self._tool + 1.0
        part = Window(
            math.floor(row0 - reach),
            math.floor(col0 - reach),
            math.ceil(row1 + reach) + 1,
            math.ceil(col1 + reach) + 1,
        ).intersection(Window(0, 0, *self.shape))
        self._passed = Window.around(self._passed, part)

    def forget_passed(self) -> Window | None:
        """Reopen passed, unswept floor at the next ``set_open``; return its window."""
        part, self._passed = self._passed, None
        if part is not None:
            self._state[part.slices_in(Window(0, 0, *self.shape))] &= ~np.uint8(PASSED)
        return part

    def missed_m2(self, part: Window) -> float:
        """Return the open area in a window that the line ahead does not sweep [m2]."""
        counts = self.sweeps.counts[part.row0 : part.row1, part.col0 : part.col1]
        return int(np.count_nonzero(counts == 0)) * self.unit_m**2

    def missed(self) -> NDArray[np.int64]:
        """Return the open pixels that the line ahead does not sweep, int64 (n, 2): row, col."""
        found = [np.empty((0, 2), np.int64)]
        for corner in np.argwhere(self.sweeps.left) << BLOCK:
            row, col = corner.tolist()
            block = self.sweeps.counts[row : row + (1 << BLOCK), col : col + (1 << BLOCK)]
            found.append(np.argwhere(block == 0) + corner)
        return np.concatenate(found)

    def unswept(self) -> NDArray[np.uint8]:
        """Return why each pixel is not swept, uint8 (rows, cols), see ``Unswept``."""
        causes: NDArray[np.uint8] = _CAUSE_OF[self._state]
        # Only an open pixel that the line ahead does not sweep has a count of 0.
        causes -= (self.sweeps.counts == 0).view(np.uint8)
        return causes

    def sampled(self, step: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which of every ``step``-th pixels are not out of reach, and which are swept.

        Pixels that are not free do not count as out of reach.
        """
        state = self._state[step // 2 :: step, step // 2 :: step]
        return state & CAUSE == 0, state & SWEPT != 0

    def open_in_m2(self, part: Window) -> float:
        """Return the open area in a window, whether the line ahead sweeps it or not [m2]."""
        state = self._state[part.row0 : part.row1, part.col0 : part.col1]
        return int(np.count_nonzero(state & OPEN)) * self.unit_m**2

    @property
    def wanted_m2(self) -> float:
        """Area asked for [m2]."""
        return self._wanted_pixels * self.unit_m**2

    @property
    def open_m2(self) -> float:
        """Open area: asked for, neither swept nor passed, and without narrow strips [m2]."""
        return self._open_pixels * self.unit_m**2

    @property
    def passed_m2(self) -> float:
        """Area asked for but not known to be swept that was passed or is in narrow strips [m2]."""
        pixels = self._wanted_pixels - self._swept_pixels - self._open_pixels
        return pixels * self.unit_m**2

    @property
    def left_m2(self) -> float:
        """The part of the open area that the line ahead does not sweep [m2]."""
        return int(self.sweeps.left.sum()) * self.unit_m**2

    @property
    def beyond_m2(self) -> dict[str, float]:
        """Free area out of the tool's reach, by reason [m2]."""
        square_m2 = self.unit_m**2
        return {why: int(self._beyond_pixels[at]) * square_m2 for at, why in OUT_OF_REACH.items()}

    def is_open(self, point: NDArray[np.float64]) -> bool:
        """Return whether a point, y, x [pixels], is still to be swept."""
        row, col = np.rint(point).astype(int).tolist()
        return bool(self._state[row, col] & OPEN)


def _count_causes(state: NDArray[np.uint8]) -> NDArray[np.int64]:
    causes = state & np.uint8(CAUSE)
    return np.array(
        [np.count_nonzero(causes == cause << CAUSE_SHIFT) for cause in (0, *OUT_OF_REACH)]
    )
