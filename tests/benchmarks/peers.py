"""Comparison of ``plan`` with foreign coverage planners, on the same buildings, by one judge.

``benchmarks peers``: swept share, seconds per square metre, turning, and time of planning.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.benchmark import Benchmark, MeasuredGoal, Report, Say, positive
from fasaco_edge.errors import BadConfiguration
from tests.benchmarks.floor import RADIUS_M, SPEED_M_S, TOOL_M, TURN_S
from tests.benchmarks.harness import check_names, grid_name
from tests.benchmarks.peer_planners import (
    LINE_S,
    ORDER_S,
    OTHERS,
    NoLineError,
    default_folder,
    install,
    line_of,
    problem_of,
)

if TYPE_CHECKING:
    from fasaco_edge.grid.occupancy import OccupancyGrid

DEFAULT_MAPS = ("office", "flat", "walled_grid", "basement")
OURS = "fasaco-edge"


@dataclass(frozen=True, slots=True)
class PeerRun:
    """One planner's line over one building.

    Attributes:
        building: its name.
        planner: ``OURS`` or one of ``OTHERS``.
        fault: why there is no line; "" if there is one. Without one there are no figures either.
        swept_share: of the reachable floor.
        s_m2: driving and turning for each square metre swept [s].
        planning_s: processor time of planning [s]: ours from the map on, a peer's from the polygon
            of the robot's places on.
        turning_deg: sum of turns for each square metre swept [deg].
        illegal_share: part of the line on which the robot's disc touches a wall.
        patches: left that are larger than 4 dm2.
    """

    building: str
    planner: str
    fault: str = ""
    swept_share: float | None = None
    s_m2: float | None = None
    planning_s: float | None = None
    turning_deg: float | None = None
    illegal_share: float | None = None
    patches: int | None = None


def measure(
    maps: Sequence[str], peers: Sequence[str], folder: Path, limit_s: float, say: Say
) -> Generator[PeerRun, None, None]:
    """Yield the run of each planner over each building, ours first."""
    from fasaco_edge.config.robot import RobotConfig
    from fasaco_edge.grid.lattice import CoverageLattice
    from fasaco_edge.grid.walls import wall_direction
    from fasaco_edge.offline.maps import load_map
    from fasaco_edge.offline.plan import plan
    from fasaco_edge.offline.settings import Search
    from fasaco_edge.planners.grids import MAP_FOOTPRINT, start_cell

    missing = {}
    for name in peers:
        say(f"installing {name}")
        missing[name] = install(OTHERS[name], folder)
    robot = RobotConfig(
        tool_width_m=TOOL_M, radius_m=RADIUS_M, speed_m_s=SPEED_M_S, quarter_turn_s=TURN_S
    )
    if maps:
        # Loads compiled kernels, which is no part of planning.
        say("loading kernels")
        plan(load_map(maps[0]), robot, search=Search(budget_s=0.01))
    for name in maps:
        map_, building = load_map(name), grid_name(name)
        truth, file = map_.grid, map_.file
        if truth is None or file is None:
            raise BadConfiguration(f"{name}: a coverage grid has no floor")
        row, col = start_cell(CoverageLattice.from_map(truth, MAP_FOOTPRINT), file)
        start = (col + 0.5) * TOOL_M, (row + 0.5) * TOOL_M
        walls = wall_direction(truth)
        walls_deg = walls.rotation_deg if walls else 0.0
        say(f"{building}, {OURS}")
        began = time.process_time()
        xy = plan(map_, robot, start_xy=start).xy
        took_s = time.process_time() - began
        yield _judged(building, OURS, truth, xy, took_s, start, walls_deg)
        problem = problem_of(truth, start, walls_deg)
        for peer in peers:
            say(f"{building}, {peer}")
            if missing[peer]:
                yield PeerRun(building, peer, f"cannot be installed: {missing[peer]}")
                continue
            try:
                xy, took_s = line_of(peer, folder, problem, limit_s)
            except NoLineError as error:
                yield PeerRun(building, peer, str(error))
                continue
            yield _judged(building, peer, truth, xy, took_s, start, walls_deg)


def _judged(
    building: str,
    planner: str,
    truth: OccupancyGrid,
    line_xy: NDArray[np.float64],
    planning_s: float,
    start: tuple[float, float],
    walls_deg: float,
) -> PeerRun:
    from fasaco_edge.judge.floor import SweepingRobot, judge_floor
    from tests.benchmarks.calm import calm_of

    robot = SweepingRobot(TOOL_M, RADIUS_M, SPEED_M_S, TURN_S)
    figures = judge_floor(truth, line_xy, robot, stands_at=start).figures
    if not figures.swept_m2:
        return PeerRun(building, planner, "a line that sweeps nothing")
    return PeerRun(
        building,
        planner,
        swept_share=figures.swept_share,
        s_m2=figures.seconds_per_m2,
        planning_s=planning_s,
        turning_deg=calm_of(line_xy, figures.swept_m2, walls_deg).turning_deg,
        illegal_share=figures.illegal_share,
        patches=figures.patches_over_4_dm2,
    )


HEADER = ("map", "planner", "swept", "s/m2", "planning", "deg/m2", "illegal", "left")


def _maps(args: argparse.Namespace) -> list[str]:
    """Return the maps asked for: names, files, and those of a folder.

    Raises:
        BadConfiguration: the folder has none, or two have the same name.
    """
    maps = list(args.maps)
    if args.folder is not None:
        files = sorted(str(file) for file in args.folder.glob("*.yaml"))
        if not files:
            raise BadConfiguration(f"{args.folder}: no map, a YAML file, in this folder")
        maps += files
    check_names(maps)
    return maps


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--maps",
        nargs="*",
        default=list(DEFAULT_MAPS),
        metavar="MAP",
        help=f"map_server YAMLs or names from `maps` (default: {' '.join(DEFAULT_MAPS)})",
    )
    parser.add_argument(
        "--folder", type=Path, metavar="DIR", help="also use all map_server YAMLs of a folder"
    )
    parser.add_argument(
        "--peers",
        nargs="*",
        choices=tuple(OTHERS),
        default=list(OTHERS),
        metavar="PEER",
        help=f"foreign planners: {', '.join(OTHERS)} (default: all)",
    )
    parser.add_argument(
        "--installed",
        type=Path,
        default=default_folder(),
        metavar="DIR",
        help="folder in which peers are installed (default: %(default)s)",
    )
    parser.add_argument(
        "--limit",
        type=positive,
        default=LINE_S,
        metavar="S",
        help="time limit of a peer's line [s] (default: %(default)s)",
    )


def _report(args: argparse.Namespace, samples: Sequence[PeerRun]) -> Report:
    faults = dict.fromkeys(
        f"{run.planner}: {run.fault}"
        if run.fault.startswith("cannot")
        else f"{run.planner}, {run.building}: {run.fault}"
        for run in samples
        if run.fault
    )
    return Report(
        title="lines of `plan` and of foreign planners",
        header=HEADER,
        rows=tuple(map(_row, samples)),
        figures={
            "lines": [asdict(run) for run in samples],
            "peers": {name: peer.requirement for name, peer in OTHERS.items()},
        },
        goals=tuple(_goals(samples)),
        remarks=(
            *faults,
            "swept: share of the reachable floor; planning: processor time [s], ours from the map "
            "on, with kernels loaded, a peer's from the polygon of the robot's places on; deg/m2: "
            "turning; illegal: share of the line that touches walls; left: patches larger than "
            "4 dm2",
        ),
    )


def _row(run: PeerRun) -> tuple[str, ...]:
    def text(value: float | None, form: str) -> str:
        return "-" if value is None else format(value, form)

    return (
        run.building,
        run.planner,
        text(run.swept_share, ".4f"),
        text(run.s_m2, ".2f"),
        text(run.planning_s, ".2f"),
        text(run.turning_deg, ".0f"),
        text(run.illegal_share, ".4f"),
        text(run.patches, "d"),
    )


def _goals(samples: Sequence[PeerRun]) -> Iterator[MeasuredGoal]:
    ours = {
        run.building: run.s_m2 for run in samples if run.planner == OURS and run.s_m2 is not None
    }
    for name in OTHERS:
        ratios = [
            ours[run.building] / run.s_m2
            for run in samples
            if run.planner == name and run.s_m2 is not None and run.building in ours
        ]
        if ratios:
            yield MeasuredGoal(f"s/m2 to {name}, median", round(statistics.median(ratios), 4), 1.0)


PEERS = Benchmark(
    name="peers",
    summary="lines of `plan` against those of foreign coverage planners",
    description="Plan over buildings by `plan` with default settings, and by foreign coverage "
    "planners (peers), and judge all lines alike, on the map's pixels. pip installs each peer into "
    "its own folder when it is first used; peers that cannot be installed are left out. "
    "coverage-path-planner drives a lap along each border, then straight lines; fields2cover only "
    f"straight lines, ordered within {ORDER_S} s. Tool 0.3 m, robot radius 0.18 m, 0.25 m/s, "
    "1.5 s per quarter-turn.",
    add_options=_add_options,
    count=lambda args: len(_maps(args)) * (1 + len(args.peers)),
    measure=lambda args, say: measure(_maps(args), args.peers, args.installed, args.limit, say),
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks peers
  python -m tests.benchmarks peers --maps office --folder ~/maps --json
""",
)
