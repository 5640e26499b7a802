"""``bench latency``: from a map on the bus to the path that answers it."""

from __future__ import annotations

import argparse
import time
from collections.abc import Generator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any

from fasaco_edge.bench.benchmark import Benchmark, Goal, Report, Say, peak_mb, positive, seconds
from fasaco_edge.bench.processes import DaemonProcess, recorder_beside, warm_kernels
from fasaco_edge.bench.robot import MapSource, building, robot_pose, with_crate
from fasaco_edge.drawing.spread import percentile
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.host.processes import peak_mb as peak_mb_of

GOAL_REST_P99_MS = 20.0
GOAL_RECORDER_RATIO = 1.05
# Rounds with and without a recorder, alternating: the number of each.
ROUNDS = 4
# The first paths are not counted: they include loading of kernels, and the first plan.
WARM_UP_MAPS = 5
PARTS = (
    ("total", "map put to path received"),
    ("plan", "planning"),
    ("rest", "all but planning"),
)


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """One map and its path.

    Attributes:
        total_ms: from the put of the map to the path's arrival [ms].
        plan_ms: the part of it that was planning, as reported by the daemon [ms].
        steps: steps of the path.
        daemon_peak_mb: peak resident memory of the daemon until then [MB].
        recorded: whether a recorder listened.
    """

    total_ms: float
    plan_ms: float
    steps: int
    daemon_peak_mb: float
    recorded: bool = False

    @property
    def rest_ms(self) -> float:
        """Time outside planning: transport, decoding, lattice, decisions, encoding [ms]."""
        return self.total_ms - self.plan_ms


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--samples", type=positive, default=200, help="maps to publish (default: %(default)s)"
    )
    parser.add_argument(
        "--ants", type=positive, default=8, help="ants per plan (default: %(default)s)"
    )
    parser.add_argument(
        "--pause",
        type=seconds,
        default=0.05,
        metavar="S",
        help="pause between a path and the next map [s] (default: %(default)g)",
    )
    parser.add_argument(
        "--recorder",
        action="store_true",
        help=f"repeat with a recorder beside the daemon, alternating in {ROUNDS} rounds, and "
        "compare",
    )


def _measure(args: argparse.Namespace, say: Say) -> Generator[RoundTrip, None, None]:
    say("warming the kernels' cache")
    warm_kernels()
    with DaemonProcess({"planner": {"ants": args.ants}}) as daemon:
        say("first path")
        bus = daemon.join()
        source = MapSource(daemon, bus)
        source.put_pose(robot_pose(time.time_ns()))
        grid = building()
        for number in range(WARM_UP_MAPS):
            _round_trip(daemon, source, grid, number)
            time.sleep(args.pause)
        number = WARM_UP_MAPS
        for recorded, samples in _turns(args):
            with recorder_beside(daemon, bus) if recorded else nullcontext():
                say("maps, recorded" if recorded else "maps")
                for _ in range(samples):
                    yield replace(_round_trip(daemon, source, grid, number), recorded=recorded)
                    time.sleep(args.pause)
                    number += 1


def _turns(args: argparse.Namespace) -> list[tuple[bool, int]]:
    """Return for each round whether it is recorded, and its number of maps."""
    if not args.recorder:
        return [(False, args.samples)]
    # Alternating, so that other load on the machine affects both.
    rounds = min(ROUNDS, args.samples)
    shares = [args.samples // rounds + (turn < args.samples % rounds) for turn in range(rounds)]
    return [(recorded, share) for share in shares for recorded in (False, True)]


def _round_trip(
    daemon: DaemonProcess, source: MapSource, grid: OccupancyGrid, number: int
) -> RoundTrip:
    stamp_ns = time.time_ns()
    put_at = source.put_map(with_crate(grid, number, stamp_ns))
    arrival = source.wait_path(stamp_ns)
    return RoundTrip(
        total_ms=1e3 * (arrival.at - put_at),
        plan_ms=arrival.about.plan_ms,
        steps=arrival.about.steps,
        daemon_peak_mb=peak_mb_of(daemon.pid),
    )


def _report(args: argparse.Namespace, all_trips: Sequence[RoundTrip]) -> Report:
    trips = [trip for trip in all_trips if not trip.recorded]
    beside = _part([trip.total_ms for trip in all_trips if trip.recorded])
    parts = {name: _part([getattr(trip, f"{name}_ms") for trip in trips]) for name, _ in PARTS}
    rows = [(label, *(_ms(value) for value in parts[name].values())) for name, label in PARTS]
    goals = [Goal("p99 of all but planning", parts["rest"]["p99"], GOAL_REST_P99_MS, "ms")]
    ratio = None
    if args.recorder:
        rows.append(("total beside a recorder", *(_ms(value) for value in beside.values())))
        alone, slow = parts["total"]["p99"], beside["p99"]
        ratio = round(slow / alone, 3) if slow is not None and alone else None
        goals.append(Goal("p99 beside a recorder to p99 alone", ratio, GOAL_RECORDER_RATIO))
    daemon_mb = trips[-1].daemon_peak_mb if trips else None
    of_daemon = f"the daemon {daemon_mb} MB, of " if trips else ""
    return Report(
        title=f"from map to path, {len(trips)} maps of 1000 x 1000 pixels [ms]",
        header=("", "p50", "p99", "min", "max"),
        rows=tuple(rows),
        figures={
            "samples": len(trips),
            "ants": args.ants,
            "steps": trips[-1].steps if trips else None,
            **{f"{name}_ms": part for name, part in parts.items()},
            "recorded_total_ms": beside if args.recorder else None,
            "recorder_ratio": ratio,
            "daemon_peak_rss_mb": daemon_mb,
        },
        goals=tuple(goals),
        remarks=(f"peak memory of {of_daemon}this process {peak_mb()} MB",),
    )


def _part(values: Sequence[float]) -> dict[str, float | None]:
    percents = {"p50": 50.0, "p99": 99.0, "min": 0.0, "max": 100.0}
    part: dict[str, Any] = {name: percentile(values, at) for name, at in percents.items()}
    return {name: None if value is None else round(value, 3) for name, value in part.items()}


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


LATENCY = Benchmark(
    name="latency",
    summary="from a map on the bus to its path, without the planning",
    description="Start a real daemon, publish a map of 1000 x 1000 pixels (50 m x 50 m) and a "
    "pose; then maps in which a crate moves in the farthest hall, each of which needs a new "
    "path. Time each from its put to the arrival of its path; the planning time, as the daemon "
    "reports it, is listed apart. The planner has few ants, so that it does not hide the rest.",
    add_options=_add_options,
    count=lambda args: int(args.samples) * (2 if args.recorder else 1),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  fasaco-edge bench latency
  fasaco-edge bench latency --samples 1000 --json
  fasaco-edge bench latency --recorder
""",
)
