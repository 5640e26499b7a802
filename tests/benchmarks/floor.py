"""Lines over the floor of buildings: planned on a known map, or driven while the map is built.

``benchmarks floor``: the swept share of the reachable floor and the time per square metre of each
line, and of the walk through the centres of cells on the same map.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Generator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

from fasaco_edge.bench.benchmark import Benchmark, MeasuredGoal, Report, Say
from fasaco_edge.bench.spread import percentile
from tests.benchmarks.calm import Calm
from tests.benchmarks.harness import grid_name

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from fasaco_edge.grid.occupancy import OccupancyGrid
    from fasaco_edge.judge.floor import FloorFigures

DEFAULT_MAPS = ("flat", "office", "basement")
# The robot of the floor figures, the same for all releases.
TOOL_M, RADIUS_M, OVERLAP = 0.3, 0.18, 0.08
SPEED_M_S, TURN_S = 0.25, 1.5
# Proposals of a plan for a known map, about a second; and of one during a mission, a tenth of that.
PROPOSALS, PROPOSALS_ON_THE_WAY = 25_000_000, 2_500_000
CENTRES, QUICK, THOROUGH, ONLINE = CASES = ("centres", "quick", "thorough", "online")
# A mission that is not done by then has failed, in simulated time [s].
LONGEST_S = 20_000.0


@dataclass(frozen=True, slots=True)
class FloorRun:
    """One line over one building.

    Attributes:
        building: its name.
        case: one of ``CASES``.
        swept_share: of the reachable floor.
        s_m2: driving and turning for each square metre swept [s].
        gap: see ``FloorFigures.gap``.
        illegal_share: part of the line on which the robot's disc touches a wall.
        patches: left that are larger than 4 dm2.
        calm: how much it turns, crosses itself, and leaves the walls' directions.
        line_ms_m2: making the line for each reachable square metre [ms]; None for ``centres``.
        step_p99_ms, replan_p99_ms: of a mission, map to decision and to new path [ms].
    """

    building: str
    case: str
    swept_share: float
    s_m2: float
    gap: float
    illegal_share: float
    patches: int
    calm: Calm
    line_ms_m2: float | None = None
    step_p99_ms: float | None = None
    replan_p99_ms: float | None = None


def measure(maps: Sequence[str], cases: Sequence[str], say: Say) -> Generator[FloorRun, None, None]:
    """Yield each case of each building."""
    from fasaco_edge.grid.lattice import CoverageLattice
    from fasaco_edge.grid.map_files import find_map, read_map
    from fasaco_edge.planners.grids import MAP_FOOTPRINT, start_cell

    for name in maps:
        file = find_map(name)
        truth = read_map(file)
        row, col = start_cell(CoverageLattice.from_map(truth, MAP_FOOTPRINT), file)
        start = (col + 0.5) * TOOL_M, (row + 0.5) * TOOL_M
        for case in cases:
            say(f"{grid_name(name)}, {case}")
            run = drive if case == ONLINE else plan
            yield run(grid_name(name), truth, start, case)


def plan(building: str, truth: OccupancyGrid, start: tuple[float, float], case: str) -> FloorRun:
    """Plan a line on a known map."""
    from fasaco_edge.grid.fine_raster import RobotDiscs
    from fasaco_edge.grid.floor import Floor, StandLattice
    from fasaco_edge.grid.lattice import CoverageLattice, Footprint
    from fasaco_edge.kernels.floor.turning import proportional_turning
    from fasaco_edge.planners.cost import CoverageCost, SearchWork
    from fasaco_edge.planners.line import LINES, LineSearch
    from fasaco_edge.planners.planner import WorkLimit
    from fasaco_edge.planners.problem import CoverageProblem
    from fasaco_edge.planners.search.near_optimal import NearOptimal

    limit = WorkLimit(SearchWork(proposals=PROPOSALS))
    floor = Floor.around(truth, RobotDiscs(RADIUS_M, TOOL_M), start)
    if case == CENTRES:
        lattice = CoverageLattice.from_map(truth, Footprint(TOOL_M, RADIUS_M))
        cost = CoverageCost.for_robot(TOOL_M, SPEED_M_S, TURN_S)
        first = int(start[1] // TOOL_M), int(start[0] // TOOL_M)
        path = NearOptimal().plan(CoverageProblem.of(lattice, first, cost=cost), limit)
        return _judged(building, case, truth, lattice.centres(path.cells), start)
    cell_m = TOOL_M * (1.0 - OVERLAP)
    stands = StandLattice.over(floor, cell_m)
    cost = CoverageCost.for_robot(cell_m, SPEED_M_S, TURN_S)
    problem = CoverageProblem.of(stands.lattice, stands.start_cell(floor), cost=cost)
    path = NearOptimal().plan(problem, limit)
    config = replace(LINES[case], speed_m_s=SPEED_M_S, turning=proportional_turning(TURN_S))
    began = time.process_time()
    search = LineSearch(path.cells, stands, floor, config, is_end_fixed=False)
    line = next(search.best for _ in search.run() if search.best is not None)
    ms = 1e3 * (time.process_time() - began)
    judged = _judged(building, case, truth, line.xy, start)
    return replace(judged, line_ms_m2=ms / line.reachable_m2)


def drive(building: str, truth: OccupancyGrid, start: tuple[float, float], case: str) -> FloorRun:
    """Let a simulated robot cover a building that nobody has mapped; its true track is judged."""

    from fasaco_edge.grid.geometry import Pose2D
    from fasaco_edge.grid.lattice import Footprint
    from fasaco_edge.kernels.floor.turning import proportional_turning
    from fasaco_edge.mission.config import Sweeping
    from fasaco_edge.mission.core.mission import Mission, MissionConfig
    from fasaco_edge.mission.events import MapReceived, PlanReady, PoseReceived
    from fasaco_edge.planners.cost import CoverageCost, SearchWork
    from fasaco_edge.planners.line import LINES
    from fasaco_edge.planners.planner import WorkLimit
    from fasaco_edge.planners.search.near_optimal import NearOptimal
    from fasaco_edge.simulation.robot import SimulationConfig
    from fasaco_edge.simulation.world import World
    from fasaco_edge.states import State

    simulated = SimulationConfig(speed_m_s=SPEED_M_S, robot_radius_m=RADIUS_M, padding_m=0.01)
    world = World(truth, Pose2D(*start), simulated)
    cell_m = TOOL_M * (1.0 - OVERLAP)
    line = replace(LINES[THOROUGH], speed_m_s=SPEED_M_S, turning=proportional_turning(TURN_S))
    cost = CoverageCost.for_robot(cell_m, SPEED_M_S, TURN_S)
    sweeping = Sweeping(TOOL_M, 25_000_000, line)
    mission = Mission(MissionConfig(Footprint(cell_m, RADIUS_M), cost=cost, sweeping=sweeping))
    planner, limit = NearOptimal(), WorkLimit(SearchWork(proposals=PROPOSALS_ON_THE_WAY))
    steps_ms, replans_ms = [], []
    while mission.state is not State.DONE:
        heard = world.tick()
        now = world.stamp_ns * 1e-9
        if now > LONGEST_S:
            raise RuntimeError(f"{building}: not done after {LONGEST_S:g} s: {mission.reason}")
        events: list[MapReceived | PoseReceived] = []
        events += [MapReceived(heard.map)] if heard.map is not None else []
        events += [PoseReceived(heard.pose)] if heard.pose is not None else []
        if not events:
            continue
        began = time.process_time()
        decision = mission.step(events, now)
        steps_ms.append(1e3 * (time.process_time() - began))
        is_replan = decision.plan is not None
        while True:
            if decision.path is not None:
                assert decision.path.xy is not None
                world.follow(decision.path.xy)
            if decision.plan is None:
                break
            path = planner.plan(decision.plan.problem, limit)
            decision = mission.step([PlanReady(decision.plan.number, path, 0.0)], now)
        if is_replan:
            replans_ms.append(1e3 * (time.process_time() - began))
    track: NDArray[np.float64] = world.track
    return replace(
        _judged(building, case, truth, track, start),
        step_p99_ms=percentile(steps_ms, 99.0),
        replan_p99_ms=percentile(replans_ms, 99.0),
    )


def _judged(
    building: str,
    case: str,
    truth: OccupancyGrid,
    line_xy: NDArray[np.float64],
    start: tuple[float, float],
) -> FloorRun:
    from fasaco_edge.grid.walls import wall_direction
    from fasaco_edge.judge.floor import SweepingRobot, judge_floor
    from tests.benchmarks.calm import calm_of

    robot = SweepingRobot(TOOL_M, RADIUS_M, SPEED_M_S, TURN_S)
    figures: FloorFigures = judge_floor(truth, line_xy, robot, stands_at=start).figures
    assert figures.swept_share is not None
    assert figures.seconds_per_m2 is not None
    walls = wall_direction(truth)
    return FloorRun(
        building=building,
        case=case,
        swept_share=figures.swept_share,
        s_m2=figures.seconds_per_m2,
        gap=figures.gap or 0.0,
        illegal_share=figures.illegal_share,
        patches=figures.patches_over_4_dm2,
        calm=calm_of(line_xy, figures.swept_m2, walls.rotation_deg if walls else 0.0),
    )


HEADER = (
    *("map", "case", "swept", "s/m2", "gap", "ratio", "illegal", "left"),
    *("deg/m2", "back", "cross", "along", "line", "step", "replan"),
)
# Of all buildings: least swept share, most time against centres of cells.
GOALS = {QUICK: (0.95, 0.97), THOROUGH: (0.985, 1.05), ONLINE: (0.975, 1.13)}


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--maps",
        nargs="+",
        default=list(DEFAULT_MAPS),
        metavar="MAP",
        help=f"map_server YAMLs or names from `maps` (default: {' '.join(DEFAULT_MAPS)})",
    )
    parser.add_argument(
        "--cases", nargs="+", choices=CASES, default=list(CASES), help="(default: all)"
    )


def _report(args: argparse.Namespace, samples: Sequence[FloorRun]) -> Report:
    centres = {run.building: run.s_m2 for run in samples if run.case == CENTRES}
    ratios = {
        (run.building, run.case): run.s_m2 / centres[run.building]
        for run in samples
        if run.building in centres
    }
    figures = [{**asdict(run), "ratio": ratios.get((run.building, run.case))} for run in samples]
    return Report(
        title="swept share of the reachable floor, seconds a square metre",
        header=HEADER,
        rows=tuple(_row(run, ratios.get((run.building, run.case))) for run in samples),
        figures={"floors": figures},
        goals=tuple(_goals(samples, ratios)),
        remarks=(
            "gap: to the time of driving that area once, without turns; ratio: s/m2 against the "
            "walk through centres on the same map, known from the beginning; left: patches larger "
            "than 4 dm2; deg/m2: turning; back: turns above 135 degrees a m2; cross: crossings a "
            "m2; along: share along the walls; line: making it [ms/m2]; step, replan: of the "
            "mission, 99th percentile; both of processor time [ms]",
        ),
    )


def _row(run: FloorRun, ratio: float | None) -> tuple[str, ...]:
    def text(value: float | None, form: str) -> str:
        return "" if value is None else format(value, form)

    return (
        run.building,
        run.case,
        f"{run.swept_share:.4f}",
        f"{run.s_m2:.2f}",
        f"{run.gap:.2f}",
        text(ratio, ".3f"),
        f"{run.illegal_share:.4f}",
        str(run.patches),
        f"{run.calm.turning_deg:.0f}",
        f"{run.calm.turns_back:.2f}",
        f"{run.calm.crossings:.2f}",
        f"{run.calm.along_share:.2f}",
        text(run.line_ms_m2, ".1f"),
        text(run.step_p99_ms, ".1f"),
        text(run.replan_p99_ms, ".1f"),
    )


def _goals(
    samples: Sequence[FloorRun], ratios: dict[tuple[str, str], float]
) -> Generator[MeasuredGoal, None, None]:
    for case, (least, most) in GOALS.items():
        runs = [run for run in samples if run.case == case]
        if not runs:
            continue
        swept = statistics.median(run.swept_share for run in runs)
        yield MeasuredGoal(f"{case}: swept, median", round(swept, 4), least, at_least=True)
        known = [ratios[run.building, case] for run in runs if (run.building, case) in ratios]
        if known:
            yield MeasuredGoal(f"{case}: ratio, median", round(statistics.median(known), 4), most)
    if samples:
        yield MeasuredGoal("illegal share, worst", max(run.illegal_share for run in samples), 0.0)


FLOOR = Benchmark(
    name="floor",
    summary="lines over the floor: swept share and time, planned and driven",
    description="Plan lines over known buildings, quick and thorough, and let a simulated robot "
    "cover the same buildings while it maps them. Each line, and the true track, is judged on the "
    "map's pixels, independently of cells. Tool 0.3 m, robot radius 0.18 m, 0.25 m/s, 1.5 s per "
    "quarter-turn.",
    add_options=_add_options,
    count=lambda args: len(args.maps) * len(args.cases),
    measure=lambda args, say: measure(args.maps, args.cases, say),
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks floor
  python -m tests.benchmarks floor --maps flat warehouse --cases centres thorough --json
""",
)
