"""``benchmarks fleet-online``: a fleet in buildings unknown to all its robots."""

from __future__ import annotations

import argparse
import random
import statistics
from collections.abc import Generator, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from fasaco_edge.bench.benchmark import Benchmark, MeasuredGoal, Report, Say, positive
from fasaco_edge.fleet.mission.kind import layer_of
from fasaco_edge.fleet.mission.travel import apart
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.grids import start_point
from tests.benchmarks.buildings import building
from tests.benchmarks.fleets.run import RADIUS_M, TOOL_M, Fleet, FleetRun
from tests.benchmarks.harness import grid_name
from tests.benchmarks.online.buildings import RADIUS_SHARE, of_grid

Point = tuple[float, float]

# Goals: time of a fleet, by number of robots, relative to one robot.
TIME_GOALS = {2: 0.56, 4: 0.31, 8: 0.19}
# Goal: share of cells swept again.
AGAIN_GOAL = 0.03
HEADER = (
    "robots", "runs", "time", "worst", "driven", "twice", "again", "ends", "stood s", "touches",
    "plan ms", "step ms",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class FleetFigures:
    """A run of a fleet.

    Attributes:
        building, robots, line: the question.
        time_s: until the last robot is done.
        time_ratio: that against one robot's.
        driven_m: by all.
        driven_ratio: that against one robot's.
        cells: swept.
        twice: share of them that two or more robots swept.
        again: share of them that were swept after another robot, beyond the shortest way through.
        first_end: when the first robot is done, as a share of ``time_s``.
        longest_stand_s: the longest stand of a robot under way.
        touches, meetings: how often robots touched, and stopped before one another.
        plans, divisions: how many were made.
        plan_ms, step_ms: 99th percentile of the processor time of a plan, and of a step of the
            mission [ms].
        plan_alone_ms, step_alone_ms: the same of one robot.
    """

    building: str
    robots: int
    line: str
    time_s: float
    time_ratio: float
    driven_m: float
    driven_ratio: float
    cells: int
    twice: float
    again: float
    first_end: float
    longest_stand_s: float
    touches: int
    meetings: int
    plans: int
    divisions: int
    plan_ms: float
    step_ms: float
    plan_alone_ms: float
    step_alone_ms: float


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--maps", nargs="*", default=["flat"], metavar="MAP")
    parser.add_argument(
        "--generated", type=int, default=3, metavar="N", help="number of buildings (default: 3)"
    )
    parser.add_argument(
        "--cells", type=positive, default=1_000, help="cells of each building (default: 1000)"
    )
    parser.add_argument("--robots", type=positive, nargs="+", default=[2, 4, 8], metavar="N")
    parser.add_argument("--line", choices=("cells", "thorough"), default="cells")
    parser.add_argument(
        "--loss", type=float, default=0.0, metavar="P",
        help="probability that a listener does not receive a message (default: 0)",
    )  # fmt: skip
    parser.add_argument(
        "--period", type=float, default=1.0, metavar="S", help="period of messages [s] (default: 1)"
    )


def _measure(args: argparse.Namespace, say: Say) -> Generator[FleetFigures, None, None]:
    warm_up()
    for name, truth, first, radius_m in _buildings(args):
        say(f"{name}, 1 robot")
        alone = _run(Fleet(truth, [first], args.line, args.period, radius_m=radius_m))
        lattice = CoverageLattice.from_map(truth, Footprint(TOOL_M, radius_m))
        for robots in args.robots:
            if robots == 1:
                continue
            say(f"{name}, {robots} robots")
            starts = [first, *apart(lattice, first, robots - 1)]
            fleet = Fleet(truth, starts, args.line, args.period, radius_m=radius_m)
            run = _run(fleet, args.loss)
            yield _figures(name, run, alone)


def _buildings(
    args: argparse.Namespace,
) -> Generator[tuple[str, OccupancyGrid, Point, float], None, None]:
    for name in args.maps:
        truth = read_map(file := find_map(name))
        yield grid_name(name), truth, start_point(file, truth, RADIUS_M), RADIUS_M
    for seed in range(args.generated):
        made = of_grid(building(args.cells, seed), TOOL_M)
        row, col = made.start
        first = (col + 0.5) * TOOL_M, (row + 0.5) * TOOL_M
        yield made.name, made.truth, first, RADIUS_SHARE * TOOL_M


def _run(fleet: Fleet, loss: float = 0.0) -> FleetRun:
    run = FleetRun(fleet)
    if loss:
        chance = random.Random(1)
        run.hears = lambda _speaker, _listener: chance.random() >= loss
    run.run()
    return run


def _figures(name: str, run: FleetRun, alone: FleetRun) -> FleetFigures:
    ends = [robot.done_s for robot in run.robots]
    driven_m = sum(robot.world.distance_m for robot in run.robots)
    (single,) = alone.robots
    return FleetFigures(
        building=name,
        robots=len(run.robots),
        line=run.fleet.line,
        time_s=max(ends),
        time_ratio=max(ends) / single.done_s,
        driven_m=driven_m,
        driven_ratio=driven_m / single.world.distance_m,
        cells=run.cells,
        twice=run.twice / run.cells,
        again=run.again / run.cells,
        first_end=min(ends) / max(ends),
        longest_stand_s=max(robot.world.longest_stand_s for robot in run.robots),
        touches=sum(robot.world.touches for robot in run.robots),
        meetings=sum(robot.world.meetings for robot in run.robots),
        plans=sum(robot.plans for robot in run.robots),
        divisions=max(layer_of(robot.mission).numbers.number for robot in run.robots),
        plan_ms=_p99(run, "plan_ms"),
        step_ms=_p99(run, "step_ms"),
        plan_alone_ms=_p99(alone, "plan_ms"),
        step_alone_ms=_p99(alone, "step_ms"),
    )


def _p99(run: FleetRun, name: str) -> float:
    """Return the 99th percentile of the times of all robots [ms]."""
    times = [ms for robot in run.robots for ms in getattr(robot, name)]
    return round(float(np.percentile(times, 99)), 2)


def _report(args: argparse.Namespace, runs: Sequence[FleetFigures]) -> Report:
    rows, goals = [], []
    for robots in args.robots:
        some = [run for run in runs if run.robots == robots]
        if not some:
            continue
        time, driven, twice, again, ends, *slow = (
            statistics.fmean(getattr(run, name) for run in some)
            for name in (
                "time_ratio", "driven_ratio", "twice", "again", "first_end", "plan_ms",
                "plan_alone_ms", "step_ms", "step_alone_ms",
            )
        )  # fmt: skip
        worst = max(run.time_ratio for run in some)
        stood_s, touches = max(run.longest_stand_s for run in some), sum(r.touches for r in some)
        shares = f"{twice:.1%}", f"{again:.1%}"
        figures = f"{time:.3f}", f"{worst:.3f}", f"{driven:.3f}", *shares, f"{ends:.2f}"
        slower = f"{slow[0]:.1f} ({slow[1]:.1f})", f"{slow[2]:.1f} ({slow[3]:.1f})"
        rows.append(
            (str(robots), str(len(some)), *figures, f"{stood_s:.0f}", str(touches), *slower)
        )
        if robots in TIME_GOALS:
            goals.append(MeasuredGoal(f"{robots} robots: time", round(time, 4), TIME_GOALS[robots]))
        goals.append(MeasuredGoal(f"{robots} robots: swept again", round(again, 4), AGAIN_GOAL))
    return Report(
        title=f"fleets in unknown buildings against one robot, {args.line}",
        header=HEADER,
        rows=tuple(rows),
        figures={"runs": [asdict(run) for run in runs]},
        goals=tuple(goals),
        remarks=(
            "means but for worst, stood and touches. time, driven: against one robot's. twice: "
            "share of the cells that two or more swept, also by only driving through; again: "
            "without the shortest ways through floor that others had swept. ends: when the first "
            "robot is done, against the last. plan, step: processor time of a plan and of a step "
            "of the mission, 99th percentile (of one robot).",
        ),
    )


def _count(args: argparse.Namespace) -> int:
    fleets: int = sum(robots > 1 for robots in args.robots)
    buildings: int = len(args.maps) + args.generated
    return buildings * fleets


FLEET_ONLINE = Benchmark(
    name="fleet-online",
    summary="fleets in unknown buildings, against one robot",
    description="Let simulated robots with scanners, discs and messages share an unknown building, "
    "each with its own mission. Time is simulated, in one process, so the same options give the "
    "same run. For real daemons use `fasaco-edge demo --robots N`.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks fleet-online
  python -m tests.benchmarks fleet-online --maps --generated 5 --cells 2000 --robots 4 --json
  python -m tests.benchmarks fleet-online --maps flat --generated 0 --robots 3 --line thorough
  python -m tests.benchmarks fleet-online --robots 4 --loss 0.3
""",
)
