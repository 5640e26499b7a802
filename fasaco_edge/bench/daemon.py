"""``bench daemon``: a daemon's start-up time, memory, load, and delay from a map to its path."""

from __future__ import annotations

import argparse
import time
from collections.abc import Generator, Sequence

from fasaco_edge.bench.benchmark import (
    Benchmark,
    MeasuredGoal,
    Report,
    Say,
    positive,
    seconds_above_zero,
)
from fasaco_edge.bench.processes import (
    DaemonProcess,
    MapSource,
    building,
    robot_pose,
    warm_kernels,
    with_crate,
)
from fasaco_edge.bench.spread import Spread, document, median, percentile, text
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.host.processes import cpu_seconds, own_mb, peak_mb, resident_mb

# Measured values of a daemon, each with its label and number of decimals.
MEASURES = (
    ("ready_s", "exec to liveliness token [s]", 3),
    ("status_s", "exec to first status [s]", 3),
    ("idle_mb", "memory before the first map [MB]", 1),
    ("idle_own_mb", "own part of it, without files mapped into memory [MB]", 1),
    ("idle_percent", "share of a core before the first map [%]", 2),
    ("warm_mb", "memory after map and plan [MB]", 1),
    ("warm_own_mb", "own part of it, without files mapped into memory [MB]", 1),
    ("peak_mb", "peak memory [MB]", 1),
)
# Goals: measured value, label, limit of its median, unit.
GOALS = (
    ("ready_s", "ready", 1.5, "s"),
    ("idle_own_mb", "memory before the first map, without pages of files", 32.0, "MB"),
    ("idle_percent", "share of a core, idle", 0.5, "%"),
    ("warm_own_mb", "memory after map and plan, without pages of files", 135.0, "MB"),
)
# Delays from the put of a map to the arrival of its path; the path states the time of planning.
DELAYS = (
    ("total_ms", "map put to path received [ms]"),
    ("plan_ms", "planning [ms]"),
    ("rest_ms", "without planning [ms]"),
)
GOAL_REST_P99_MS = 20.0
# Time from the last change to a reading of memory [s].
SETTLE_S = 1.0
# Number of first maps whose delays do not count: they include loading kernels, and the first plan.
WARM_UP_MAPS = 5
PAUSE_S = 0.05


# ``MEASURES`` of one daemon; for each map the delay to its path, and the part of planning [ms].
DaemonRun = tuple[dict[str, float], list[tuple[float, float]]]


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--starts",
        type=positive,
        default=5,
        help="number of daemons to start (default: %(default)s)",
    )
    parser.add_argument(
        "--maps", type=positive, default=40, help="maps for each daemon (default: %(default)s)"
    )
    parser.add_argument(
        "--load",
        type=seconds_above_zero,
        default=5.0,
        metavar="S",
        help="time over which the load without a map is measured [s] (default: %(default)g)",
    )


def _measure(args: argparse.Namespace, say: Say) -> Generator[DaemonRun, None, None]:
    say("warming the kernels' cache")
    warm_kernels()
    for number in range(1, args.starts + 1):
        say(f"daemon {number}")
        yield _run(args)


def _run(args: argparse.Namespace) -> DaemonRun:
    grid = building()
    with DaemonProcess() as daemon:
        pid, bus = daemon.pid, daemon.join()
        found = {"ready_s": daemon.wait_alive(bus), "status_s": daemon.wait_status(bus)}
        source = MapSource(daemon, bus)
        time.sleep(SETTLE_S)
        found |= {"idle_mb": resident_mb(pid), "idle_own_mb": own_mb(pid)}
        found["idle_percent"] = 100.0 * _share_of_core(pid, args.load)
        source.put_pose(robot_pose(time.time_ns()))
        _delay_ms(source, grid, 0)
        time.sleep(SETTLE_S)
        found |= {"warm_mb": resident_mb(pid), "warm_own_mb": own_mb(pid)}
        delays_ms = []
        for crate in range(1, WARM_UP_MAPS + args.maps):
            delays_ms.append(_delay_ms(source, grid, crate))
            time.sleep(PAUSE_S)
        return found | {"peak_mb": peak_mb(pid)}, delays_ms[WARM_UP_MAPS - 1 :]


def _delay_ms(source: MapSource, grid: OccupancyGrid, crate: int) -> tuple[float, float]:
    """Return the delay from a map with a crate to its path, and the time of planning [ms]."""
    stamp_ns = time.time_ns()
    put_at = source.put_map(with_crate(grid, crate, stamp_ns))
    at, plan_ms = source.wait_path(stamp_ns)
    return 1e3 * (at - put_at), plan_ms


def _share_of_core(pid: int, for_s: float) -> float:
    """Return the share of a core that a process uses, over ``for_s`` [s]."""
    began_s, cpu_s = time.monotonic(), cpu_seconds(pid)
    time.sleep(for_s)
    return (cpu_seconds(pid) - cpu_s) / (time.monotonic() - began_s)


def _report(args: argparse.Namespace, runs: Sequence[DaemonRun]) -> Report:
    spreads = {name: Spread.of([found[name] for found, _ in runs]) for name, _, _ in MEASURES}
    pairs = [pair for _, delays_ms in runs for pair in delays_ms]
    values = {
        "total_ms": [total for total, _ in pairs],
        "plan_ms": [plan for _, plan in pairs],
        "rest_ms": [total - plan for total, plan in pairs],
    }
    delays = {name: _percentiles(some) for name, some in values.items()}
    return Report(
        title=f"{len(runs)} daemons, {len(pairs)} maps of 1000 x 1000 pixels",
        header=("", "median", "range"),
        rows=(
            *((label, *text(spreads[name], digits)) for name, label, digits in MEASURES),
            *((label, *_delay_words(delays[name])) for name, label in DELAYS),
        ),
        figures={
            "starts": len(runs),
            "maps": len(pairs),
            **{name: document(spread) for name, spread in spreads.items()},
            **delays,
        },
        goals=(
            *(
                MeasuredGoal(what, median(spreads[name]), most, unit)
                for name, what, most, unit in GOALS
            ),
            MeasuredGoal("p99 without planning", delays["rest_ms"]["p99"], GOAL_REST_P99_MS, "ms"),
        ),
        remarks=("kernels come from a warm cache", f"peak memory of this process {peak_mb()} MB"),
    )


def _percentiles(values: Sequence[float]) -> dict[str, float | None]:
    percents = {"p50": 50.0, "p99": 99.0, "min": 0.0, "max": 100.0}
    found = {name: percentile(values, percent) for name, percent in percents.items()}
    return {name: None if value is None else round(value, 3) for name, value in found.items()}


def _delay_words(delay: dict[str, float | None]) -> tuple[str, str]:
    if delay["p50"] is None:
        return "-", "-"
    return (
        f"{delay['p50']:.1f}",
        f"{delay['min']:.1f} .. {delay['max']:.1f}, p99 {delay['p99']:.1f}",
    )


DAEMON = Benchmark(
    name="daemon",
    summary="a daemon's start, memory, load, and delay from a map to its path",
    description="Start a real daemon on a free port of loopback several times. Time it from exec "
    "to its liveliness token and to its first status; read its memory and its share of a core "
    "before the first map, and its memory after one map of 1000 x 1000 pixels (50 m x 50 m) and "
    "its plan. Then a crate moves in the farthest hall, so that each map needs a new path: measure "
    "the delay from the put of a map to the arrival of its path.",
    add_options=_add_options,
    count=lambda args: int(args.starts),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  fasaco-edge bench daemon
  fasaco-edge bench daemon --starts 20 --json
""",
)
