"""``fasaco-edge replay``: a replay of a recorded mission, with a comparison of its decisions."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.table import Table

from fasaco_edge import __version__
from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import Exit, Subcommand
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.config.loading import load_config
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.replay.cycle_replay import CycleReplay, Difference, read_turns
from fasaco_edge.replay.replay import PROPOSALS, Replay, read_run
from fasaco_edge.wire.documents.path_documents import PlanFigures, digest
from fasaco_edge.wire.reasons import plain

if TYPE_CHECKING:
    from fasaco_edge.mission.events import PathUpdate
    from fasaco_edge.recording.read.run import RecordedSamples
    from fasaco_edge.replay.cycle_replay import CycleRecord
    from fasaco_edge.replay.mission_drive import ReplayStep
    from fasaco_edge.replay.replay import RecordedRun

DESCRIPTION = """\
Run the mission again on the samples of a recording, by the code of the daemon, and report its
decisions. A recording with a turn log is replayed cycle by cycle, and each decision is compared
with the recorded one, bit for bit; the first difference ends the replay, with exit code 1. A
recording without a turn log is replayed approximately: time is that of the samples, and planning
has a limit on its work. The same files give the same decisions on any machine.
"""
EPILOG = """\
Times are the robot's, since the recording began, as in its review. The column `recorded` shows
whether the path equals the recorded one, cell by cell; without a turn log paths are not compared.
With --config or --work the replay is approximate, too, as it is another mission. Plans of a user's
own planner, which earlier releases allowed in missions, cannot be repeated.
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recordings",
        nargs="+",
        type=Path,
        metavar="FILE.rrd",
        help="the parts of a recording, in any order",
    )
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="YAML configuration in place of the recorded one",
    )
    parser.add_argument(
        "--work",
        type=_count,
        metavar="N",
        help=f"number of proposals for each plan, without a turn log (default: {PROPOSALS})",
    )
    parser.add_argument("--json", action="store_true", help="print a JSON document")


def run(args: argparse.Namespace) -> int:
    """Replay the recording, and print decisions and comparison."""
    from fasaco_edge.recording.read.run import RecordedSamples, read_clock

    samples = RecordedSamples(args.recordings)
    recorded, robots_clock = read_run(samples), read_clock(args.recordings)
    config = load_config(args.config) if args.config else recorded.daemon_config()
    is_unchanged = args.config is None and args.work is None
    record = read_turns(samples) if is_unchanged else None
    replay: Replay | CycleReplay
    if record is not None:
        replay = CycleReplay(config, record)
    else:
        work = PROPOSALS if args.work is None else args.work
        replay = Replay(config, recorded.ready_ns, work)
    began = time.monotonic()
    steps: list[ReplayStep] = []
    last_s = 0.0

    def robots_s(at_s: float, step: ReplayStep | None = None) -> float:
        """Return the robot's time since the recording began [s], as in its review."""
        at_ns = replay.began_ns + round(1e9 * at_s)
        if step is not None and step.as_recorded and step.decision.path is not None:
            at_ns = recorded.path_ns.get(step.decision.path.revision, at_ns)
        return robots_clock.seconds(at_ns)

    for step in replay.steps(samples):
        last_s = step.at_s
        if step.is_news:
            steps.append(replace(step, at_s=robots_s(step.at_s, step)))
    last_s = robots_s(last_s)
    summary = _summary(replay, recorded, samples, steps, last_s)
    compared = None
    if record is not None and isinstance(replay, CycleReplay):
        compared = _comparison(replay, record, robots_s)
    if args.json:
        verdict = msgspec.to_builtins(compared) if compared else {"equal": None}
        document = msgspec.to_builtins(summary) | verdict
        print_json({"decisions": [_document(step) for step in steps], "summary": document})
    else:
        console = terminal.out()
        console.print(_table(steps))
        console.print(terminal.figures([*_rows(summary), *_compared_rows(compared)]))
        took_s = time.monotonic() - began
        terminal.err().print(f"{clock(last_s)} of the robot's time in {took_s:.1f} s")
    return Exit.OK if compared is None or compared.equal else Exit.ERROR


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be a whole number from 0 on, got {text!r}")
    return int(text)


def _document(step: ReplayStep) -> dict[str, object]:
    document: dict[str, object] = {"at_s": round(step.at_s, 3), "state": step.state}
    document["reason"] = step.reason
    if step.decision.plan is not None:
        document["asked"] = step.decision.plan.reason
    if step.decision.path is not None:
        document["path"] = _path(step.decision.path) | {"as_recorded": step.as_recorded}
    if faults := (*step.refused, *step.decision.faults):
        document["faults"] = [{"code": fault.code, "message": str(fault)} for fault in faults]
    return document


def _path(update: PathUpdate) -> dict[str, object]:
    return {
        "revision": update.revision,
        "reason": update.reason,
        "steps": max(len(update.cells) - 1, 0),
        "cells_digest": digest(update.cells.astype("<i4").tobytes()).hex(),
        **msgspec.structs.asdict(PlanFigures.of(update.plan)),
    }


class ReplaySummary(msgspec.Struct):
    """The result of a replay."""

    duration_s: float
    state: str
    reason: str
    covered_cells: int
    coverable_cells: int
    plans: int
    paths: int
    paths_recorded: int
    paths_as_recorded: int | None
    faults: dict[str, int]
    samples_missing: int
    restored_cells_missing: int
    restarts_ignored: int


def _summary(
    replay: Replay | CycleReplay,
    recorded: RecordedRun,
    samples: RecordedSamples,
    steps: Sequence[ReplayStep],
    last_s: float,
) -> ReplaySummary:
    mission, coverage = replay.mission, replay.mission.coverage()
    is_approximate = isinstance(replay, Replay)
    faults = Counter(
        fault.code for step in steps for fault in (*step.refused, *step.decision.faults)
    )
    return ReplaySummary(
        duration_s=round(last_s, 3),
        state=str(mission.state),
        reason=mission.reason,
        covered_cells=coverage.covered if coverage else 0,
        coverable_cells=coverage.coverable if coverage else 0,
        plans=mission.route.requests.plans,
        paths=mission.route.revision,
        paths_recorded=len(recorded.paths),
        paths_as_recorded=None
        if is_approximate
        else sum(step.as_recorded is True for step in steps if step.decision.path is not None),
        faults=dict(sorted(faults.items())),
        samples_missing=samples.missing,
        restored_cells_missing=recorded.restored_cells if is_approximate else 0,
        restarts_ignored=recorded.starts if is_approximate else 0,
    )


def _table(steps: Sequence[ReplayStep]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("at", "state", "path", "steps", "proposals", "recorded"):
        table.add_column(name, justify="left" if name in ("state", "recorded") else "right")
    table.add_column("why", overflow="fold")
    for step in steps:
        update = step.decision.path
        faults = [str(fault) for fault in (*step.refused, *step.decision.faults)]
        why = update.reason if update else step.reason if step.changed else ""
        row = ["", "", "", ""]
        if update is not None:
            plan = update.plan
            row = [
                str(update.revision),
                str(max(len(update.cells) - 1, 0)),
                "" if plan is None else str(plan.work.proposals),
                {True: "same", False: "other", None: "-"}[step.as_recorded],
            ]
        if update or step.changed or faults:
            table.add_row(
                clock(step.at_s), step.state, *row, "; ".join(filter(None, (plain(why), *faults)))
            )
    return table


def _rows(summary: ReplaySummary) -> list[tuple[str, str]]:
    faults = ", ".join(f"{count} {code}" for code, count in summary.faults.items())
    rows = [
        ("ended", f"{summary.state}: {plain(summary.reason)}"),
        ("covered", f"{summary.covered_cells} of {summary.coverable_cells} cells"),
        ("plans, paths", f"{summary.plans}, {summary.paths}"),
        ("refused", faults or "nothing"),
    ]
    if (same := summary.paths_as_recorded) is not None:
        rows.append(("as recorded", f"{same} of {summary.paths_recorded} paths"))
    if summary.samples_missing:
        rows.append(("not recorded", f"{summary.samples_missing} samples"))
    if summary.restored_cells_missing:
        rows.append(("covered before", f"{summary.restored_cells_missing} cells, not recorded"))
    if summary.restarts_ignored:
        rows.append(("daemon restarts", f"{summary.restarts_ignored}, played as one mission"))
    return rows


class Versions(msgspec.Struct):
    """The versions of software in the recorded run and in the replay."""

    recorded: str
    replayed: str


class Comparison(msgspec.Struct):
    """The result of a replay by cycles."""

    equal: bool
    turns: int
    turns_equal: int
    plans_repeated: int
    difference: Difference | None
    log_ends: str
    version: Versions
    kernels: Versions


def _comparison(
    replay: CycleReplay, record: CycleRecord, robots_s: Callable[[float], float]
) -> Comparison:
    difference = replay.difference
    if difference is not None:
        difference = replace(difference, at_s=round(robots_s(difference.at_s), 3))
    return Comparison(
        equal=difference is None and not record.gap,
        turns=record.turns,
        turns_equal=replay.turns,
        plans_repeated=replay.plans,
        difference=difference,
        log_ends=record.gap,
        version=Versions(record.beginning.version, __version__),
        kernels=Versions(record.kernels, replay.kernels),
    )


def _compared_rows(compared: Comparison | None) -> list[tuple[str, str]]:
    if compared is None:
        return [("replay", "approximate: there is no turn log from the beginning, or it is unused")]
    cycles = f"{compared.turns_equal} of {compared.turns} cycles"
    verdict = "equal bit for bit" if compared.equal else "equal as far as can be compared"
    if compared.difference is not None:
        verdict = "not equal"
    rows = [("replay", f"{verdict}: {cycles}")]
    if compared.difference is not None:
        rows.append(("first difference", _words(compared.difference)))
    if compared.log_ends:
        rows.append(("compared up to", f"cycle {compared.turns}: {compared.log_ends}"))
    for name, versions in (("version", compared.version), ("kernels", compared.kernels)):
        was, now = versions.recorded, versions.replayed
        if was and was != now:
            rows.append((name, f"recorded with {was}, replayed with {now}"))
    kernels = compared.kernels
    if compared.difference is not None and kernels.recorded not in ("", kernels.replayed):
        rows.append(("why", "other kernels may plan other paths, without a fault"))
    return rows


def _words(found: Difference) -> str:
    return (
        f"cycle {found.turn} at {clock(found.at_s)}: {found.what} "
        f"was {found.recorded}, is {found.replayed}"
    )


COMMAND = Subcommand(
    description=DESCRIPTION,
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
