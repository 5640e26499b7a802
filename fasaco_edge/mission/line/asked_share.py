"""Share of the floor that is asked for: what is missing of it, and the cells to return to for it.

While the map still grows, floor has its usual price, as later lanes may sweep what is left. On a
map that is complete a higher price makes the line sweep more in passing. Once nothing else is left
of a pass, the robot returns for what is missing. Strips as narrow as a pixel count as swept, as the
swept floor is not known more precisely (``kernels.floor.open_floor``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.line.tally import SweepTally
from fasaco_edge.text import duration, percent

# Factor on the price of floor on a complete map; it grows by this factor with each further return,
# up to MOST_RAISED.
RAISED, MOST_RAISED = 4.0, 64.0
# The robot returns to cells with this multiple of the missing floor, as it does not sweep all of
# that; and to none with less than LEAST_M2 [m2].
MARGIN, LEAST_M2 = 1.5, 0.004
# A return that gains less than this share of the missing floor is the last one.
LEAST_GAIN = 0.1
# A cell and those around it, (row, col).
AROUND = tuple((row, col) for row in (0, -1, 1) for col in (0, -1, 1))


class AskedShare:
    """The share asked for, and the returns to sweep it, of one pass of an order at a time.

    Attributes:
        share: the share; None to sweep what is worth its time.
        why: why the robot returns, as long as no path leads there; else "".
    """

    def __init__(self, share: float | None) -> None:
        self.share, self.why = share, ""
        # The present pass, factor on the price, and least swept floor for another return [m2]; 0
        # before the first.
        self._part: object = None
        self._raised, self._least_m2 = RAISED, 0.0

    def begin(self, part: object) -> None:
        """Note the present pass of an order, as a value that is equal only for the same one."""
        if part != self._part:
            self._part, self.why = part, ""
            self._raised, self._least_m2 = RAISED, 0.0

    def factor(self, tally: SweepTally) -> float:
        """Return the factor on the price of floor on a complete map.

        It is 1 while the share is swept of the floor that the robot has passed, strips included.
        """
        if self.share is None:
            return 1.0
        passed_m2 = tally.wanted_m2 - tally.open_m2
        has_missed = tally.passed_m2 > (1.0 - self.share) * passed_m2
        return self._raised if has_missed or self._least_m2 else 1.0

    def returns_to(
        self, tally: SweepTally, cells: NDArray[np.int32], pixels: NDArray[np.int64]
    ) -> list[tuple[int, int]]:
        """Begin a return; return the cells for it, the fewest that suffice; none to end instead.

        Args:
            tally: of the line.
            cells: int32 (n, 2), the cells to choose from.
            pixels: int64 (n,), number of missed pixels that each of them leads to.
        """
        assert self.share is not None
        self.why = ""
        missing_m2 = tally.left_m2 - (1.0 - self.share) * tally.wanted_m2
        swept_m2 = tally.wanted_m2 - tally.left_m2
        if missing_m2 <= 0.0 or swept_m2 < self._least_m2:
            return []
        most_first = np.argsort(-pixels, kind="stable")
        m2 = pixels[most_first] * tally.unit_m**2
        enough = int(np.searchsorted(np.cumsum(m2), MARGIN * missing_m2)) + 1
        chosen = cells[most_first[: min(enough, int(np.count_nonzero(m2 >= LEAST_M2)))]]
        if not len(chosen):
            return []
        if self._least_m2:
            self._raised = min(self._raised * RAISED, MOST_RAISED)
        self._least_m2 = swept_m2 + LEAST_GAIN * missing_m2
        swept = percent(swept_m2 / tally.wanted_m2)
        self.why = f"returns for {tally.left_m2:.2f} of {tally.wanted_m2:.1f} m2: {swept} swept"
        return [(row, col) for row, col in chosen.tolist()]

    def priced(self, seconds: float) -> str:
        """Return why the robot returns, with the duration of the path [s], which leads there."""
        why, self.why = f"{self.why}, takes {duration(seconds)}", ""
        return why

    def sum_up(self, tally: SweepTally) -> str:
        """Return how much of the share is swept, as the end of a sentence; "" if none is asked."""
        if self.share is None or not tally.wanted_m2:
            return ""
        swept = percent(1.0 - tally.open_m2 / tally.wanted_m2, 2)
        return f"; {percent(self.share, 2)} asked for: {swept} but for strips a pixel wide"


def nearest_stands(
    missed: NDArray[np.float64], at: NDArray[np.int32], floor: FloorMap, covered: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Return the covered cell whose stand is nearest to each missed pixel, int32 (m, 2), m <= n.

    Pixels without a covered cell around are left out. Most missed floor lies along walls, beside
    the cells that the robot fits in.

    Args:
        missed: float64 (n, 2): y, x of the pixels.
        at: int32 (n, 2), the cells that they lie in.
        floor: the floor.
        covered: bool (rows, cols) of the floor's lattice.
    """
    window: Window = floor.stands.lattice.window
    least, nearest = np.full(len(at), np.inf), at.copy()
    for offset in AROUND:
        cells = at + np.array(offset, np.int32)
        distance = np.hypot(*(floor.stands.stands_of(cells) - missed).T)
        distance[~window.values_at(covered, cells, 0).astype(np.bool_)] = np.inf
        is_nearer = distance < least
        least[is_nearer], nearest[is_nearer] = distance[is_nearer], cells[is_nearer]
    found: NDArray[np.int32] = nearest[np.isfinite(least)]
    return found
