"""``fasaco-edge doctor``: checks of host, bus and configuration, each with its remedy."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from rich.text import Text

from fasaco_edge.cli.console.arguments import Exit, Subcommand, add_json
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import out, wrapped
from fasaco_edge.doctor.finding import Finding, Level
from fasaco_edge.doctor.report import findings

EPILOG = """\
It joins the bus for a second, listens, and queries; it starts and changes nothing. Run it as the
daemon's user or as root, so that it can read the same files as the daemon. The checks:
  configuration   whether the file is valid
  platform        processor, system, Python, number of cores
  memory          size, and whether limits on it are effective
  clock           whether it is synchronised
  kernels         whether they are compiled for this code and processor, and who owns them
  disk            space for state and kernels, and for recordings if --recordings is given
  permissions     whether others may change configuration or state
  session         whether the daemon can join the bus, and no other daemon has its name
  peers           daemon, other robots, maps and poses on the bus
  endpoints       where the daemon listens, and who can reach it
  identity        whether certificate, key and CA match, and when they expire; or user and password
  secret files    whether others on this computer can read keys and passwords
  roles           who may publish maps, command, view and record

Each check is ok; warn: works, but needs attention; or fail, with what to do.

exit codes: 0 no check failed, 1 a check failed

examples:
  fasaco-edge doctor --config /etc/fasaco-edge.yaml
  fasaco-edge doctor --config robot.yaml --json | jq '.checks[] | select(.level != "ok")'
"""
COLOURS = {"ok": "green", "warn": "yellow", "fail": "red"}


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="the daemon's YAML configuration (default: the built-in defaults)",
    )
    parser.add_argument("--recordings", type=Path, metavar="DIR", help="folder for recordings")
    add_json(parser, "the findings")


def run(args: argparse.Namespace) -> int:
    """Run the checks and print them."""
    found = list(findings(args.config, recordings=args.recordings))
    if args.json:
        print_json(_document(found))
    else:
        _print(found)
    failed = any(finding.level is Level.FAIL for _, finding in found)
    return Exit.ERROR if failed else Exit.OK


def _document(found: list[tuple[str, Finding]]) -> dict[str, object]:
    checks = [{"name": name} | asdict(finding) for name, finding in found]
    return {"ok": all(finding.level != "fail" for _, finding in found), "checks": checks}


def _print(found: list[tuple[str, Finding]]) -> None:
    console = out()
    wide = max(len(name) for name, _ in found)
    indent = " " * (wide + 8)

    def fitted(text: str) -> str:
        return wrapped(console, text, indent, indent)

    for name, finding in found:
        level = Text(f"{finding.level:<4}", COLOURS[finding.level])
        text = level.append(f"  {name:<{wide}}  {fitted(finding.found)[len(indent) :]}", "default")
        console.print(text, soft_wrap=True)
        for line in finding.details:
            console.print(Text(fitted(line), "dim"), soft_wrap=True)
        if finding.to_do:
            console.print(Text(fitted(f"-> {finding.to_do}")), soft_wrap=True)


COMMAND = Subcommand(
    description="Check the bus, the configuration, and the host on which a daemon runs or will "
    "run: what is missing, who has access to what, and what to do about it.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
