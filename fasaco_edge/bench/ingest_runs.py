"""Take maps in as a mission does, and time what it takes to know what they change."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.bench.building import building, with_crate
from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.wire.maps import (
    decode_map_update,
    decode_occupancy_grid,
    encode_map_update,
    encode_occupancy_grid,
)

FOOTPRINT = Footprint(cell_m=0.3, robot_radius_m=0.18)
# How far a grown map grows on each side, and how far a moved one moves [pixels].
GROWTH_PX, MOVE_PX = 16, 0.37


@dataclass(frozen=True, slots=True)
class Ingest:
    """One map, taken in.

    Attributes:
        side: pixels of an edge of the map.
        case: how it came.
        decode_ms: decoding the message [ms].
        change_ms: from the decoded message to the lattice and what of it has changed [ms].
        whole_ms: the lattice of the same map from nothing [ms].
        changed: share of the pixels that changed; 1 where all lie elsewhere.
        cells: how many cells changed.
        same: whether both lattices are the same, bit for bit.
    """

    side: int
    case: str
    decode_ms: float
    change_ms: float
    whole_ms: float
    changed: float
    cells: int
    same: bool


def measure(sides: Sequence[int], repeats: int, say: Say) -> Generator[Ingest, None, None]:
    """Yield, for each size, ``repeats`` maps of each case."""
    for side in sides:
        say(f"{side} x {side}")
        whole = building(side)
        # What is met for the first time is compiled, or read from the cache.
        for case in CASES:
            _take_in(case, *_maps(case, whole, 0))
        for number in range(repeats):
            for case in CASES:
                yield _take_in(case, *_maps(case, whole, number))


CASES = ("patch", "full map", "grown map", "moved map")


def _maps(case: str, whole: OccupancyGrid, number: int) -> tuple[OccupancyGrid, OccupancyGrid]:
    """Return the map before and the map that comes, between which a crate has moved."""
    before, after = (with_crate(whole, number + i, stamp_ns=i) for i in (0, 1))
    geometry = whole.geometry
    if case == "grown map":
        inner = slice(GROWTH_PX, geometry.rows - GROWTH_PX)
        corner = Pose2D(*geometry.to_map(GROWTH_PX, GROWTH_PX))
        size = geometry.rows - 2 * GROWTH_PX
        placed = replace(geometry, rows=size, cols=size, origin=corner)
        before = replace(before, geometry=placed, cells=before.cells[inner, inner].copy())
    elif case == "moved map":
        origin = Pose2D(*geometry.to_map(MOVE_PX, 0.0))
        after = replace(after, geometry=replace(geometry, origin=origin))
    return before, after


def _take_in(case: str, before: OccupancyGrid, after: OccupancyGrid) -> Ingest:
    lattice = CoverageLattice.from_map(before, FOOTPRINT)
    is_patch = case == "patch"
    payload = encode_map_update(_patch(before, after)) if is_patch else encode_occupancy_grid(after)
    times = [time.perf_counter()]
    within = None
    if is_patch:
        patch = decode_map_update(payload)
        times.append(time.perf_counter())
        grid, within = before.patched(patch), patch.window
    else:
        grid = decode_occupancy_grid(payload)
        times.append(time.perf_counter())
    change = LatticeChange.between((before, grid), lattice, FOOTPRINT, within=within)
    assert change.window is not None
    times.append(time.perf_counter())
    whole = CoverageLattice.from_map(grid, FOOTPRINT)
    times.append(time.perf_counter())
    decode_ms, change_ms, whole_ms = (1e3 * float(step) for step in np.diff(times))
    return Ingest(
        side=after.geometry.rows,
        case=case,
        decode_ms=decode_ms,
        change_ms=change_ms,
        whole_ms=whole_ms,
        changed=_changed(before, after),
        cells=len(change.cells),
        same=np.array_equal(change.after.states, whole.states)
        and np.array_equal(change.after.steps, whole.steps),
    )


def _patch(before: OccupancyGrid, after: OccupancyGrid) -> MapPatch:
    rows, cols = np.nonzero(before.cells != after.cells)
    window = Window(int(rows.min()), int(cols.min()), int(rows.max()) + 1, int(cols.max()) + 1)
    cells = after.cells[window.slices_in(Window(0, 0, *after.cells.shape))].copy()
    return MapPatch(window, cells, after.frame, after.stamp_ns)


def _changed(before: OccupancyGrid, after: OccupancyGrid) -> float:
    if before.geometry.on_raster()[0] != after.geometry.on_raster()[0]:
        return 1.0
    if before.geometry != after.geometry:
        return 1.0 - before.cells.size / after.cells.size
    return float(np.mean(before.cells != after.cells))
