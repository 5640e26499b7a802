"""The result of a demo, checked against the building itself, not by the daemon's figures."""

from __future__ import annotations

import argparse
import json
import os
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.demo.mission import Ending
from fasaco_edge.cli.demo.robots import DemoRobot
from fasaco_edge.client.phrases import age
from fasaco_edge.drawing.pictures import draw_mission
from fasaco_edge.drawing.plot import MapLayer
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.floor import (
    JudgedFloor,
    SweepingRobot,
    judge_floor,
    share_words,
    swept_words,
)
from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.map.reachable_area import ReachableArea, anchor_cell


@dataclass(frozen=True, slots=True, eq=False)
class _Truth:
    """The building, its reachable floor, and the floor swept along the robots' trails.

    ``floor`` is judged for all trails together, ``floors`` for each.
    """

    grid: OccupancyGrid
    lattice: CoverageLattice
    reachable: NDArray[np.bool_]
    trails: list[NDArray[np.float64]]
    visits: NDArray[np.uint16]
    floor: JudgedFloor
    floors: list[JudgedFloor]

    @property
    def swept_twice_m2(self) -> float:
        """Floor that more than one robot swept [m2]."""
        times = sum(floor.swept.astype(np.int8) for floor in self.floors)
        return float(np.count_nonzero(times > 1) * self.floor.geometry.resolution**2)


@dataclass(frozen=True, slots=True)
class RobotFigures:
    """What one robot of a demo did; ``drive_s`` is driving and turning, in simulated seconds."""

    name: str
    driven_m: float
    drive_s: float
    swept_m2: float


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
    swept_twice_m2: float
    driven_m: float
    robots: tuple[RobotFigures, ...]
    plans: int
    paths: int
    plan_ms_p50: float | None
    plan_ms_p99: float | None
    errors: int
    wall_s: float
    makespan_s: float
    killed: str
    recording: list[str]
    fleet_recording: list[str]
    picture: str


def summarise(
    args: argparse.Namespace, out: Path, robots: Sequence[DemoRobot], ending: Ending
) -> Summary:
    """Return the figures of a demo, and draw and write them into ``out``."""
    truth = _truth(args, robots)
    covered = truth.reachable & (truth.visits > 0)
    reachable, done = int(truth.reachable.sum()), int(covered.sum())
    reports = [
        status.coverage
        for robot, status in zip(robots, ending.statuses, strict=True)
        if status.coverage is not None and robot.name != ending.killed
    ]
    if args.line != "cells" and reports:
        # A robot on a line passes beside the centres of cells: use the daemon's own count; of
        # several daemons, that of the one with the most cells left.
        report = max(reports, key=lambda report: report.coverable - report.covered)
        reachable, done = report.coverable, report.covered
    figures = tuple(
        RobotFigures(
            robot.name,
            round(floor.figures.length_m, 1),
            round(floor.figures.seconds, 1),
            round(floor.figures.swept_m2, 2),
        )
        for robot, floor in zip(robots, truth.floors, strict=True)
    )
    summary = Summary(
        map=str(args.map),
        complete=done == reachable and not ending.timed_out,
        reachable_cells=reachable,
        covered_cells=done,
        recovered_cells=int((truth.reachable & (truth.visits > 1)).sum()),
        unreachable_cells=int((truth.lattice.coverable & ~truth.reachable).sum()),
        reachable_m2=round(truth.floor.figures.reachable_m2, 2),
        swept_m2=round(truth.floor.figures.swept_m2, 2),
        swept_twice_m2=round(truth.swept_twice_m2, 2),
        driven_m=round(sum(floor.figures.length_m for floor in truth.floors), 1),
        robots=figures,
        plans=sum(status.plan.plans for status in ending.statuses),
        paths=sum(status.path.revision for status in ending.statuses if status.path),
        plan_ms_p50=_percentile(ending.replan_ms, 50),
        plan_ms_p99=_percentile(ending.replan_ms, 99),
        errors=sum(status.errors.total for status in ending.statuses),
        wall_s=round(ending.wall_s, 1),
        makespan_s=round(ending.makespan_s, 1),
        killed=ending.killed,
        recording=[str(file) for robot in robots for file in sorted(robot.folder.glob("*.rrd"))],
        fleet_recording=[str(file) for file in sorted(out.glob("*-fleet-*.rrd"))],
        picture=str(out / "mission.png"),
    )
    _draw(args, truth, summary)
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
    missing = summary.reachable_cells - summary.covered_cells
    ending = "the time is up" if not missing else f"{missing} cell{'s' * (missing != 1)} left over"
    ending = "every reachable cell is covered" if summary.complete else ending
    console.print(f"{Path(summary.map).stem}: {ending}", style="bold")
    console.print(terminal.figures(_rows(summary)))
    for file in (*summary.recording, *summary.fleet_recording, summary.picture):
        console.print(file, soft_wrap=True)
    for what, command in _openers(summary):
        console.print(f"{what:12} {command}", soft_wrap=True)


def _openers(summary: Summary) -> Iterator[tuple[str, str]]:
    """Yield the commands that open the recording, and what each does."""
    recordings = summary.fleet_recording or summary.recording
    if not recordings:
        return
    # All recordings of a robot alone, or of the fleet, lie in this folder; no name is as short.
    files = f"{shlex.quote(str(Path(recordings[0]).parent))}/*.rrd"
    yield "review it:", f"{terminal.command()} review {files}"
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        if not summary.fleet_recording:
            # From another computer's.
            options = "--listen 0.0.0.0:8465 --tokens tokens"
            yield "in browser:", f"{terminal.command()} serve {files} {options}"
        yield "in Rerun:", f"copy {files} to a computer with a desktop"
        return
    if not summary.fleet_recording:
        yield "in browser:", f"{terminal.command()} serve {files}"
    yield "in Rerun:", f"{terminal.command('rerun')} {files}"


def _rows(summary: Summary) -> list[tuple[str, str]]:
    cells, covered = summary.reachable_cells, summary.covered_cells
    fleet = [
        (robot.name, f"{robot.driven_m} m in {robot.drive_s:.0f} s, {robot.swept_m2:.1f} m2 swept")
        for robot in summary.robots
    ]
    share = summary.swept_twice_m2 / max(summary.swept_m2, 1e-9)
    fleet.append(("swept by two robots", f"{summary.swept_twice_m2:.1f} m2 ({share_words(share)})"))
    return [
        ("covered", f"{covered} of {cells} cells"),
        ("floor swept", _swept(summary)),
        ("covered again", f"{summary.recovered_cells} cells"),
        ("out of reach", f"{summary.unreachable_cells} cells"),
        ("driven", f"{summary.driven_m} m"),
        *(fleet if len(summary.robots) > 1 else ()),
        ("plans, paths", f"{summary.plans}, {summary.paths}"),
        ("time of a plan", f"{summary.plan_ms_p50} ms, p99 {summary.plan_ms_p99} ms"),
        ("messages refused", str(summary.errors)),
        ("time in all", _time(summary)),
    ]


def _swept(summary: Summary) -> str:
    # Daemon and review know the robot's map and poses only, and differ by a percent or so.
    return f"{swept_words(summary.swept_m2, summary.reachable_m2)}, by the true building and track"


def _time(summary: Summary) -> str:
    return f"{summary.wall_s} s, for {age(summary.makespan_s)} of the robot's time"


def _truth(args: argparse.Namespace, robots: Sequence[DemoRobot]) -> _Truth:
    grid = read_map(find_map(args.map))
    lattice = CoverageLattice.from_map(grid, Footprint(args.cell, args.robot_radius))
    trails, ledger = [_trail(robot) for robot in robots], CoverageLedger(args.cell)
    for trail in trails:
        ledger.break_track()
        for x, y in trail:
            ledger.record(Pose2D(float(x), float(y)))
    first = tuple(trails[0][0].tolist())
    start = anchor_cell(lattice, Pose2D(*first))
    nowhere = np.zeros(lattice.states.shape, bool)
    reachable = nowhere if start is None else ReachableArea.around(lattice, start).reachable
    sweeper = SweepingRobot(args.cell, args.robot_radius)
    floors = [judge_floor(grid, trail, sweeper, stands_at=first) for trail in trails]
    floor = floors[0]
    if len(trails) > 1:
        # No robot drives from the end of one trail to the start of the next.
        driven = np.ones(sum(map(len, trails)) - 1, np.bool_)
        driven[np.cumsum([len(trail) for trail in trails])[:-1] - 1] = False
        floor = judge_floor(grid, np.vstack(trails), sweeper, driven=driven, stands_at=first)
    return _Truth(grid, lattice, reachable, trails, ledger.visits(lattice.window), floor, floors)


def _trail(robot: DemoRobot) -> NDArray[np.float64]:
    if not robot.trail.exists():
        raise ProcessEnded("the robot never drove", hint=f"see {robot.folder / 'robot.log'}")
    return np.loadtxt(robot.trail, delimiter=",", skiprows=1, ndmin=2)


def _draw(args: argparse.Namespace, truth: _Truth, summary: Summary) -> None:
    lines = [
        f"{summary.covered_cells} of {summary.reachable_cells} reachable cells covered, "
        f"{summary.driven_m} m driven, {summary.paths} paths",
        f"floor swept: {_swept(summary)}",
    ]
    title = f"{Path(args.map).stem}: mapped and covered"
    geometry = truth.floor.geometry
    unswept = MapLayer(geometry, truth.floor.unswept)
    if len(truth.trails) > 1:
        from fasaco_edge.cli.fleet_wing import draw_fleet_mission

        swept = [MapLayer(geometry, floor.swept) for floor in truth.floors]
        names = [robot.name for robot in summary.robots]
        picture = draw_fleet_mission(
            truth.grid,
            truth.lattice,
            dict(zip(names, truth.trails, strict=True)),
            swept,
            unswept,
            title=f"{title} by {len(names)} robots",
            lines=lines,
        )
    else:
        picture = draw_mission(
            truth.grid,
            truth.lattice,
            truth.trails[0],
            truth.visits,
            title=title,
            lines=lines,
            swept=None if args.line == "cells" else MapLayer(geometry, truth.floor.swept),
            unswept=unswept,
        )
    picture.save(summary.picture)


def _percentile(values: tuple[float, ...], percent: float) -> float | None:
    return round(float(np.percentile(values, percent)), 1) if values else None
