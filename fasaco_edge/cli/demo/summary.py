"""The result of a demo, checked against the building itself, not by the daemon's figures."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.floor import JudgedFloor, SweepingRobot, judge_floor, swept_words
from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.demo.mission import Ending
from fasaco_edge.drawing.pictures import draw_mission
from fasaco_edge.drawing.plot import MapLayer
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.map.reachable_area import ReachableArea, anchor_cell


@dataclass(frozen=True, slots=True, eq=False)
class _Truth:
    """The building, what of it can be reached, and what the robot's trail did to it."""

    grid: OccupancyGrid
    lattice: CoverageLattice
    reachable: NDArray[np.bool_]
    trail: NDArray[np.float64]
    visits: NDArray[np.uint16]
    floor: JudgedFloor


@dataclass(frozen=True, slots=True)
class Summary:
    """The figures of a demo; ``reachable_m2`` and ``swept_m2`` are of floor, not of cells."""

    map: str
    complete: bool
    reachable_cells: int
    covered_cells: int
    recovered_cells: int
    unreachable_cells: int
    reachable_m2: float
    swept_m2: float
    driven_m: float
    plans: int
    paths: int
    plan_ms_p50: float | None
    plan_ms_p99: float | None
    errors: int
    wall_s: float
    recording: list[str]
    picture: str


def summarise(args: argparse.Namespace, out: Path, ending: Ending) -> Summary:
    """Return the figures of a demo, and draw and write them into ``out``."""
    truth = _truth(args, out)
    covered = truth.reachable & (truth.visits > 0)
    driven = np.hypot(*np.diff(truth.trail, axis=0).T).sum()
    reachable, done = int(truth.reachable.sum()), int(covered.sum())
    status = ending.status
    if args.line != "cells" and status.coverage is not None:
        # Along a line the robot passes beside the centres of cells: use the daemon's own count.
        reachable, done = status.coverage.coverable, status.coverage.covered
    summary = Summary(
        map=str(args.map),
        complete=done == reachable and not ending.timed_out,
        reachable_cells=reachable,
        covered_cells=done,
        recovered_cells=int((truth.reachable & (truth.visits > 1)).sum()),
        unreachable_cells=int((truth.lattice.coverable & ~truth.reachable).sum()),
        reachable_m2=round(truth.floor.figures.reachable_m2, 2),
        swept_m2=round(truth.floor.figures.swept_m2, 2),
        driven_m=round(float(driven), 1),
        plans=status.plan.plans,
        paths=status.path.revision if status.path else 0,
        plan_ms_p50=_percentile(ending.replan_ms, 50),
        plan_ms_p99=_percentile(ending.replan_ms, 99),
        errors=status.errors.total,
        wall_s=round(ending.wall_s, 1),
        recording=[str(file) for file in sorted(out.glob("*.rrd"))],
        picture=str(out / "mission.png"),
    )
    _draw(args, out, truth, summary)
    (out / "summary.json").write_text(
        json.dumps(asdict(summary), indent=1) + "\n", encoding="utf-8"
    )
    return summary


def print_summary(summary: Summary, *, as_json: bool) -> None:
    """Print a table, or JSON."""
    if as_json:
        print_json(asdict(summary))
        return
    console = terminal.out()
    ending = "every reachable cell is covered" if summary.complete else "NOT ALL WAS COVERED"
    console.print(f"{summary.map}: {ending}", style="bold")
    console.print(terminal.figures(_rows(summary)))
    for file in (*summary.recording, summary.picture):
        console.print(file, soft_wrap=True)
    if summary.recording:
        files = " ".join(summary.recording)
        console.print(f"review it:   fasaco-edge review {files}", soft_wrap=True)
        console.print(f"look at it:  rerun {files}", soft_wrap=True)


def _rows(summary: Summary) -> list[tuple[str, str]]:
    cells, covered = summary.reachable_cells, summary.covered_cells
    return [
        ("covered", f"{covered} of {cells} cells"),
        ("reachable floor swept", swept_words(summary.swept_m2, summary.reachable_m2)),
        ("covered again", f"{summary.recovered_cells} cells"),
        ("out of reach", f"{summary.unreachable_cells} cells"),
        ("driven", f"{summary.driven_m} m"),
        ("plans, paths", f"{summary.plans}, {summary.paths}"),
        ("time of a plan", f"{summary.plan_ms_p50} ms, p99 {summary.plan_ms_p99} ms"),
        ("messages refused", str(summary.errors)),
        ("time in all", f"{summary.wall_s} s"),
    ]


def _truth(args: argparse.Namespace, out: Path) -> _Truth:
    grid = read_map(find_map(args.map))
    lattice = CoverageLattice.from_map(grid, Footprint(args.cell, args.robot_radius))
    file = out / "trail.csv"
    if not file.exists():
        raise ProcessEnded("the robot never drove", hint=f"see {out / 'robot.log'}")
    trail = np.loadtxt(file, delimiter=",", skiprows=1, ndmin=2)
    ledger = CoverageLedger(args.cell)
    for x, y in trail:
        ledger.record(Pose2D(float(x), float(y)))
    start = anchor_cell(lattice, Pose2D(float(trail[0, 0]), float(trail[0, 1])))
    nowhere = np.zeros(lattice.states.shape, bool)
    reachable = nowhere if start is None else ReachableArea.around(lattice, start).reachable
    floor = judge_floor(grid, trail, SweepingRobot(args.cell, args.robot_radius))
    return _Truth(grid, lattice, reachable, trail, ledger.visits(lattice.window), floor)


def _draw(args: argparse.Namespace, out: Path, truth: _Truth, summary: Summary) -> None:
    lines = [
        f"{summary.covered_cells} of {summary.reachable_cells} reachable cells covered, "
        f"{summary.driven_m} m driven, {summary.paths} paths",
        f"reachable floor swept: {swept_words(summary.swept_m2, summary.reachable_m2)}",
    ]
    title = f"{Path(args.map).stem}: mapped and covered"
    picture = draw_mission(
        truth.grid,
        truth.lattice,
        truth.trail,
        truth.visits,
        title=title,
        lines=lines,
        swept=None if args.line == "cells" else MapLayer(truth.floor.geometry, truth.floor.swept),
        unswept=MapLayer(truth.floor.geometry, truth.floor.unswept),
    )
    picture.save(out / "mission.png")


def _percentile(values: tuple[float, ...], percent: float) -> float | None:
    return round(float(np.percentile(values, percent)), 1) if values else None
