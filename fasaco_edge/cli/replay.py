"""``fasaco-edge replay``: a recorded mission once more, and whether it decides the same."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from rich.table import Table

from fasaco_edge import __version__
from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import Command, Exit
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.config.loading import load_config
from fasaco_edge.replay.cycle_replay import CycleReplay, Difference, read_turns
from fasaco_edge.replay.replay import Replay, read_run
from fasaco_edge.text import shown
from fasaco_edge.wire.documents.path_documents import PlanFigures, digest

if TYPE_CHECKING:
    from fasaco_edge.errors import FasacoError
    from fasaco_edge.mission.core.events import PathUpdate
    from fasaco_edge.recording.read.run import RecordedSamples
    from fasaco_edge.replay.cycle_replay import CycleRecord
    from fasaco_edge.replay.mission_drive import ReplayStep
    from fasaco_edge.replay.replay import RecordedRun

DESCRIPTION = """\
Feed the samples of a recording to the mission again, through the same code that the daemon
runs, and report what it decides. A recording with a turn log is replayed cycle by cycle, and each
decision compared with the recorded one, bit for bit: the first that differs ends it, with exit
code 1. One without is replayed approximately: time is that of the samples and planning is counted
in work. The same files give the same decisions on any machine.
"""
EPILOG = """\
The column `then` shows whether the path equals the recorded one cell by cell. Without a turn log
a recording does not show in full which samples the daemon took together, nor the work of plans
that were not used: a different path is no error then. With --config or --work the replay is of
another mission, and approximate, too. So is that of a daemon of an earlier release which planned
with a planner of the user's own: those plans cannot be repeated, and `planner.name` plans instead.
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
        help="proposals of each plan (default: as recorded with its path)",
    )
    parser.add_argument("--json", action="store_true", help="print a JSON document")


def run(args: argparse.Namespace) -> int:
    """Replay."""
    from fasaco_edge.recording.read.run import RecordedSamples

    samples = RecordedSamples(args.recordings)
    recorded = read_run(samples)
    config = load_config(args.config) if args.config else recorded.daemon_config()
    is_as_it_was = args.config is None and args.work is None and not recorded.own_planner
    record = read_turns(samples) if is_as_it_was else None
    replay: Replay | CycleReplay
    if record is not None:
        replay = CycleReplay(config, record)
    else:
        replay = Replay(config, recorded, args.work)
    began = time.monotonic()
    steps: list[ReplayStep] = []
    last_s = 0.0
    for step in replay.steps(samples):
        last_s = step.at_s
        if step.is_news:
            steps.append(step)
    summary = _summary(replay, recorded, samples, steps, last_s)
    compared = None
    if record is not None and isinstance(replay, CycleReplay):
        compared = _compared(replay, record)
    if args.json:
        document = summary | (msgspec.to_builtins(compared) if compared else {"equal": None})
        print_json({"decisions": [_document(step) for step in steps], "summary": document})
    else:
        console = terminal.out()
        console.print(_table(steps))
        console.print(terminal.figures([*_rows(summary), *_compared_rows(compared)]))
        terminal.err().print(f"{last_s:.1f} s in {time.monotonic() - began:.1f} s")
    return Exit.OK if compared is None or compared["equal"] else Exit.ERROR


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be a whole number from 0 on, got {text!r}")
    return int(text)


def _document(step: ReplayStep) -> dict[str, object]:
    document: dict[str, object] = {"at_s": round(step.at_s, 6), "state": step.state}
    document["reason"] = step.reason
    if step.decision.plan is not None:
        document["asked"] = step.decision.plan.reason
    if step.decision.path is not None:
        document["path"] = _path(step.decision.path) | {"as_recorded": step.as_recorded}
    if faults := _faults(step):
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


def _summary(
    replay: Replay | CycleReplay,
    recorded: RecordedRun,
    samples: RecordedSamples,
    steps: Sequence[ReplayStep],
    last_s: float,
) -> dict[str, Any]:
    """Return the result of a replay, as JSON values."""
    mission, coverage = replay.mission, replay.mission.coverage()
    is_approximate = isinstance(replay, Replay)
    codes = Counter(fault.code for step in steps for fault in _faults(step))
    as_recorded = [step for step in steps if step.decision.path is not None and step.as_recorded]
    return {
        "duration_s": round(last_s, 3),
        "state": str(mission.state),
        "reason": mission.reason,
        "covered_cells": coverage.covered if coverage else 0,
        "coverable_cells": coverage.coverable if coverage else 0,
        "plans": mission.route.plans,
        "paths": mission.route.revision,
        "paths_recorded": len(recorded.paths),
        "paths_as_recorded": len(as_recorded),
        "faults": dict(sorted(codes.items())),
        "samples_missing": samples.missing,
        "restored_cells_missing": recorded.restored_cells if is_approximate else 0,
        "restarts_ignored": recorded.starts if is_approximate else 0,
        "own_planner_missing": recorded.own_planner,
    }


def _faults(step: ReplayStep) -> tuple[FasacoError, ...]:
    return (*step.refused, *step.decision.faults)


def _table(steps: Sequence[ReplayStep]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("s", "state", "path", "steps", "proposals", "then"):
        table.add_column(name, justify="left" if name in ("state", "then") else "right")
    table.add_column("why", overflow="fold")
    for step in steps:
        update = step.decision.path
        faults = [str(fault) for fault in _faults(step)]
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
                f"{step.at_s:.2f}", step.state, *row, "; ".join(filter(None, (why, *faults)))
            )
    return table


def _rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    faults = ", ".join(f"{count} {code}" for code, count in summary["faults"].items())
    rows = [
        ("ended", f"{summary['state']}: {summary['reason']}"),
        ("covered", f"{summary['covered_cells']} of {summary['coverable_cells']} cells"),
        ("plans, paths", f"{summary['plans']}, {summary['paths']}"),
        ("as recorded", f"{summary['paths_as_recorded']} of {summary['paths_recorded']} paths"),
        ("refused", faults or "nothing"),
    ]
    if own := summary["own_planner_missing"]:
        rows.append(("own planner", f"{shown(own)}: its plans cannot be repeated"))
    for name, key, words in (
        ("not recorded", "samples_missing", "samples"),
        ("covered before", "restored_cells_missing", "cells, not recorded"),
        ("daemon restarts", "restarts_ignored", "played as one mission"),
    ):
        if count := summary[key]:
            rows.append((name, f"{count} {words}"))
    return rows


# Limit on the differing samples that are named.
NAMED = 5


def _compared(replay: CycleReplay, record: CycleRecord) -> dict[str, Any]:
    """Return the result of a replay by cycles, as JSON values."""
    difference, *lacking = (
        found and replace(found, at_s=round(found.at_s, 6))
        for found in (replay.difference, *replay.lacking)
    )
    return {
        "equal": difference is None and not lacking and not record.gap,
        "turns": record.turns,
        "turns_equal": replay.turns,
        "plans_repeated": replay.plans,
        "difference": difference,
        "samples_lacking": lacking,
        "log_ends": record.gap,
        "version": {"recorded": record.beginning.version, "replayed": __version__},
        "kernels": {"recorded": record.kernels, "replayed": replay.kernels},
    }


def _compared_rows(compared: dict[str, Any] | None) -> list[tuple[str, str]]:
    """Return the result of a replay by cycles, for people."""
    if compared is None:
        return [("replay", "approximate: there is no turn log from the beginning, or it is unused")]
    difference, lacking = compared["difference"], compared["samples_lacking"]
    said = "equal bit for bit" if compared["equal"] else "equal as far as can be compared"
    said = said if difference is None else "not equal"
    rows = [("replay", f"{said}: {compared['turns_equal']} of {compared['turns']} turns")]
    if difference is not None:
        rows.append(("first difference", _words(difference)))
    rows.extend(("sample", _words(found)) for found in lacking[:NAMED])
    if len(lacking) > NAMED:
        rows.append(("samples", f"{len(lacking) - NAMED} more are not as they were taken"))
    if ends := compared["log_ends"]:
        rows.append(("compared up to", f"turn {compared['turns']}: {ends}"))
    for name in ("version", "kernels"):
        was, now = compared[name].values()
        if was and was != now:
            rows.append((name, f"recorded with {was}, replayed with {now}"))
            if name == "kernels" and difference is not None:
                rows.append(("why", "other kernels may plan other paths: that is no fault"))
    return rows


def _words(found: Difference) -> str:
    return (
        f"turn {found.turn} at {found.at_s:.2f} s: {found.what} "
        f"was {found.recorded}, is {found.replayed}"
    )


COMMAND = Command(
    description=DESCRIPTION,
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
