"""``bench footprint``: a daemon's time to start, its memory, and its load when idle."""

from __future__ import annotations

import argparse
import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Goal,
    Report,
    Say,
    peak_mb,
    positive,
    seconds,
    seconds_above_zero,
)
from fasaco_edge.bench.processes import DaemonProcess, warm_kernels
from fasaco_edge.bench.robot import MapSource, building, robot_beside, robot_pose, with_crate
from fasaco_edge.drawing.spread import Spread, document, median, text
from fasaco_edge.host.processes import cpu_seconds, has_loaded, own_mb, resident_mb
from fasaco_edge.host.processes import peak_mb as peak_mb_of

MEASURES = (
    ("ready_s", "exec to liveliness token [s]", 3),
    ("status_s", "exec to first status [s]", 3),
    ("idle_mb", "memory before the first map [MB]", 1),
    ("idle_own_mb", "of this without pages of files [MB]", 1),
    ("idle_percent", "share of a core before the first map [%]", 2),
    ("warm_mb", "memory after map and plan [MB]", 1),
    ("warm_own_mb", "of this without pages of files [MB]", 1),
    ("mission_percent", "share of a core in a mission [%]", 2),
    ("peak_mb", "peak memory [MB]", 1),
)
# For each goal its measure, its text, the limit of its median, the unit.
GOALS = (
    ("ready_s", "ready", 1.5, "s"),
    ("idle_own_mb", "memory before the first map, without pages of files", 32.0, "MB"),
    ("idle_percent", "share of a core, idle", 0.5, "%"),
    ("warm_own_mb", "memory after map and plan, without pages of files", 135.0, "MB"),
    ("mission_percent", "share of a core in a mission", 2.0, "%"),
)
# In a mission maps come twice a second, and one in this many shows a change.
MAP_EVERY_S, MAPS_A_CHANGE = 0.5, 20
# The compiler and the recorder's library: loaded if a process has mapped their files.
PACKAGES = {"numba": ("numba", "llvmlite"), "rerun": ("rerun_sdk", "rerun_bindings")}


@dataclass(frozen=True, slots=True)
class DaemonStart:
    """One daemon's life.

    Attributes:
        ready_s: from exec to its liveliness token [s].
        status_s: from exec to the first status answered [s].
        idle_mb: resident before the first map [MB].
        idle_own_mb: of that without pages of files, as those of libraries [MB].
        idle_percent: share of a core that it took until then [%].
        warm_mb: resident after a map and a plan [MB].
        warm_own_mb: of that without pages of files [MB].
        mission_percent: share of a core that it takes while a robot drives its path and sends ten
            poses and two maps a second [%].
        peak_mb: its peak resident memory [MB].
        idle, warm: which of ``PACKAGES`` were loaded at these two points.
    """

    ready_s: float
    status_s: float
    idle_mb: float
    idle_own_mb: float
    idle_percent: float
    warm_mb: float
    warm_own_mb: float
    mission_percent: float
    peak_mb: float
    idle: frozenset[str]
    warm: frozenset[str]


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--starts", type=positive, default=5, help="daemons to start (default: %(default)s)"
    )
    parser.add_argument(
        "--settle",
        type=seconds,
        default=1.0,
        metavar="S",
        help="wait before memory is read [s] (default: %(default)g)",
    )
    parser.add_argument(
        "--idle",
        type=seconds_above_zero,
        default=5.0,
        metavar="S",
        help="how long a daemon without a map is measured [s] (default: %(default)g)",
    )
    parser.add_argument(
        "--mission",
        type=seconds_above_zero,
        default=20.0,
        metavar="S",
        help="how long a daemon in a mission is measured [s] (default: %(default)g)",
    )
    parser.add_argument(
        "--ants", type=positive, default=200, help="ants of the plan (default: %(default)s)"
    )


def _measure(args: argparse.Namespace, say: Say) -> Generator[DaemonStart, None, None]:
    say("warming the kernels' cache")
    warm_kernels()
    for number in range(1, args.starts + 1):
        say(f"daemon {number}")
        yield _start(args)


def _start(args: argparse.Namespace) -> DaemonStart:
    with DaemonProcess({"planner": {"ants": args.ants}}) as daemon:
        bus = daemon.join()
        ready_s = daemon.wait_alive(bus)
        status_s = daemon.wait_status(bus)
        source = MapSource(daemon, bus)
        time.sleep(args.settle)
        idle_mb, idle_own_mb = resident_mb(daemon.pid), own_mb(daemon.pid)
        idle = _loaded(daemon.pid)
        share = _share_of_core(daemon.pid, args.idle)
        stamp_ns = time.time_ns()
        source.put_pose(robot_pose(stamp_ns))
        source.put_map(with_crate(building(), 0, stamp_ns))
        source.wait_path(stamp_ns)
        time.sleep(args.settle)
        warm_mb, warm_own_mb, warm = (
            resident_mb(daemon.pid),
            own_mb(daemon.pid),
            _loaded(daemon.pid),
        )
        with robot_beside(
            daemon, bus, map_every_s=MAP_EVERY_S, maps_a_crate=MAPS_A_CHANGE, source=source
        ):
            mission = _share_of_core(daemon.pid, args.mission)
        return DaemonStart(
            ready_s=ready_s,
            status_s=status_s,
            idle_mb=idle_mb,
            idle_own_mb=idle_own_mb,
            idle_percent=100.0 * share,
            warm_mb=warm_mb,
            warm_own_mb=warm_own_mb,
            mission_percent=100.0 * mission,
            peak_mb=peak_mb_of(daemon.pid),
            idle=idle,
            warm=warm,
        )


def _share_of_core(pid: int, for_s: float) -> float:
    """Return the share of a core that a process takes for some time."""
    began_s, cpu_s = time.monotonic(), cpu_seconds(pid)
    time.sleep(for_s)
    return (cpu_seconds(pid) - cpu_s) / (time.monotonic() - began_s)


def _loaded(pid: int) -> frozenset[str]:
    return frozenset(
        package for package, names in PACKAGES.items() if any(has_loaded(pid, n) for n in names)
    )


def _report(args: argparse.Namespace, starts: Sequence[DaemonStart]) -> Report:
    spreads = {
        name: Spread.of([getattr(start, name) for start in starts]) for name, _, _ in MEASURES
    }
    loaded = {
        point: {
            package: any(package in getattr(start, point) for start in starts)
            for package in PACKAGES
        }
        for point in ("idle", "warm")
    }
    rows = [(label, *text(spreads[name], digits)) for name, label, digits in MEASURES]
    if starts:
        for package in PACKAGES:
            idle, warm = ("yes" if at[package] else "no" for at in loaded.values())
            rows.append((f"{package} loaded", f"idle: {idle}", f"warm: {warm}"))
    recorders = float(any(at["rerun"] for at in loaded.values())) if starts else None
    return Report(
        title=f"a daemon's start and memory, {len(starts)} starts",
        header=("", "median", "range"),
        rows=tuple(rows),
        figures={
            "starts": len(starts),
            **{name: document(spread) for name, spread in spreads.items()},
            "loaded": loaded if starts else None,
        },
        goals=(
            *(Goal(what, median(spreads[name]), most, unit) for name, what, most, unit in GOALS),
            Goal("rerun loaded (0 = never)", recorders, 0.0),
        ),
        remarks=(
            "the map is 1000 x 1000 pixels of 0.05 m; kernels come from a warm cache",
            f"peak memory of this process {peak_mb()} MB",
        ),
    )


FOOTPRINT = Benchmark(
    name="footprint",
    summary="a daemon's time to start, its memory, idle and planning, and how idle it is",
    description="Start a real daemon on a free port of loopback several times; time it from exec "
    "to its liveliness token and to the first status it answers with; read its resident memory "
    "and its share of a core before the first map, and its memory after one map of 1000 x 1000 "
    "pixels and its plan; look at what it has loaded at both points. Then let a robot drive, which "
    "sends ten poses and two maps a second, one in twenty with something changed: its share of a "
    "core in a mission.",
    add_options=_add_options,
    count=lambda args: int(args.starts),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  fasaco-edge bench footprint
  fasaco-edge bench footprint --starts 20 --json
""",
)
