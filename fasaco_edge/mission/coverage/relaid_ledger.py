"""Relaid ledger: conversion of a ledger to cells at another angle, or of another size.

Coverage is rebuilt from swept floor: a cell counts as covered if the floor at its centre is swept.
The trail, stored per step between cells, starts again; other robots resend their cells.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.grid.rotation import rotated_geometry
from fasaco_edge.mission.coverage.floor_tiles import (
    FLOOR_TILE,
    PIXEL_M,
    FloorSnapshot,
    Mask,
    Similarity,
    TileKey,
    swept_on,
    window_of,
)
from fasaco_edge.mission.coverage.ledger import TILE, LedgerSnapshot
from fasaco_edge.planners.living_trail import NO_TRAIL


def relaid_ledger(before: LedgerSnapshot, lattice_deg: float, cell_m: float) -> LedgerSnapshot:
    """Return a ledger converted to cells of ``cell_m`` [m], rotated by ``lattice_deg`` [deg]."""
    by_deg, floor = before.lattice_deg - lattice_deg, before.floor
    if not by_deg and before.cell_m == cell_m:
        return before
    tiles = floor.tiles
    if by_deg:
        rotated = _rotated(floor, by_deg, FLOOR_TILE, PIXEL_M)
        tiles = MappingProxyType({place: np.packbits(swept, axis=1) for place, swept in rotated})
    visits = {
        place: swept.astype(np.uint16) for place, swept in _rotated(floor, by_deg, TILE, cell_m)
    }
    return replace(
        before,
        cell_m=cell_m,
        total=sum(int(np.count_nonzero(tile)) for tile in visits.values()),
        tiles=MappingProxyType(visits),
        under_tool=frozenset(),
        floor=FloorSnapshot(tiles, floor.changes),
        trail=NO_TRAIL,
        fleet=b"",
        lattice_deg=lattice_deg,
    )


def _rotated(
    floor: FloorSnapshot, by_deg: float, side: int, edge_m: float
) -> Iterator[tuple[TileKey, Mask]]:
    """Yield tiles of the rotated raster with their swept squares; empty tiles are skipped.

    Args:
        floor: the present floor.
        by_deg: rotation of the result against the floor [deg].
        side: edge of a tile, in squares.
        edge_m: edge of a square [m].
    """
    tile_m = FLOOR_TILE * PIXEL_M
    places: set[TileKey] = set()
    for row, col in floor.tiles:
        here = GridGeometry.of_cells(Window(row, col, row + 1, col + 1), tile_m)
        x0, y0, x1, y1 = rotated_geometry(here, by_deg).bounds()
        rows, cols = (
            range(int(low // (side * edge_m)), int(high // (side * edge_m)) + 1)
            for low, high in ((y0, y1), (x0, x1))
        )
        places |= {(i, j) for i in rows for j in cols}
    for place in sorted(places):
        cells = GridGeometry.of_cells(window_of(place, side), edge_m)
        squares = rotated_geometry(cells, -by_deg)
        swept = swept_on(floor.swept_in, Similarity.of(squares), Window(0, 0, side, side))
        if swept.any():
            yield place, swept
