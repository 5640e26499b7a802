"""Frames of a fleet: conversion of another robot's message to this robot's frame and lattice.

If each robot has its own map, its configuration gives the pose of that map in a shared frame. The
lattices of two robots are then at an angle: a cell takes the value of the other robot's cell that
contains its centre.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fasaco_edge.fleet.mission.shared import MOST_TILES_OF_ONE
from fasaco_edge.fleet.mission.tiles import EMPTY, Placed, bits_of, packed, unpacked
from fasaco_edge.grid.geometry import MOST_INDEX, Point, Pose2D
from fasaco_edge.mission.coverage.ledger import TILE
from fasaco_edge.mission.events import MemberReceived

# Number of robots tracked at once. It exceeds the limit on members: a refused robot may become a
# member later, and would have to send all its tiles again.
MOST_OTHERS = 64

# Smaller overlaps of tiles [cells] and smaller angles [rad] are rounding errors.
TOUCH, STRAIGHT = 1e-6, 1e-9


def seen_from(frame: Pose2D, other: Pose2D) -> Pose2D:
    """Return the pose of ``frame`` in ``other``; both poses are given in a third frame."""
    x, y = frame.x - other.x, frame.y - other.y
    cos, sin = math.cos(other.yaw), math.sin(other.yaw)
    yaw = math.remainder(frame.yaw - other.yaw, math.tau)
    yaw = 0.0 if abs(yaw) < STRAIGHT else yaw
    return Pose2D(cos * x + sin * y, cos * y - sin * x, yaw)


def placed_point(frame: Pose2D, x: float, y: float) -> Point:
    """Return a point of ``frame`` in its parent frame, in which the pose of ``frame`` is given."""
    cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
    return frame.x + cos * x - sin * y, frame.y + sin * x + cos * y


class ResampledTiles:
    """Another robot's cells, resampled on this robot's lattice.

    Args:
        lattice: pose of the other lattice in this robot's lattice [m].
        cell_m: edge of a cell of both [m].
    """

    def __init__(self, lattice: Pose2D, cell_m: float) -> None:
        self.lattice = lattice
        self._shift = lattice.x / cell_m, lattice.y / cell_m
        self._cos, self._sin = math.cos(lattice.yaw), math.sin(lattice.yaw)
        self._given: dict[tuple[int, int], bytes] = {}
        # Cached tiles of this lattice, until one of their source tiles changes.
        self._made: dict[tuple[int, int], bytes] = {}
        # Places of the tiles that are not empty, or were not empty earlier.
        self._shown: set[tuple[int, int]] = set()

    def tiles(self, tiles: Iterable[Placed]) -> tuple[Placed, ...]:
        """Return all tiles of this robot's lattice that overlap the other robot's new tiles."""
        wanted: set[tuple[int, int]] = set()
        for place, bits in tiles:
            if place not in self._given and len(self._given) >= MOST_TILES_OF_ONE:
                continue
            overlapped = self._overlapped(place)
            if self._given.get(place) != bits:
                self._given[place] = bits
                for made in overlapped:
                    self._made.pop(made, None)
            wanted.update(overlapped)
        for place in wanted - self._made.keys():
            self._made[place] = self._make(place)
            if self._made[place] != EMPTY:
                self._shown.add(place)
        # Tiles that have always been empty are left out.
        return tuple((place, self._made[place]) for place in sorted(wanted & self._shown))

    def cell(self, row: int, col: int) -> tuple[int, int]:
        """Return this robot's cell that contains the centre of the other robot's (row, col)."""
        x, y = self._here(col + 0.5, row + 0.5)
        return math.floor(y), math.floor(x)

    def _here(self, x: float, y: float) -> Point:
        """Return a point of the other lattice in this robot's lattice [cells]."""
        cos, sin = self._cos, self._sin
        return self._shift[0] + cos * x - sin * y, self._shift[1] + sin * x + cos * y

    def _overlapped(self, place: tuple[int, int]) -> list[tuple[int, int]]:
        """Return the places of this lattice's tiles that overlap a tile of the other lattice."""
        row, col = place
        corners = [self._here(x * TILE, y * TILE) for y in (row, row + 1) for x in (col, col + 1)]
        cols, rows = (
            range(math.floor((min(values) + TOUCH) / TILE), math.ceil((max(values) - TOUCH) / TILE))
            for values in zip(*corners, strict=True)
        )
        return [(row, col) for row in rows for col in cols]

    def _make(self, place: tuple[int, int]) -> bytes:
        y, x = np.mgrid[:TILE, :TILE] + 0.5
        x += place[1] * TILE - self._shift[0]
        y += place[0] * TILE - self._shift[1]
        cols = np.floor(self._cos * x + self._sin * y).astype(np.int64)
        rows = np.floor(self._cos * y - self._sin * x).astype(np.int64)
        found = np.zeros((TILE, TILE), np.bool_)
        tile_rows, tile_cols = rows // TILE, cols // TILE
        for row in range(int(tile_rows.min()), int(tile_rows.max()) + 1):
            for col in range(int(tile_cols.min()), int(tile_cols.max()) + 1):
                if (bits := self._given.get((row, col))) is not None:
                    cells = unpacked(bits_of(bits))
                    inside = (tile_rows == row) & (tile_cols == col)
                    found[inside] = cells[rows[inside] % TILE, cols[inside] % TILE]
        return packed(found)


class FleetFrames:
    """Messages of robots with maps of their own, converted to this robot's frames.

    Args:
        map_frame: pose of this robot's map frame in the frame of the fleet.
        lattice_deg: the angle of its cells' rows to the x axis of the map frame [deg].
        cell_m: edge of a cell [m].
    """

    def __init__(self, map_frame: Pose2D, lattice_deg: float, cell_m: float) -> None:
        self._map_frame, self._cell_m = map_frame, cell_m
        self._lattice = turned(map_frame, lattice_deg)
        # For each robot its epoch, its swept cells and its reachable cells; the robot with the
        # oldest message is first.
        self._robots: dict[str, tuple[int, ResampledTiles, ResampledTiles]] = {}

    def event(
        self, message: MemberReceived, map_frame: Pose2D, lattice_deg: float
    ) -> MemberReceived:
        """Return another robot's message in this robot's frames.

        Its division is dropped if the index of a seed exceeds the limit of messages.

        Args:
            message: the message in the robot's own frames.
            map_frame, lattice_deg: of the other robot, as in ``FleetFrames``.
        """
        frame = seen_from(map_frame, self._map_frame)
        lattice = seen_from(turned(map_frame, lattice_deg), self._lattice)
        epoch, swept, ground = self._of(message.robot, message.epoch, lattice)
        self._robots.pop(message.robot, None)
        self._robots[message.robot] = epoch, swept, ground
        x, y = placed_point(frame, message.x, message.y)
        parts = tuple(replace(part, seed=swept.cell(*part.seed)) for part in message.parts)
        if any(abs(index) > MOST_INDEX for part in parts for index in part.seed):
            message, parts = replace(message, division=0, by=""), ()
        return replace(
            message,
            frame="",
            x=x,
            y=y,
            ahead=tuple(placed_point(frame, *point) for point in message.ahead),
            tiles=swept.tiles(message.tiles),
            # Unknown: a tile here overlaps several tiles of the other robot; some may be missing.
            kept=None,
            ground=ground.tiles(message.ground),
            parts=parts,
            lattice=lattice,
        )

    def _of(
        self, robot: str, epoch: int, lattice: Pose2D
    ) -> tuple[int, ResampledTiles, ResampledTiles]:
        """Return a robot's entry; an empty entry if its frame has moved."""
        known = self._robots.get(robot)
        if known is None and len(self._robots) >= MOST_OTHERS:
            del self._robots[next(iter(self._robots))]
        empty = ResampledTiles(lattice, self._cell_m)
        if known is None or known[1].lattice != lattice:
            return epoch, empty, ResampledTiles(lattice, self._cell_m)
        # A new epoch replaces all earlier progress.
        return known if known[0] == epoch else (epoch, empty, known[2])


def turned(frame: Pose2D, by_deg: float) -> Pose2D:
    """Return a frame turned about its origin by an angle [deg]."""
    return replace(frame, yaw=frame.yaw + math.radians(by_deg))
