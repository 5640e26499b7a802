"""The result of a demo; floor is measured in the true building, not by the daemon."""

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
from fasaco_edge.cli.console.arguments import writing
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.demo.mission import MissionEnding
from fasaco_edge.cli.demo.robots import DemoRobot
from fasaco_edge.client.phrases import age
from fasaco_edge.drawing.pictures import draw_mission
from fasaco_edge.drawing.plot import MapLayer
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.floor import (
    JudgedFloor,
    SweepingRobot,
    judge_floor,
    swept_words,
)
from fasaco_edge.text import percent
from fasaco_edge.wire.documents.replies import CoverageReport


@dataclass(frozen=True, slots=True, eq=False)
class _Truth:
    """The building, the robots' tracks (n, 2) [m], and the floor swept by all, and by each."""

    grid: OccupancyGrid
    tracks: list[NDArray[np.float64]]
    floor: JudgedFloor
    floors: list[JudgedFloor]

    @property
    def swept_twice_m2(self) -> float:
        """Floor swept by two or more robots [m2]."""
        times = sum(floor.swept.astype(np.int8) for floor in self.floors)
        return float(np.count_nonzero(times > 1) * self.floor.geometry.resolution**2)


@dataclass(frozen=True, slots=True)
class RobotFigures:
    """Figures of one robot; ``drive_s``: time of driving and turning [simulated s]."""

    name: str
    driven_m: float
    drive_s: float
    swept_m2: float


@dataclass(frozen=True, slots=True)
class DemoSummary:
    """The figures of a demo; areas of floor are by the true building and tracks.

    Cells are counted by the daemon; with several daemons, by the one with the most cells left.
    """

    map: str
    complete: bool
    reachable_cells: int
    covered_cells: int
    reachable_m2: float
    swept_m2: float
    swept_twice_m2: float
    driven_m: float
    robots: tuple[RobotFigures, ...]
    plans: int
    paths: int
    errors: int
    wall_s: float
    makespan_s: float
    recording: list[str]
    fleet_recording: list[str]
    picture: str


def summarise(
    args: argparse.Namespace, out: Path, robots: Sequence[DemoRobot], ending: MissionEnding
) -> DemoSummary:
    """Return the figures of a demo; write them and a picture into ``out``."""
    truth = _truth(args, robots)
    reports = [status.coverage for status in ending.statuses if status.coverage is not None]
    cells = max(reports, key=lambda each: each.coverable - each.covered, default=CoverageReport())
    figures = tuple(
        RobotFigures(
            robot.name,
            round(floor.figures.length_m, 1),
            round(floor.figures.seconds, 1),
            round(floor.figures.swept_m2, 2),
        )
        for robot, floor in zip(robots, truth.floors, strict=True)
    )
    summary = DemoSummary(
        map=str(args.map),
        complete=cells.covered == cells.coverable and not ending.timed_out,
        reachable_cells=cells.coverable,
        covered_cells=cells.covered,
        reachable_m2=round(truth.floor.figures.reachable_m2, 2),
        swept_m2=round(truth.floor.figures.swept_m2, 2),
        swept_twice_m2=round(truth.swept_twice_m2, 2),
        driven_m=round(sum(floor.figures.length_m for floor in truth.floors), 1),
        robots=figures,
        plans=sum(status.plan.plans for status in ending.statuses),
        paths=sum(status.path.revision for status in ending.statuses if status.path),
        errors=sum(status.errors.total for status in ending.statuses),
        wall_s=round(ending.wall_s, 1),
        makespan_s=round(ending.makespan_s, 1),
        recording=[str(file) for robot in robots for file in sorted(robot.folder.glob("*.rrd"))],
        fleet_recording=[str(file) for file in sorted(out.glob("*-fleet-*.rrd"))],
        picture=str(out / "mission.png"),
    )
    _draw(args, truth, summary)
    with writing(out / "summary.json") as new:
        new.write_text(json.dumps(asdict(summary), indent=1) + "\n", encoding="utf-8")
    return summary


def print_summary(summary: DemoSummary, *, as_json: bool) -> None:
    """Print the figures as a table or as JSON."""
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


def _openers(summary: DemoSummary) -> Iterator[tuple[str, str]]:
    """Yield the commands that open the recording, each with its purpose."""
    recordings = summary.fleet_recording or summary.recording
    if not recordings:
        return
    # This folder has no other recordings, so a short pattern is enough.
    files = f"{shlex.quote(str(Path(recordings[0]).parent))}/*.rrd"
    yield "review it:", f"{terminal.command()} review {files}"
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        if not summary.fleet_recording:
            # The browser runs on another computer.
            options = "--listen 0.0.0.0:8465 --tokens tokens"
            yield "in browser:", f"{terminal.command()} serve {files} {options}"
        yield "in Rerun:", f"copy {files} to a computer with a desktop"
        return
    if not summary.fleet_recording:
        yield "in browser:", f"{terminal.command()} serve {files}"
    yield "in Rerun:", f"{terminal.command('rerun')} {files}"


def _rows(summary: DemoSummary) -> list[tuple[str, str]]:
    cells, covered = summary.reachable_cells, summary.covered_cells
    fleet = [
        (robot.name, f"{robot.driven_m} m in {robot.drive_s:.0f} s, {robot.swept_m2:.1f} m2 swept")
        for robot in summary.robots
    ]
    share = summary.swept_twice_m2 / max(summary.swept_m2, 1e-9)
    fleet.append(("swept by two robots", f"{summary.swept_twice_m2:.1f} m2 ({percent(share)})"))
    return [
        ("covered", f"{covered} of {cells} cells"),
        ("floor swept", _swept(summary)),
        ("driven", f"{summary.driven_m} m"),
        *(fleet if len(summary.robots) > 1 else ()),
        ("plans, paths", f"{summary.plans}, {summary.paths}"),
        ("messages refused", str(summary.errors)),
        ("time in all", _time(summary)),
    ]


def _swept(summary: DemoSummary) -> str:
    # Daemon and review use the robot's map and poses, so their figures differ by about 1 %.
    return f"{swept_words(summary.swept_m2, summary.reachable_m2)}, by the true building and track"


def _time(summary: DemoSummary) -> str:
    whose = "robot's" if len(summary.robots) == 1 else "robots'"
    return f"{summary.wall_s} s, for {age(summary.makespan_s)} of the {whose} time"


def _truth(args: argparse.Namespace, robots: Sequence[DemoRobot]) -> _Truth:
    grid, tracks = read_map(find_map(args.map)), [_track(robot) for robot in robots]
    x, y = tracks[0][0].tolist()
    sweeper = SweepingRobot(args.cell, args.robot_radius)
    floors = [judge_floor(grid, track, sweeper, stands_at=(x, y)) for track in tracks]
    # The segments from the end of one track to the start of the next are not driven.
    driven = np.ones(sum(map(len, tracks)) - 1, np.bool_)
    driven[np.cumsum([len(track) for track in tracks])[:-1] - 1] = False
    floor = judge_floor(grid, np.vstack(tracks), sweeper, driven=driven, stands_at=(x, y))
    return _Truth(grid, tracks, floor, floors)


def _track(robot: DemoRobot) -> NDArray[np.float64]:
    if not robot.trail.exists():
        raise ProcessEnded("the robot never drove", hint=f"see {robot.folder / 'robot.log'}")
    return np.loadtxt(robot.trail, delimiter=",", skiprows=1, ndmin=2)


def _draw(args: argparse.Namespace, truth: _Truth, summary: DemoSummary) -> None:
    lines = [
        f"{summary.covered_cells} of {summary.reachable_cells} reachable cells covered, "
        f"{summary.driven_m} m driven, {summary.paths} paths",
        f"floor swept: {_swept(summary)}",
    ]
    title = f"{Path(args.map).stem}: mapped and covered"
    geometry = truth.floor.geometry
    lattice = CoverageLattice.from_map(truth.grid, Footprint(args.cell, args.robot_radius))
    unswept = MapLayer(geometry, truth.floor.unswept)
    if len(truth.tracks) > 1:
        from fasaco_edge.cli.fleet_wing import draw_fleet_mission

        swept = [MapLayer(geometry, floor.swept) for floor in truth.floors]
        names = [robot.name for robot in summary.robots]
        tracks = dict(zip(names, truth.tracks, strict=True))
        title += f" by {len(names)} robots"
        recording = [Path(file) for file in summary.fleet_recording]
        picture = draw_fleet_mission(
            truth.grid, lattice, tracks, swept, unswept, recording, title=title, lines=lines
        )
    else:
        picture = draw_mission(
            truth.grid,
            lattice,
            truth.tracks[0],
            title=title,
            lines=lines,
            swept=MapLayer(geometry, truth.floor.swept),
            unswept=unswept,
        )
    picture.save(summary.picture)
