"""Time of each part of a replan, in a mission that drives a line over a large building.

``benchmarks replan``: processor time of each part of the mission, from a map on which an obstacle
has appeared or disappeared to the new line.
"""

from __future__ import annotations

import argparse
import gc
import hashlib
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING, Any

from fasaco_edge.bench.benchmark import Benchmark, MeasuredGoal, Report, Say, positive
from fasaco_edge.bench.spread import percentile
from tests.benchmarks.buildings import FEWEST_CELLS, building

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.events import Event

TOOL_M, RADIUS_M, OVERLAP = 0.3, 0.18, 0.08
SPEED_M_S, TURN_S = 0.25, 1.5
# Edge of a pixel of a map [m]; edge of a cell of a building [pixels].
PIXEL_M, CELL_PX = 0.05, 6
# Width of the map's border that comes and goes [pixels].
RIM_PX = 24
PATCHED, GROWING = CASES = ("patched", "growing")
# Largest distance of a crate from the robot, and width of a crate [m].
NEAR_M, CRATE_M = 3.0, 0.4
# Number of poses between two maps, and drive from one pose to the next [m].
POSES, POSE_M = 5, 0.05
PROPOSALS = 2_500_000
# All that is not in one of the parts.
REST = "rest"


@dataclass(slots=True)
class Parts:
    """Processor time of this thread by part, of calls within calls only the inner ones [ms]."""

    ms: dict[str, float] = field(default_factory=dict)
    _open: list[str] = field(default_factory=lambda: [REST])
    _since: float = field(default_factory=time.thread_time)

    def enter(self, part: str) -> None:
        """Count for a part from now on."""
        self._charge()
        self._open.append(part)

    def leave(self) -> None:
        """Count again for what was before."""
        self._charge()
        self._open.pop()

    def take(self) -> dict[str, float]:
        """Return what was counted, and begin anew."""
        self._charge()
        taken, self.ms = self.ms, {}
        return taken

    def _charge(self) -> None:
        now = time.thread_time()
        part = self._open[-1]
        self.ms[part] = self.ms.get(part, 0.0) + 1e3 * (now - self._since)
        self._since = now


@dataclass(frozen=True, slots=True)
class Replan:
    """One map and what came of it.

    Attributes:
        cells: of the building, as asked for.
        case: one of ``CASES``.
        coverable: cells of the lattice that are.
        ms: of each part, by its name.
        first_ms: the first map of the mission, taken in.
        digest: of all lines so far: the same figures are of the same lines.
    """

    cells: int
    case: str
    coverable: int
    ms: dict[str, float]
    first_ms: float
    digest: str

    @property
    def total_ms(self) -> float:
        """From the map to the line."""
        return sum(self.ms.values())


def _timed_parts() -> tuple[tuple[str, type | ModuleType, str], ...]:
    """Return the methods that are timed: name of the part, class or module, name of the method."""
    from fasaco_edge.grid.reachable_area import ReachableArea
    from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
    from fasaco_edge.mission.line import layer
    from fasaco_edge.mission.line.floor_left import UnsweptTally
    from fasaco_edge.mission.line.layer import LineLayer
    from fasaco_edge.mission.line.line_ahead import LineAhead
    from fasaco_edge.mission.line.polisher import Polisher
    from fasaco_edge.mission.line.tally import SweepTally
    from fasaco_edge.mission.map.ground import MissionGround
    from fasaco_edge.mission.map.map_state import MapState
    from fasaco_edge.mission.path.route import Route
    from fasaco_edge.mission.path.trail_layer import TrailLayer
    from fasaco_edge.mission.work.order_reach import OrderReach
    from fasaco_edge.mission.work.present_part import PresentPart
    from fasaco_edge.mission.work.sequencer import Sequencer

    return (
        ("ingest", MapState, "receive_map"),
        ("floor", MissionGround, "follow_map"),
        ("reach", MapState, "update_area"),
        ("reach", ReachableArea, "change_since"),
        ("orders", OrderReach, "record_area"),
        ("orders", PresentPart, "problem"),
        ("orders", Sequencer, "begin_stage"),
        ("ledger", MissionLedger, "check"),
        ("route", Route, "accept"),
        ("route", Route, "truncate"),
        ("trail", TrailLayer, "finish"),
        ("trail", TrailLayer, "with_trail"),
        ("open floor", UnsweptTally, "update"),
        ("follow", LineLayer, "receive_map"),
        ("laying", layer, "lay"),
        ("laying", layer, "lay_blocked"),
        ("counting", SweepTally, "exchange"),
        ("polish", Polisher, "polish"),
        ("publishing", LineAhead, "xy"),
    )


@contextmanager
def _charged(parts: Parts, name: str, owner: type | ModuleType, method: str) -> Iterator[None]:
    before: Callable[..., Any] = owner.__dict__[method]

    def timed(*args: Any, **kwargs: Any) -> Any:
        parts.enter(name)
        try:
            return before(*args, **kwargs)
        finally:
            parts.leave()

    setattr(owner, method, timed)
    try:
        yield
    finally:
        setattr(owner, method, before)


class Robot:
    """A robot that drives a mission's line exactly, in a building where crates come and go."""

    def __init__(self, cells: int, case: str, seed: int) -> None:
        import numpy as np

        from fasaco_edge.grid.lattice import Footprint
        from fasaco_edge.mission.config import MissionConfig, Sweeping
        from fasaco_edge.mission.core.mission import Mission
        from fasaco_edge.planners.cost import CoverageCost
        from fasaco_edge.planners.line import LINES
        from fasaco_edge.planners.search.near_optimal import NearOptimal

        plan = building(cells, seed)
        free = np.kron(plan.lattice.coverable, np.ones((CELL_PX, CELL_PX), np.bool_))
        self._truth: NDArray[np.int8] = np.pad(
            np.where(free, 0, 100).astype(np.int8), RIM_PX, constant_values=-1
        )
        row, col = (CELL_PX * (number + 0.5) + RIM_PX for number in plan.start)
        self.at = col * PIXEL_M, row * PIXEL_M
        # The points of its line, and which is the next.
        self._line, self._next = np.empty((0, 2)), 0
        self._rng = np.random.Generator(np.random.PCG64(seed))
        self._case, self._now, self._maps = case, 0.0, 0
        cell_m = TOOL_M * (1.0 - OVERLAP)
        cost = CoverageCost.for_robot(cell_m, SPEED_M_S, TURN_S)
        sweeping = Sweeping(TOOL_M, 25_000_000, LINES["thorough"])
        config = MissionConfig(Footprint(cell_m, RADIUS_M), cost=cost, sweeping=sweeping)
        self.mission: Mission = Mission(config)
        self._planner = NearOptimal()
        self.lines = hashlib.sha256()
        self._crate: tuple[slice, slice] | None = None

    def begin(self) -> float:
        """Hear the first map, and plan; return what the map took [ms]."""
        began = time.thread_time()
        self._hear([self._map()])
        first_ms = 1e3 * (time.thread_time() - began)
        self._hear([self._pose()])
        # All points find their places on the whole line.
        for _ in range(400):
            self.drive()
        return first_ms

    def drive(self) -> None:
        """Drive on for one pose."""
        import math

        left = POSE_M
        while self._next < len(self._line) and left > 0.0:
            (x, y), (u, v) = self.at, self._line[self._next].tolist()
            ahead = math.dist((x, y), (u, v))
            if ahead <= left:
                self.at, self._next = (u, v), self._next + 1
                left -= ahead
                continue
            self.at = x + left / ahead * (u - x), y + left / ahead * (v - y)
            left = 0.0
        self._now += POSE_M / SPEED_M_S
        self._hear([self._pose()])

    def move_crate(self) -> bool:
        """Put a crate near the robot, or take it away, and hear of it; return if that was it."""
        if self._crate is not None:
            self._truth[self._crate] = 0
            self._crate = None
        else:
            x, y = (place + self._rng.uniform(-NEAR_M, NEAR_M) for place in self.at)
            half = int(0.5 * CRATE_M / PIXEL_M)
            row, col = int(y / PIXEL_M), int(x / PIXEL_M)
            place = slice(row - half, row + half), slice(col - half, col + half)
            apart = max(abs(x - self.at[0]), abs(y - self.at[1]))
            if apart < CRATE_M + RADIUS_M + 0.4 or (self._truth[place] != 0).any():
                return False
            self._truth[place] = 100
            self._crate = place
        self._hear([self._map()])
        return True

    def _map(self) -> Event:
        from fasaco_edge.grid.geometry import GridGeometry, Pose2D
        from fasaco_edge.grid.occupancy import OccupancyGrid
        from fasaco_edge.mission.events import MapReceived

        rim = RIM_PX // 3 * (self._maps % 3) if self._case == GROWING else 0
        self._maps += 1
        shown = self._truth[rim:, rim:].copy()
        rows, cols = shown.shape
        geometry = GridGeometry(rows, cols, PIXEL_M, Pose2D(rim * PIXEL_M, rim * PIXEL_M))
        return MapReceived(OccupancyGrid(geometry, shown, "map", self._maps))

    def _pose(self) -> Event:
        from fasaco_edge.grid.geometry import Pose2D, StampedPose
        from fasaco_edge.mission.events import PoseReceived

        return PoseReceived(StampedPose(Pose2D(*self.at), "map"))

    def _hear(self, events: Sequence[Event]) -> None:
        from fasaco_edge.mission.events import PlanReady
        from fasaco_edge.planners.cost import SearchWork
        from fasaco_edge.planners.planner import WorkLimit

        decision = self.mission.step(events, self._now)
        limit = WorkLimit(SearchWork(proposals=PROPOSALS))
        while True:
            assert not decision.faults
            if decision.path is not None:
                assert decision.path.xy is not None
                self.lines.update(decision.path.xy.tobytes())
                self._line, self._next = decision.path.xy, 0
            if decision.plan is None:
                return
            path = self._planner.plan(decision.plan.problem, limit)
            decision = self.mission.step([PlanReady(decision.plan.number, path, 0.0)], self._now)


def measure(
    sizes: Sequence[int], cases: Sequence[str], replans: int, say: Say
) -> Generator[Replan, None, None]:
    """Yield each replan of each building and case."""
    from fasaco_edge.planners.search.near_optimal import NearOptimal

    for cells in sizes:
        for case in cases:
            say(f"{cells:,} cells, {case}")
            parts = Parts()
            robot = Robot(cells, case, 1)
            with ExitStack() as stack:
                for name, owner, method in (
                    *_timed_parts(),
                    ("repair", NearOptimal, "plan"),
                ):
                    stack.enter_context(_charged(parts, name, owner, method))
                first_ms = robot.begin()
                gc.freeze()  # as the daemon does
                lattice = robot.mission.lattice
                assert lattice is not None
                coverable = int(lattice.coverable.sum())
                done = 0
                while done < replans:
                    for _ in range(POSES):
                        robot.drive()
                    parts.take()
                    if robot.move_crate():
                        done += 1
                        digest = robot.lines.hexdigest()[:12]
                        yield Replan(cells, case, coverable, parts.take(), first_ms, digest)


# By cells: from map to line, and the repair alone, 99th percentile [ms].
GOALS = {10_000: (15.0, 4.0), 100_000: (None, 12.0)}


def _report(args: argparse.Namespace, samples: Sequence[Replan]) -> Report:
    groups: dict[str, list[Replan]] = {}
    for run in samples:
        groups.setdefault(f"{run.coverable:,} cells, {run.case}", []).append(run)
    goals, columns = [], []
    names = ("total", *sorted({name for run in samples for name in run.ms}, key=_order))
    for group, runs in groups.items():
        # The first ones may load kernels.
        counted = [{**run.ms, "total": run.total_ms} for run in runs[2:] or runs]
        times = {name: [ms.get(name, 0.0) for ms in counted] for name in names}
        columns.append({name: _middle_and_rim(times[name]) for name in names})
        columns[-1] |= {"first map": f"{runs[0].first_ms:.0f}", "lines": runs[-1].digest}
        for part, most_ms in zip(("total", "repair"), GOALS.get(runs[0].cells, ()), strict=False):
            if most_ms is not None:
                measured = percentile(times.get(part, [0.0]), 99.0)
                goals.append(MeasuredGoal(f"{group}: {part}, p99", measured, most_ms, "ms"))
    rows = (*names, "first map", "lines") if samples else ()
    return Report(
        title="replans of a line over the floor: processor time from map to line [ms]",
        header=("part", *groups),
        rows=tuple((row, *(column[row] for column in columns)) for row in rows),
        figures={"replans": [{**asdict(run), "total_ms": run.total_ms} for run in samples]},
        goals=tuple(goals),
        remarks=(
            "median and 99th percentile; first map: of the mission, taken in; patched: the map "
            "stays on its place; growing: it comes with more or less of its rim each time; lines: "
            "a digest of all lines, the same for the same decisions",
        ),
    )


def _middle_and_rim(times_ms: Sequence[float]) -> str:
    return f"{percentile(times_ms, 50.0):.2f}  {percentile(times_ms, 99.0):.2f}"


def _order(name: str) -> int:
    names = [row[0] for row in _timed_parts()]
    return names.index(name) if name in names else len(names) + (name == REST)


def _cells(text: str) -> int:
    cells = int(text)
    if cells < FEWEST_CELLS:
        raise argparse.ArgumentTypeError(f"must be at least {FEWEST_CELLS}, got {text}")
    return cells


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--cells",
        nargs="+",
        type=_cells,
        default=[10_000],
        metavar="CELLS",
        help="cells of the generated buildings (default: 10000; there are goals for 100000, too)",
    )
    parser.add_argument(
        "--cases", nargs="+", choices=CASES, default=list(CASES), help="(default: all)"
    )
    parser.add_argument(
        "--replans", type=positive, default=100, metavar="N", help="(default: %(default)s)"
    )


REPLAN = Benchmark(
    name="replan",
    summary="time of each part of a replan, on the floor of a large building",
    description="Let a robot with the map of a generated building drive its line; put a crate near "
    "it, or take it away again. Measure the processor time of each part of the mission, on one "
    "thread, from the changed map to the new line.",
    add_options=_add_options,
    count=lambda args: len(args.cells) * len(args.cases) * args.replans,
    measure=lambda args, say: measure(args.cells, args.cases, args.replans, say),
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks replan
  python -m tests.benchmarks replan --cells 100000 --cases patched --replans 40 --json
""",
)
