"""``bench jitter``: how late a control loop wakes, with and without the daemon beside it."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import time
from collections.abc import Generator, Sequence, Set
from dataclasses import dataclass
from typing import Any

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    Say,
    peak_mb,
    positive,
    seconds_above_zero,
)
from fasaco_edge.bench.processes import DaemonProcess, place, warm_kernels, weighed
from fasaco_edge.bench.robot import CoveringRobot, robot_beside
from fasaco_edge.drawing.spread import percentile
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.host.processes import cpu_seconds, python_program

# Niceness in the daemon's unit.
NICENESS, WEIGHT = 10, 20
HZ = 100
# Time until a resumed daemon is at work again [s].
SETTLE_S = 0.5
# A daemon that is held longer loses its sessions: Zenoh's lease is ten seconds.
LONGEST_BLOCK_S = 6.0
PERCENTS = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
ANY_CORE, ONE_CORE = "on all cores", "on one core"
PLACES = (ANY_CORE, ONE_CORE)


@dataclass(frozen=True, slots=True)
class Block:
    """Some seconds of the control loop.

    Attributes:
        place: one of ``PLACES``.
        covering: whether the daemon was at work; else it was held.
        late_us: how late each tick began [µs].
        share: the daemon's share of a core meanwhile.
        paths: how many paths it published meanwhile.
        group: the control group the daemon was in; "" for none.
    """

    place: str
    covering: bool
    late_us: tuple[int, ...]
    share: float
    paths: int
    group: str


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--rounds",
        type=positive,
        default=6,
        help="blocks with and without the daemon, alternating, each (default: %(default)s)",
    )
    parser.add_argument(
        "--block",
        type=_block,
        default=5.0,
        metavar="S",
        help=f"length of a block [s], at most {LONGEST_BLOCK_S:g} (default: %(default)g)",
    )

    parser.add_argument(
        "--spare-share",
        type=float,
        metavar="X",
        help="share of a core that goes into better paths; 1: the daemon plans all the time "
        "(default: that of planner.spare_share)",
    )


def _block(text: str) -> float:
    length = seconds_above_zero(text)
    if length > LONGEST_BLOCK_S:
        raise argparse.ArgumentTypeError(f"must be at most {LONGEST_BLOCK_S:g} s, got {text}")
    return length


def _measure(args: argparse.Namespace, say: Say) -> Generator[Block, None, None]:
    say("warming the kernels' cache")
    warm_kernels()
    all_cores = os.sched_getaffinity(0)
    one_core = {min(all_cores)}
    given = {} if args.spare_share is None else {"spare_share": args.spare_share}
    with DaemonProcess({"planner": given}) as daemon:
        say("first path")
        # The weight is set only after the first path, which would come too late on a busy computer.
        with robot_beside(daemon, daemon.join()) as robot, weighed(daemon.pid, WEIGHT) as group:
            try:
                for name in PLACES:
                    cores = all_cores if name == ANY_CORE else one_core
                    place(daemon.pid, cores, NICENESS)
                    # The robot's own program must not affect the result: it runs on other cores if
                    # possible.
                    os.sched_setaffinity(0, all_cores - cores or all_cores)
                    for number in range(2 * args.rounds):
                        covering = number % 2 == 1
                        say(f"{name}, {'covering' if covering else 'without'}")
                        yield _run(daemon, robot, args.block, name, cores, covering, group)
            finally:
                os.kill(daemon.pid, signal.SIGCONT)
                os.sched_setaffinity(0, all_cores)


def _run(
    daemon: DaemonProcess,
    robot: CoveringRobot,
    length_s: float,
    name: str,
    cores: Set[int],
    covering: bool,
    group: str,
) -> Block:
    # The daemon is held and not ended, so that the rest of the computer is the same in both blocks.
    os.kill(daemon.pid, signal.SIGCONT if covering else signal.SIGSTOP)
    time.sleep(SETTLE_S)
    paths, began_s = robot.paths, (time.monotonic(), cpu_seconds(daemon.pid))
    late_us = _control_loop(length_s, cores)
    elapsed_s, cpu_s = time.monotonic() - began_s[0], cpu_seconds(daemon.pid) - began_s[1]
    os.kill(daemon.pid, signal.SIGCONT)
    daemon.check()
    return Block(name, covering, late_us, cpu_s / elapsed_s, robot.paths - paths, group)


def _control_loop(length_s: float, cores: Set[int]) -> tuple[int, ...]:
    """Run a control loop in a process of its own; return how late each tick began [µs]."""
    words = python_program("fasaco_edge.bench.control_loop", str(HZ), str(length_s))
    taskset = ["taskset", "--cpu-list", ",".join(map(str, sorted(cores)))]
    done = subprocess.run([*taskset, *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise ProcessEnded(f"the control loop ended with {done.returncode}:\n{done.stderr}")
    return tuple(map(int, done.stdout.split()))


def _report(args: argparse.Namespace, blocks: Sequence[Block]) -> Report:
    rows, cases = [], []
    for name in PLACES:
        for covering in (False, True):
            of_case = [b for b in blocks if (b.place, b.covering) == (name, covering)]
            late_us = [late for block in of_case for late in block.late_us]
            figures = {key: percentile(late_us, percent) for key, percent in PERCENTS.items()}
            share = sum(b.share for b in of_case) / len(of_case) if of_case else None
            case: dict[str, Any] = {
                "place": name,
                "covering": covering,
                "ticks": len(late_us),
                "late_us": figures,
                "daemon_share": None if share is None else round(share, 4),
                "paths": sum(block.paths for block in of_case),
            }
            cases.append(case)
            rows.append(
                (
                    f"{name}, {'covering' if covering else 'without'}",
                    str(len(late_us)),
                    *("-" if value is None else f"{value:.0f}" for value in figures.values()),
                    "-" if share is None else f"{100 * share:.1f} %",
                )
            )
    group = blocks[0].group if blocks else ""
    return Report(
        title=f"how late a control loop of {HZ} Hz wakes [µs]",
        header=("", "ticks", "p50", "p99", "p99.9", "max", "daemon"),
        rows=tuple(rows),
        figures={
            "hz": HZ,
            "block_s": args.block,
            "rounds": args.rounds,
            "spare_share": args.spare_share,
            "niceness": NICENESS,
            "control_group": group or None,
            "cases": cases,
        },
        remarks=(
            f"the daemon: nice {NICENESS}, {group or 'no control group of its own here'}; its "
            "share is of one core",
            f"paths it published meanwhile: {sum(block.paths for block in blocks)}",
            f"peak memory of this process {peak_mb()} MB",
        ),
    )


JITTER = Benchmark(
    name="jitter",
    summary="a robot's control loop of 100 Hz, with and without a covering daemon beside it",
    description="Run a control loop of 100 Hz at normal priority, in a process of its own, and "
    "measure how late it wakes. Beside it a real daemon covers a building of 50 m x 50 m where a "
    "crate moves each second, with the unit's niceness and, where that may be, its CPU weight; in "
    "every other block the daemon is held. First both may run on all cores, then both are pinned "
    "to one: the worst case. Other load on the machine affects both columns.",
    add_options=_add_options,
    count=lambda args: 2 * len(PLACES) * int(args.rounds),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  fasaco-edge bench jitter
  fasaco-edge bench jitter --rounds 24 --json
  fasaco-edge bench jitter --spare-share 1
""",
)
