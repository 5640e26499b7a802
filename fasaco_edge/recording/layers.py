"""Large things are drawn no faster than a recording may grow: a map of a million pixels, a
path of ten thousand cells.

Each layer has an allowance. As long as there is some left, what comes is drawn at once;
else the newest waits until the allowance has grown again. What came in between is not drawn.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.recording import entities

BURST_S = 60.0
# In the file [bytes/s].
RATES = {
    entities.MAP: 3_000,
    entities.COVERAGE: 1_000,
    entities.PHEROMONE: 1_500,
    entities.PATH: 2_000,
}
# A grid's size in the file is judged by every so many-th row.
EVERY_ROW = 8
# Rerun's compression (LZ4) against the fastest deflate, at worst.
LOOSER = 1.5


@dataclass(slots=True)
class _Layer:
    """How much may be drawn [bytes], as of when [ns], and what waits: its size, how to draw it."""

    allowance: float
    at_ns: int = 0
    waiting: tuple[int, Callable[[], None]] | None = None


class Layers:
    """Decides when each layer is drawn; the journal's thread and clock."""

    def __init__(self) -> None:
        self._layers = {name: _Layer(BURST_S * rate) for name, rate in RATES.items()}

    def draw(self, name: str, size: int, draw: Callable[[], None], now_ns: int) -> None:
        """Call ``draw`` now, or later instead of what came before.

        Args:
            name: one of ``RATES``.
            size: about how much it takes in the file [bytes].
            draw: does it, at any later time.
            now_ns: a clock that never steps [ns].
        """
        self._layers[name].waiting = size, draw
        self._catch_up(name, now_ns)

    def catch_up(self, now_ns: int) -> None:
        """Draw what has waited long enough; call it often."""
        for name in self._layers:
            self._catch_up(name, now_ns)

    def finish(self) -> None:
        """Draw all that waits."""
        for layer in self._layers.values():
            if layer.waiting is not None:
                (_, draw), layer.waiting = layer.waiting, None
                draw()

    def _catch_up(self, name: str, now_ns: int) -> None:
        layer, rate = self._layers[name], RATES[name]
        if layer.waiting is None:
            return
        gained = rate * (now_ns - layer.at_ns) / 1e9
        layer.allowance = min(layer.allowance + gained, BURST_S * rate)
        layer.at_ns = now_ns
        if layer.allowance <= 0:
            return
        (size, draw), layer.waiting = layer.waiting, None
        layer.allowance -= size
        draw()


def size_in_file(grid: NDArray[np.generic]) -> int:
    """Return about how much a grid (rows, cols) of bytes takes in a recording [bytes]."""
    some = np.ascontiguousarray(grid[::EVERY_ROW])
    share = grid.size / max(some.size, 1)
    return round(LOOSER * share * len(zlib.compress(some.data, 1)))
