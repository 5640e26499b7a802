"""Take maps in as a mission does, and time what it takes to know what they change.

``benchmarks ingest``: from a map, or a map update, to what it changes of the lattice.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fasaco_edge.bench.benchmark import Benchmark, Goal, Report, Say, peak_mb, positive
from fasaco_edge.bench.robot import building, with_crate
from fasaco_edge.drawing.spread import percentile
from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.wire.messages.maps import (
    decode_map_update,
    decode_occupancy_grid,
    encode_map_update,
    encode_occupancy_grid,
)
from tests.benchmarks.harness import within

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


DEFAULT_SIDES = (1024, 4000)
LEAST_SIDE, MOST_SIDE = 400, 8000
# Of maps of which hardly anything has changed.
GOAL_SIDE, GOAL_SHARE, GOAL_MS = 1024, 0.01, 10.0
HEADER = ("side", "came as", "changed", "cells", "decode", "change", "p99", "anew", "ratio", "same")


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--sides",
        nargs="+",
        type=within(LEAST_SIDE, MOST_SIDE),
        default=list(DEFAULT_SIDES),
        metavar="PIXELS",
        help=f"edge of the map (default: {' '.join(map(str, DEFAULT_SIDES))})",
    )
    parser.add_argument(
        "--repeats", type=positive, default=40, help="maps of each kind (default: %(default)s)"
    )


def _sides(args: argparse.Namespace) -> list[int]:
    return list(dict.fromkeys(args.sides))


def _measure(args: argparse.Namespace, say: Say) -> Generator[Ingest, None, None]:
    return measure(_sides(args), args.repeats, say)


def _report(args: argparse.Namespace, samples: Sequence[Ingest]) -> Report:
    kinds = dict.fromkeys((sample.side, sample.case) for sample in samples)
    figures = [
        _figures([sample for sample in samples if (sample.side, sample.case) == kind])
        for kind in kinds
    ]
    return Report(
        title="from a decoded message to what it changes [ms]",
        header=HEADER,
        rows=tuple(_row(kind) for kind in figures),
        figures={"maps": figures},
        goals=tuple(_goals(figures)),
        remarks=(
            "side: of the map [pixels]; changed: share of them, and how many cells; change: median "
            "and 99th percentile; anew: the lattice of the whole map from nothing; same: whether "
            "both are, bit for bit",
            f"peak memory of this process {peak_mb()} MB",
        ),
    )


def _figures(samples: Sequence[Ingest]) -> dict[str, Any]:
    first = samples[0]
    return {
        "side": first.side,
        "case": first.case,
        "samples": len(samples),
        "changed": round(max(sample.changed for sample in samples), 6),
        "cells": max(sample.cells for sample in samples),
        "decode_ms": _ms([sample.decode_ms for sample in samples], 50.0),
        "change_ms": _ms([sample.change_ms for sample in samples], 50.0),
        "change_p99_ms": _ms([sample.change_ms for sample in samples], 99.0),
        "whole_ms": _ms([sample.whole_ms for sample in samples], 50.0),
        "same": all(sample.same for sample in samples),
    }


def _row(kind: dict[str, Any]) -> tuple[str, ...]:
    return (
        str(kind["side"]),
        kind["case"],
        f"{100.0 * kind['changed']:.3g} %",
        str(kind["cells"]),
        *(f"{kind[name]:.2f}" for name in ("decode_ms", "change_ms", "change_p99_ms", "whole_ms")),
        f"{kind['whole_ms'] / kind['change_ms']:.1f}",
        "yes" if kind["same"] else "NO",
    )


def _goals(figures: Sequence[dict[str, Any]]) -> Iterator[Goal]:
    for kind in figures:
        if kind["side"] == GOAL_SIDE and kind["changed"] < GOAL_SHARE:
            what = f"p99 of a {kind['case']}, {GOAL_SIDE} x {GOAL_SIDE}"
            yield Goal(what, kind["change_p99_ms"], GOAL_MS, "ms")


def _ms(values: Sequence[float], percent: float) -> float:
    value = percentile(values, percent)
    assert value is not None
    return round(value, 3)


INGEST = Benchmark(
    name="ingest",
    summary="from a map, or a map update, to the change window",
    description="Take in maps of a building in which a crate moves: as an update of a part, as a "
    "full map, as one that has grown on all sides by whole pixels, and as one that has moved by "
    "part of a pixel, as after a loop closure. Time what it takes from the decoded message to the "
    "new lattice and the cells that changed, and beside it the lattice of the whole map, made "
    "from nothing. Pixels of 5 cm, cells of 30 cm.",
    add_options=_add_options,
    count=lambda args: len(_sides(args)) * int(args.repeats) * len(CASES),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks ingest
  python -m tests.benchmarks ingest --sides 1024 --repeats 200 --json
""",
)
