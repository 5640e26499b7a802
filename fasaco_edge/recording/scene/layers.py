"""Layers of a recording: their origin and rate limits.

A viewer draws in float32, whose resolution at a UTM northing is 0.5 m. If the first pose is far
from 0, everything is drawn relative to an anchor near it, in whole kilometres.

A token bucket limits the rate of each layer, in bytes per second. While tokens are left, a drawing
is made at once; otherwise it waits for tokens, and a newer drawing replaces it.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Bounds, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.recording import entities
from fasaco_edge.wire.messages.pheromone import PheromoneMessage

# Up to this distance from 0, float32 resolves a millimetre, and nothing is shifted [m].
NEAR_M = 10_000.0
STEP_M = 1_000.0


Grid = TypeVar("Grid", OccupancyGrid, PheromoneMessage)


@dataclass(frozen=True, slots=True)
class Anchor:
    """The point of the map frame that is drawn at 0: x [m], y [m]."""

    x: float = 0.0
    y: float = 0.0

    @classmethod
    def near(cls, x: float, y: float) -> Anchor:
        """Return the anchor for drawings around a point [m]; 0 along an axis if near 0."""
        return cls(*(0.0 if abs(at) < NEAR_M else STEP_M * round(at / STEP_M) for at in (x, y)))

    def __bool__(self) -> bool:
        return bool(self.x or self.y)

    @property
    def xy(self) -> tuple[float, float]:
        """Position (x, y) [m]."""
        return self.x, self.y

    def pose(self, pose: Pose2D) -> Pose2D:
        """Return a pose relative to the anchor."""
        return replace(pose, x=pose.x - self.x, y=pose.y - self.y)

    def grid(self, grid: Grid) -> Grid:
        """Return a grid relative to the anchor."""
        geometry = grid.geometry
        return replace(grid, geometry=replace(geometry, origin=self.pose(geometry.origin)))


def is_far_from(framed: Bounds, bounds: Bounds, share: float) -> bool:
    """Return whether ``bounds`` differ from ``framed`` by more than a share of the frame's size."""
    size = max(framed[2] - framed[0], framed[3] - framed[1])
    moved = max(abs(a - b) for a, b in zip(framed, bounds, strict=True))
    return moved > share * size


BURST_S = 60.0
# Rates in the file [bytes per second of the robot's time].
RATES = {
    entities.MAP: 3_000,
    entities.FLOOR: 1_000,
    entities.PHEROMONE: 3_500,
    entities.PATH: 2_000,
    entities.ROOMS: 500,
}
# A grid's size in the file is estimated from every n-th row.
EVERY_ROW = 8
# Largest ratio of sizes after Rerun's compression (LZ4) and after the fastest deflate.
LZ4_TO_DEFLATE = 1.5


@dataclass(slots=True)
class _Layer:
    """Tokens of a layer [bytes] at a time [ns], and the waiting drawing: size and function."""

    allowance: float
    at_ns: int = 0
    waiting: tuple[int, Callable[[], None]] | None = None


class Layers:
    """Decides when each layer is drawn; only the writer's thread calls it."""

    def __init__(self, rates: Mapping[str, float] = RATES) -> None:
        self._rates = dict(rates)
        self._layers = {name: _Layer(BURST_S * rate) for name, rate in rates.items()}

    def limit(self, rates: Mapping[str, float]) -> None:
        """Set the rates of layers, existing or new [bytes/s]."""
        self._rates |= rates
        for name, rate in rates.items():
            layer = self._layers.setdefault(name, _Layer(BURST_S * rate))
            layer.allowance = min(layer.allowance, BURST_S * rate)

    def draw(self, name: str, size: int, draw: Callable[[], None], now_ns: int) -> None:
        """Call ``draw`` now or later; it replaces a waiting drawing of the layer.

        Args:
            name: a layer that has a rate.
            size: approximate size in the file [bytes].
            draw: makes the drawing.
            now_ns: monotonic time [ns].
        """
        self._layers[name].waiting = size, draw
        self._catch_up(name, now_ns)

    def catch_up(self, now_ns: int) -> None:
        """Make the drawings that are due; call it often."""
        for name in self._layers:
            self._catch_up(name, now_ns)

    def finish(self) -> None:
        """Make all waiting drawings."""
        for layer in self._layers.values():
            if layer.waiting is not None:
                (_, draw), layer.waiting = layer.waiting, None
                draw()

    def _catch_up(self, name: str, now_ns: int) -> None:
        layer, rate = self._layers[name], self._rates[name]
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
    """Return the approximate size of a byte grid (rows, cols) in a recording [bytes]."""
    some = np.ascontiguousarray(grid[::EVERY_ROW])
    share = grid.size / max(some.size, 1)
    return round(LZ4_TO_DEFLATE * share * len(zlib.compress(some.data, 1)))
