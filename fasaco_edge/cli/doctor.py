"""``fasaco-edge doctor``: look a daemon's configuration through, and say what to do."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.cli import exits

if TYPE_CHECKING:
    from fasaco_edge.cli.arguments import Subparsers
    from fasaco_edge.daemon.checks.finding import Finding

EPILOG = """\
Nothing is started, changed or sent; run it as the user the daemon runs as, so that
it may read what the daemon reads. What it looks at:
  configuration   whether the file is in order
  endpoints       where the daemon listens, from where that can be reached, by whom
  identity        certificate, key and CA: whether they fit together, and until when;
                  or user and password
  secret files    whether others on this computer can read keys and passwords
  roles           who may give maps, command, view and record
  limits          how much each who sends may send

each line is ok; warn: it works, but think about it; or fail, with what to do.
exit codes: 0 nothing failed, 1 something did

examples:
  fasaco-edge doctor --config /etc/fasaco-edge.yaml
  fasaco-edge doctor --config robot.yaml --json | jq '.checks[] | select(.level != "ok")'
"""
COLOURS = {"ok": "green", "warn": "yellow", "fail": "red"}


def add_to(commands: Subparsers, common: argparse.ArgumentParser) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "doctor",
        parents=[common],
        help="look through a configuration: what is open to whom, and what to do about it",
        description="Look through the configuration of a daemon: what is open to whom, whether "
        "certificates are in order, and what to do where something is not.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="the daemon's YAML configuration (default: what a daemon without one does)",
    )
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")
    parser.set_defaults(command=run)


def run(args: argparse.Namespace) -> int:
    """Look, and report."""
    from fasaco_edge.daemon.checks.finding import Level
    from fasaco_edge.daemon.checks.report import findings

    found = list(findings(args.config))
    if args.json:
        print(json.dumps(_document(found)))
    else:
        _print(found)
    failed = any(finding.level is Level.FAIL for _, finding in found)
    return exits.ERROR if failed else exits.OK


def _document(found: list[tuple[str, Finding]]) -> dict[str, object]:
    checks = [
        {
            "name": name,
            "level": finding.level,
            "found": finding.found,
            "to_do": finding.to_do,
            "details": finding.details,
        }
        for name, finding in found
    ]
    return {"ok": all(finding.level != "fail" for _, finding in found), "checks": checks}


def _print(found: list[tuple[str, Finding]]) -> None:
    from rich.markup import escape

    from fasaco_edge.cli.terminal import out

    console = out()
    wide = max(len(name) for name, _ in found)
    indent = " " * (wide + 8)
    for name, finding in found:
        level = f"[{COLOURS[finding.level]}]{finding.level:<4}[/]"
        console.print(f"{level}  {name:<{wide}}  {escape(finding.found)}", soft_wrap=True)
        for line in finding.details:
            console.print(f"{indent}{line}", style="dim", markup=False, soft_wrap=True)
        if finding.to_do:
            console.print(f"{indent}-> {finding.to_do}", markup=False, soft_wrap=True)
