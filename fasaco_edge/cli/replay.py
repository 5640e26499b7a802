"""``fasaco-edge replay``: a recorded mission once more, and whether it decides the same."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fasaco_edge import __version__
from fasaco_edge.cli.console.arguments import Command
from fasaco_edge.cli.console.streams import print_json

if TYPE_CHECKING:
    from fasaco_edge.mission.core.events import PathUpdate
    from fasaco_edge.recording.read.run import RecordedSamples
    from fasaco_edge.replay.cycle_replay import CycleRecord, CycleReplay, Difference
    from fasaco_edge.replay.mission_drive import ReplayStep
    from fasaco_edge.replay.replay import RecordedRun, Replay

DESCRIPTION = """\
Play the samples of a recording to the mission again, through the same code that the
daemon runs, and tell what it decides. A recording with a turn log is played turn by turn, and
each decision compared with the recorded one, bit for bit: the first that is another ends it,
and the command, with code 1. One without is played approximately: time is that of the samples
and planning is counted in work. The same files give the same decisions on any machine.
"""
EPILOG = """\
The column `then` tells whether the path is cell by cell the one that was recorded. Without
turn log a recording does not tell in full which samples the daemon took together, nor the work
of plans that came to nothing: a path that differs is no error then. With --config or --work the
replay is of another mission, and approximate, too.
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
        help="proposals of each plan (default: what was recorded with its path)",
    )
    parser.add_argument("--json", action="store_true", help="print a JSON document")


def run(args: argparse.Namespace) -> int:
    """Replay."""
    from fasaco_edge.cli.console import terminal
    from fasaco_edge.config.config import load_config
    from fasaco_edge.recording.read.run import RecordedSamples
    from fasaco_edge.replay.cycle_replay import CycleReplay, read_turns
    from fasaco_edge.replay.replay import Replay, read_run

    samples = RecordedSamples(args.recordings)
    recorded = read_run(samples)
    config = load_config(args.config) if args.config else recorded.daemon_config()
    is_as_it_was = args.config is None and args.work is None
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
    summary |= _cycle_summary(replay, record)
    code = 0 if summary["equal"] in (True, None) else 1
    if args.json:
        print_json({"decisions": [_document(step) for step in steps], "summary": summary})
        return code
    rows = [*_rows(summary), *_cycle_rows(summary)]
    console = terminal.out()
    console.print(_table(steps))
    console.print(terminal.figures((name, str(value)) for name, value in rows))
    terminal.err().print(f"{last_s:.1f} s in {time.monotonic() - began:.1f} s")
    return code


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be a whole number from 0 on, got {text!r}")
    return int(text)


def _document(step: ReplayStep) -> dict[str, Any]:
    faults = (*step.refused, *step.decision.faults)
    document: dict[str, Any] = {"at_s": round(step.at_s, 6), "state": step.state}
    document["reason"] = step.reason
    if step.decision.plan is not None:
        document["asked"] = step.decision.plan.reason
    if step.decision.path is not None:
        document["path"] = _path(step.decision.path) | {"as_recorded": step.as_recorded}
    if faults:
        document["faults"] = [{"code": fault.code, "message": str(fault)} for fault in faults]
    return document


def _path(update: PathUpdate) -> dict[str, Any]:
    from msgspec.structs import asdict

    from fasaco_edge.bus.arrival import digest
    from fasaco_edge.daemon.loop.status import plan_figures

    return {
        "revision": update.revision,
        "reason": update.reason,
        "steps": max(len(update.cells) - 1, 0),
        "cells_digest": digest(update.cells.astype("<i4").tobytes()).hex(),
        **asdict(plan_figures(update.plan)),
    }


def _summary(
    replay: Replay | CycleReplay,
    recorded: RecordedRun,
    samples: RecordedSamples,
    steps: Iterable[ReplayStep],
    last_s: float,
) -> dict[str, Any]:
    steps = list(steps)
    mission = replay.mission
    verdicts = Counter(step.as_recorded for step in steps if step.decision.path is not None)
    faults = Counter(
        fault.code for step in steps for fault in (*step.refused, *step.decision.faults)
    )
    coverage = mission.coverage()
    is_approximate = not hasattr(replay, "difference")
    return {
        "duration_s": round(last_s, 3),
        "state": str(mission.state),
        "reason": mission.reason,
        "covered_cells": coverage.covered if coverage else 0,
        "coverable_cells": coverage.coverable if coverage else 0,
        "plans": mission.route.plans,
        "paths": mission.route.revision,
        "paths_recorded": len(recorded.paths),
        "paths_as_recorded": verdicts[True],
        "faults": dict(sorted(faults.items())),
        "samples_missing": samples.missing,
        "restored_cells_missing": recorded.restored_cells if is_approximate else 0,
        "restarts_ignored": recorded.starts if is_approximate else 0,
    }


def _table(steps: Iterable[ReplayStep]) -> Any:  # noqa: ANN401 - rich is imported where it is used
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for name in ("s", "state", "path", "steps", "proposals", "then"):
        table.add_column(name, justify="left" if name in ("state", "then") else "right")
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
                f"{step.at_s:.2f}", step.state, *row, "; ".join(filter(None, (why, *faults)))
            )
    return table


def _rows(summary: dict[str, Any]) -> list[tuple[str, object]]:
    faults = ", ".join(f"{count} {code}" for code, count in summary["faults"].items())
    rows: list[tuple[str, object]] = [
        ("ended", f"{summary['state']}: {summary['reason']}"),
        ("covered", f"{summary['covered_cells']} of {summary['coverable_cells']} cells"),
        ("plans, paths", f"{summary['plans']}, {summary['paths']}"),
        ("as recorded", f"{summary['paths_as_recorded']} of {summary['paths_recorded']} paths"),
        ("refused", faults or "nothing"),
    ]
    if summary["samples_missing"]:
        rows.append(("not recorded", f"{summary['samples_missing']} samples"))
    if summary["restored_cells_missing"]:
        rows.append(("covered before", f"{summary['restored_cells_missing']} cells, not recorded"))
    if summary["restarts_ignored"]:
        rows.append(("daemon restarts", f"{summary['restarts_ignored']}, played as one mission"))
    return rows


# Of samples that are not as they were taken, so many are named.
NAMED = 5


def _cycle_summary(replay: Replay | CycleReplay, record: CycleRecord | None) -> dict[str, Any]:
    """Return what a replay by turns came to; ``equal`` is None of an approximate one."""
    from fasaco_edge.replay.cycle_replay import CycleReplay

    if record is None or not isinstance(replay, CycleReplay):
        return {"equal": None}
    then, difference = record.beginning, replay.difference
    return {
        "equal": difference is None and not replay.lacking and not record.gap,
        "turns": record.turns,
        "turns_equal": replay.turns,
        "plans_repeated": replay.plans,
        "difference": None if difference is None else _difference_document(difference),
        "samples_lacking": [_difference_document(lacking) for lacking in replay.lacking],
        "log_ends": record.gap,
        "version": {"recorded": then.version, "replayed": __version__},
        "kernels": {"recorded": record.kernels, "replayed": replay.kernels},
    }


def _cycle_rows(summary: dict[str, Any]) -> list[tuple[str, object]]:
    """Return the summary of a replay by turns for people."""
    if summary["equal"] is None:
        return [("replay", "approximate: there is no turn log from the beginning, or it is unused")]
    turns = f"{summary['turns_equal']} of {summary['turns']} turns"
    said = "equal bit for bit" if summary["equal"] else "equal as far as can be compared"
    if summary["difference"] is not None:
        said = "not equal"
    rows: list[tuple[str, object]] = [("replay", f"{said}: {turns}")]
    if summary["difference"] is not None:
        rows.append(("first difference", _words(summary["difference"])))
    lacking = summary["samples_lacking"]
    rows.extend(("sample", _words(document)) for document in lacking[:NAMED])
    if len(lacking) > NAMED:
        rows.append(("samples", f"{len(lacking) - NAMED} more are not as they were taken"))
    if summary["log_ends"]:
        rows.append(("compared up to", f"turn {summary['turns']}: {summary['log_ends']}"))
    for name in ("version", "kernels"):
        was, now = summary[name]["recorded"], summary[name]["replayed"]
        if was and was != now:
            rows.append((name, f"recorded with {was}, replayed with {now}"))
    return rows


def _difference_document(difference: Difference) -> dict[str, Any]:
    return {
        "turn": difference.turn,
        "at_s": round(difference.at_s, 6),
        "what": difference.what,
        "recorded": difference.recorded,
        "replayed": difference.replayed,
    }


def _words(document: dict[str, Any]) -> str:
    return (
        f"turn {document['turn']} at {document['at_s']:.2f} s: {document['what']} "
        f"was {document['recorded']}, is {document['replayed']}"
    )


COMMAND = Command(
    description=DESCRIPTION,
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
