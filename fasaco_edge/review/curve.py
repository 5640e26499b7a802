"""A curve of characters, for a terminal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

EIGHTHS, PLAIN_EIGHTHS = " ▁▂▃▄▅▆▇█", " ..::++##"


def curve(
    at_s: NDArray[np.float64],
    shares: NDArray[np.float64],
    end_s: float,
    width: int,
    height: int,
    marks: str = EIGHTHS,
) -> list[str]:
    """Return the lines of a picture of a share that changes at some times, the top one first.

    Args:
        at_s: float64 (n,), when it changed [s], ascending.
        shares: float64 (n,), what it was from then on, 0 to 1; before the first time it is 0.
        end_s: the right end of the picture [s]; the left one is 0.
        width, height: of the picture [characters].
        marks: nine characters, from an empty one to a full one.
    """
    places = (np.arange(width) + 1) / width * end_s
    index = np.searchsorted(at_s, places, side="right")
    levels = np.concatenate(([0.0], shares))[index]
    eighths = np.rint(np.clip(levels, 0, 1) * height * 8).astype(int)
    # What is not nothing is to be seen, and what is not all, too.
    eighths[(levels > 0) & (eighths == 0)] = 1
    eighths[(levels < 1) & (eighths == 8 * height)] -= 1
    return [
        "".join(marks[min(max(eighth - 8 * row, 0), 8)] for eighth in eighths.tolist())
        for row in reversed(range(height))
    ]
