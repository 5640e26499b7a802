"""``fasaco-edge ask``: put a question to a running daemon."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING

from fasaco_edge.cli.console import asking, exits
from fasaco_edge.cli.console.arguments import add_command
from fasaco_edge.wire.topics import RPC_NAMES

if TYPE_CHECKING:
    from fasaco_edge.cli.console.arguments import Subparsers

EPILOG = """\
examples:
  fasaco-edge ask status
  fasaco-edge ask path                      how long it is, and why it is what it is
  fasaco-edge ask pheromone --param cohort=0
  fasaco-edge ask replan                    a full new plan, now
  fasaco-edge ask config --json

Orders are given with `fasaco-edge mission`; what can be asked and what is answered stands in
protocol/README.md.

exit codes: 0 answered; 1 refused, or nobody answered; 2 not understood; 78 no name for a robot
"""


def add_to(commands: Subparsers, common: argparse.ArgumentParser) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        common,
        "ask",
        run,
        about="ask a running daemon: status, path, coverage, pheromone, config, replan ...",
        description="Put a question to a running daemon over Zenoh, and show the answer.",
        epilog=EPILOG,
    )
    parser.add_argument("question", choices=RPC_NAMES, metavar="NAME", help=", ".join(RPC_NAMES))
    parser.add_argument(
        "--param",
        type=_parameter,
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="parameter of the question; may be repeated",
    )
    asking.add_question(parser)


def run(args: argparse.Namespace) -> int:
    """Ask, and show the answer."""
    from fasaco_edge.cli.answers import print_answer, show

    reply = asking.ask(args, args.question, ";".join(args.param))
    if args.json:
        print_answer(reply)
    else:
        show(args.question, reply)
    return exits.OK


def _parameter(text: str) -> str:
    # What has a meaning in a selector would ask something else.
    if not re.fullmatch(r"\w+=[^;?#&|]*", text):
        raise argparse.ArgumentTypeError(f"must be KEY=VALUE, got {text!r}")
    return text
