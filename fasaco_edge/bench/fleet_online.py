"""``bench fleet --online``: fleets of real daemons in a building that none of them knows.

Each run is the command ``demo``: daemons, simulated robots and the fleet's recorder, processes of
their own that meet at a router. What it measures is the review of that recording.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from collections.abc import Generator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fasaco_edge.bench.benchmark import Goal, Report, Say, positive, seconds_above_zero
from fasaco_edge.bench.processes import PROGRAM, warm_kernels
from fasaco_edge.errors import ProcessEnded

# What a fleet is to reach: its time against one robot's, floor swept again, messages of a robot.
TIME_GOALS, AGAIN_GOAL, KB_S_GOAL = {2: 0.56, 4: 0.31, 8: 0.19}, 0.03, 20.0
SPEED, RADIUS_M, TIMEOUT_S = 5.0, 0.18, 1_800.0
HEADER = (
    "building", "robots", "time s", "of one's", "swept", "again", "through", "waited s", "kB/s",
    "plan p99",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class OnlineRun:
    """A mission of a fleet.

    Attributes:
        building, robots: the question.
        complete: whether all was covered.
        makespan_s: from when the first robot works until the last is done, in simulated time [s].
        time_ratio: that against one robot's; null without one.
        swept_share: share of the reachable floor that is swept.
        again, through: share of the swept cells that a second robot swept again, drove through.
        waited_s: by all robots, real time [s].
        kb_s, peak_kb_s: messages to the fleet of the robot that sends most, over all and over 5 s.
        plan_ms_p50, plan_ms_p99: time of a plan, of all robots' [ms].
        killed: name of the robot that was killed; "" for none.
    """

    building: str
    robots: int
    complete: bool
    makespan_s: float
    time_ratio: float | None
    swept_share: float
    again: float
    through: float
    waited_s: float
    kb_s: float
    peak_kb_s: float
    plan_ms_p50: float | None
    plan_ms_p99: float | None
    killed: str


def add_online_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of missions."""
    online = parser.add_argument_group("online: real daemons, over a router")
    online.add_argument(
        "--online", action="store_true",
        help="missions in place of plans: nobody knows the building at first",
    )  # fmt: skip
    online.add_argument(
        "--speed", type=seconds_above_zero, default=SPEED, metavar="X",
        help="simulated seconds a second; robots tell each other of themselves once a real second "
        "(default: %(default)g)",
    )  # fmt: skip
    online.add_argument("--repeats", type=positive, default=1, metavar="N", help="(default: 1)")
    online.add_argument(
        "--robot-radius", type=seconds_above_zero, default=RADIUS_M, metavar="M",
        help="[m] (default: %(default)g)",
    )  # fmt: skip
    for name in ("kill", "split"):
        online.add_argument(
            f"--{name}-after", type=float, metavar="S", help=f"as of `demo --{name}-after`"
        )


def measure_online(
    args: argparse.Namespace, maps: Sequence[str], say: Say
) -> Generator[OnlineRun, None, None]:
    """Let fleets cover buildings, one mission at a time."""
    warm_kernels()
    for name in maps:
        alone_s: float | None = None
        for robots in sorted(args.robots):
            for number in range(args.repeats):
                say(f"{name}, {robots} robots, {number + 1} of {args.repeats}")
                run = _mission(args, name, robots, alone_s, number)
                yield run
                if robots == 1 and alone_s is None:
                    alone_s = run.makespan_s


def _mission(
    args: argparse.Namespace, name: str, robots: int, alone_s: float | None, number: int
) -> OnlineRun:
    with tempfile.TemporaryDirectory(prefix="fasaco-fleet-") as folder:
        words = ["demo", "--map", name, "--robots", str(robots), "--speed", str(args.speed)]
        words += ["--seed", str(args.seed + number), "--record", "fleet", "--json"]
        words += ["--robot-radius", str(args.robot_radius)]
        words += ["--out", folder, "--timeout", str(TIMEOUT_S)]
        for mishap in ("kill_after", "split_after"):
            if robots > 1 and getattr(args, mishap) is not None:
                words += [f"--{mishap.replace('_', '-')}", str(getattr(args, mishap))]
        told = _command(words)
        reviewed: dict[str, Any] = {"robots": []}
        if files := told["fleet_recording"]:
            reviewed = _command(["review", *files, "--json"])
    each, swept_m2 = reviewed["robots"], max(reviewed.get("swept_m2", 0.0), 1e-9)
    return OnlineRun(
        building=Path(name).stem,
        robots=robots,
        complete=told["complete"],
        makespan_s=told["makespan_s"],
        time_ratio=round(told["makespan_s"] / alone_s, 4) if alone_s else None,
        swept_share=round(told["swept_m2"] / told["reachable_m2"], 4),
        again=reviewed.get("again_share", 0.0),
        through=round(reviewed.get("through_m2", 0.0) / swept_m2, 4),
        waited_s=reviewed.get("waited_s", 0.0),
        kb_s=max((robot["kb_s"] for robot in each), default=0.0),
        peak_kb_s=max((robot["peak_kb_s"] for robot in each), default=0.0),
        plan_ms_p50=told["plan_ms_p50"],
        plan_ms_p99=told["plan_ms_p99"],
        killed=told["killed"],
    )


def _command(words: Sequence[str]) -> dict[str, Any]:
    """Run a command of this program; return the document that it prints.

    Raises:
        ProcessEnded: it printed none.
    """
    ended = subprocess.run([*PROGRAM, *words], check=False, capture_output=True, text=True)
    try:
        document: dict[str, Any] = json.loads(ended.stdout)
    except ValueError as error:
        last = "\n".join(ended.stderr.splitlines()[-5:])
        raise ProcessEnded(f"{words[0]} ended with {ended.returncode}:\n{last}") from error
    return document


def report_online(args: argparse.Namespace, runs: Sequence[OnlineRun]) -> Report:
    """Return the table and goals of missions."""
    goals = []
    for run in runs:
        if run.robots == 1:
            continue
        what = f"{run.building}, {run.robots} robots"
        if run.robots in TIME_GOALS and run.time_ratio is not None and not run.killed:
            goals.append(Goal(f"{what}: time", run.time_ratio, TIME_GOALS[run.robots]))
        goals.append(Goal(f"{what}: swept again", run.again, AGAIN_GOAL))
        goals.append(Goal(f"{what}: messages", run.kb_s, KB_S_GOAL, "kB/s"))
    return Report(
        title=f"fleets in unknown buildings, {args.speed:g} simulated seconds a second",
        header=HEADER,
        rows=tuple(
            (
                run.building + ("" if run.complete else " (not all)"),
                str(run.robots) + (f" - {run.killed}" if run.killed else ""),
                f"{run.makespan_s:.0f}",
                "-" if run.time_ratio is None else f"{run.time_ratio:.3f}",
                f"{run.swept_share:.1%}",
                f"{run.again:.1%}",
                f"{run.through:.1%}",
                f"{run.waited_s:.0f}",
                f"{run.kb_s:.1f} ({run.peak_kb_s:.1f})",
                "-" if run.plan_ms_p99 is None else f"{run.plan_ms_p99:.0f} ms",
            )
            for run in runs
        ),
        figures={"speed": args.speed, "runs": [asdict(run) for run in runs]},
        goals=tuple(goals),
        remarks=(
            "time: simulated, from the first robot's start to the last one's end. again, through: "
            "of the swept cells, those that a second robot swept again, or only drove through. "
            "kB/s: of the robot that tells most (most over 5 s). All processes share this "
            "computer: more robots than it has cores plan and hear late.",
        ),
    )
