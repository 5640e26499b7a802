"""``fasaco-edge mission keep-out``: keep-outs of a running mission, added, removed and listed."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from rich.table import Table

from fasaco_edge.cli.console.terminal import out
from fasaco_edge.mission.orders.commands import read_command
from fasaco_edge.wire.documents import replies

EPILOG = """\
examples:
  fasaco-edge mission keep-out add --name vase "1,1;2,1;2,2;1,2"
  fasaco-edge mission keep-out add --name vase 1,1 2,1 2,2 1,2       the same
  fasaco-edge mission keep-out list
  fasaco-edge mission keep-out remove vase

A path into an added area is cut off at once and planned again; a robot inside the area stops. The
order continues, and what is covered is kept. The area is valid for all orders until it is removed;
a restart or a reset keeps it. If no known floor lies in it, the answer says so; it is added
nevertheless, as the map may grow.
Areas of an order (`mission start --keep-out`) end with the order; they are listed without a name,
and cannot be removed. Areas of the configuration (mission.keep_out) are changed there.

exit codes: 0 done; 1 refused, or no answer, by at least one robot; 2 usage error; 78 invalid robot
name
"""

ACTIONS = {
    "add": "add a keep-out; the order continues, what is covered is kept",
    "remove": "remove a keep-out that was added",
    "list": "list the keep-outs",
}


def add_actions(
    parser: argparse.ArgumentParser, add_options: Callable[[argparse.ArgumentParser], None]
) -> None:
    """Add the commands of ``keep-out``; ``add_options`` adds their common options."""
    parser.epilog = EPILOG
    actions = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name, text in ACTIONS.items():
        action = actions.add_parser(name, help=text, description=f"{text.capitalize()}.")
        if name == "add":
            action.add_argument(
                "corners",
                nargs="+",
                metavar="X,Y",
                help='corners [m] in the frame of the map: "X,Y;X,Y;X,Y" or X,Y X,Y X,Y',
            )
            action.add_argument(
                "--name", required=True, metavar="NAME", help="name of the keep-out, for `remove`"
            )
        elif name == "remove":
            action.add_argument("name", metavar="NAME", help="name of the keep-out")
        add_options(action)
        action.set_defaults(keep_out_action=name)


def polygon(text: str) -> list[list[float]]:
    """Read three or more corners [m], ``X,Y;X,Y;X,Y``."""
    try:
        corners = [[float(value) for value in pair.split(",")] for pair in text.split(";")]
    except ValueError:
        corners = []
    if len(corners) < 3 or any(len(corner) != 2 for corner in corners):
        raise argparse.ArgumentTypeError(f"must be x,y;x,y;x,y;... in metres, got {text!r}")
    return corners


def asked_by(args: argparse.Namespace) -> dict[str, object]:
    """Return the command as a document; it is checked here, so that faults need no daemon.

    Raises:
        OrderError: the area or its name is invalid.
    """
    if args.keep_out_action == "list":
        return {"command": "status"}
    keep_out = {"name": args.name}
    if args.keep_out_action == "add":
        try:
            # The corners may be one argument, or one argument each.
            keep_out["polygon"] = polygon(";".join(map(str.strip, args.corners)))
        except argparse.ArgumentTypeError as error:
            args.parser.error(f"argument X,Y: {error}")
    asked: dict[str, object] = {"command": f"keep_out_{args.keep_out_action}", "keep_out": keep_out}
    read_command(asked)
    return asked


def show_keep_outs(answer: replies.Reply) -> None:
    mission = answer.mission
    table = Table("name", "of", "corners", title="Keep-outs", title_justify="left")
    for keep_out in mission.keep_outs:
        corners = " ".join(f"({x:.2f}, {y:.2f})" for x, y in keep_out.polygon[:MOST_CORNERS])
        more = " ..." if len(keep_out.polygon) > MOST_CORNERS else ""
        table.add_row(keep_out.name or "-", f"the {keep_out.by}", f"{corners}{more}")
    if others := mission.keep_out - len(mission.keep_outs):
        table.caption = f"and {others} of the configuration"
    out().print(table)


# Limit on the corners shown of a keep-out; `--json` has all.
MOST_CORNERS = 8


def names_of(answer: replies.Reply) -> str:
    """Return the names of the operator's keep-outs."""
    names = ", ".join(each.name for each in answer.mission.keep_outs if each.by == "operator")
    return names or "none"
