"""``fasaco-edge mission``: commands to one daemon or to all of a fleet, and their progress."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from fasaco_edge.cli.ask import RefusedError, add_question, ask, show_mission
from fasaco_edge.cli.console.arguments import Command, Exit, add_common
from fasaco_edge.cli.console.pass_option import WORDS, add_passes
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import agrees, err, may_ask
from fasaco_edge.cli.mission.keep_outs import (
    add_actions,
    asked_by,
    names_of,
    polygon,
    show_keep_outs,
)
from fasaco_edge.cli.order_file import read_order_file
from fasaco_edge.errors import OrderError, WouldForget
from fasaco_edge.mission.orders.commands import FORGETFUL
from fasaco_edge.mission.orders.order import order_document, read_order
from fasaco_edge.mission.orders.passes import passes_document
from fasaco_edge.wire.documents.json_text import decode_json, decode_tolerant, encode_json
from fasaco_edge.wire.documents.replies import Reply

if TYPE_CHECKING:
    from fasaco_edge.bus.queries import Reply as Answer

NO_MAP = "there is no map yet: whether known floor lies in it is shown by `mission status` later"
ROOMS_KEPT = (
    "rooms keep names, borders and settings, and keep-outs stay; in another building with the same "
    "map frame, stop the daemon, delete <robot>.rooms.json beside the ledger, and start it"
)
KEPT = "what is covered is kept: `mission start --keep-covered` goes on with the rest"

EPILOG = """\
examples:
  fasaco-edge mission status
  fasaco-edge mission start                         everything the robot can reach
  fasaco-edge mission start --passes 2 --return-home
  fasaco-edge mission start --passes edge,auto,cross@0.15   a lap along walls, lanes, lanes across
  fasaco-edge mission start --zone "kitchen:0,0;4,0;4,3;0,3" --zone "hall:4,0;6,0;6,9;4,9"
  fasaco-edge mission start --zone kitchen          a zone of the configuration, or a room
  fasaco-edge mission start --until-min 40          home after 40 minutes
  fasaco-edge mission start --keep-out "1,1;2,1;2,2;1,2"
  fasaco-edge mission start --order evening.yaml
  fasaco-edge mission start --fleet building_7      to each of its robots: they share the floor
  fasaco-edge mission pause && fasaco-edge mission resume
  fasaco-edge mission keep-out add --name vase "1,1;2,1;2,2;1,2"   in mid-mission, nothing is lost

evening.yaml, or the same as JSON; all lengths in metres in the frame of the map:
  zones:                      # one after the other; if none: everything reachable
    - name: kitchen
      polygon: [[0, 0], [4, 0], [4, 3], [0, 3]]
      passes: 2
    - name: hall              # without a polygon: mission.zones of the configuration has it,
                              # or it is a room (`fasaco-edge rooms list`)
  keep_out:                   # the robot must not touch these, nor mission.keep_out
    - [[1, 1], [2, 1], [2, 2], [1, 2]]
  passes: 1                   # of zones without passes, and of everything; or one item a pass:
                              # [edge, auto, {lanes: cross, overlap: 0.3, speed_m_s: 0.15}]
  return_home: true           # at the end: mission.home, mission.dock, or where the mission began
  keep_covered: false         # true: skip what is already covered in the first pass
  unknown: refuse             # wait: for a room of a zone's name, if there is none yet
  until_min: 40               # minutes after which the robot is home

evening.geojson, as a drawing program writes it: each polygon is a zone with the properties name and
passes; one with "keep_out": true is not touched. Coordinates are metres in the frame of the map.

Each pass covers all its floor, also what was covered before; only the pass `rest` leaves out what
the pass `edge` has covered. An order, its progress, and whether it is paused survive a restart of
the daemon. A daemon without an order covers everything by itself (mission.autostart of its
configuration).

A new order and a reset forget the progress of an order that is not over: on a terminal they say how
much that is, and ask first; elsewhere they are refused without --yes. `start --keep-covered` keeps
the progress and covers the rest. A reset keeps keep-outs, and names, borders and settings of rooms.
To forget rooms, as in another building with the same map frame, stop the daemon, and delete
<robot>.rooms.json beside the ledger.

With --fleet all its robots get the same command, also those whose messages other robots received
within the last ten minutes. Some robots may refuse or not answer while the others obey: then the
exit code is 1, and a robot that has not answered may still be driving. Robots share a zone. Corners
are in the frame of each robot's own map: with fleet.frame use zones and keep-outs of their
configurations.

exit codes: 0 done; 1 refused, or no answer, by one robot at least; 2 usage error; 78 invalid robot
name
"""

COMMANDS = {
    "start": "start an order in place of the current one; the same order continues",
    "pause": "stop the robot; what it passes over still counts as covered",
    "resume": "continue what was paused: the order, or the way home or to charge",
    "home": "drive home and stay there: an order goes on after resume",
    "cancel": "stop and drop the order; what is covered is kept",
    "stop": "the same as cancel; to go on later with the same order, pause it",
    "replan": "plan in full now, starting from the current path",
    "reset": "stop and drop the order and what is covered; rooms keep their names",
    "keep-out": "areas to keep out of, changed in mid-mission: add, remove, list",
    "status": "show state, progress, and what could not be reached",
}


def _add_commands(parser: argparse.ArgumentParser) -> None:
    names = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name, text in COMMANDS.items():
        described = text[0].upper() + text[1:] + "."
        command = names.add_parser(name, help=text, description=described)
        command.set_defaults(mission_command=name)
        if name == "keep-out":
            add_actions(command, _add_receiver)
            continue
        if name == "start":
            _add_order(command)
        if name in FORGETFUL:
            command.add_argument(
                "--yes",
                action="store_true",
                help="forget what is covered without a question, as scripts have to say",
            )
        _add_receiver(command)


def _add_receiver(parser: argparse.ArgumentParser) -> None:
    """Add the options of all commands: the robots, and the form of their answers."""
    add_common(parser)
    parser.add_argument(
        "--fleet",
        metavar="NAME",
        help="not to one robot but to each of this fleet (`fleet.name` of their configuration)",
    )
    add_question(parser)


def _add_order(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--order",
        type=Path,
        metavar="FILE",
        help="YAML, JSON or GeoJSON; in place of the options below",
    )
    parser.add_argument(
        "--zone",
        type=_zone,
        action="append",
        metavar="NAME[:X,Y;X,Y;...]",
        help="area to cover, by its corners [m], or a zone of the daemon's configuration or a "
        "room by its name; may be repeated, they are covered in this order",
    )
    parser.add_argument(
        "--keep-out",
        type=polygon,
        action="append",
        metavar="X,Y;X,Y;...",
        help="area the robot must not touch, beside those of the daemon's configuration; may be "
        "repeated",
    )
    add_passes(parser, f"how often to cover, or for each pass {WORDS} (default: 1)")
    parser.add_argument(
        "--return-home", action="store_true", help="at the end drive home, or to where it began"
    )
    parser.add_argument(
        "--keep-covered", action="store_true", help="skip what is already covered in the first pass"
    )
    parser.add_argument(
        "--until-min",
        type=float,
        metavar="MIN",
        help="turn back in time to be home after this many minutes; a robot in its dock, or on its "
        "way there, ends in the dock, and a paused one stays; 0 for no limit (default: "
        "mission.until_min of the daemon's configuration)",
    )


def run(args: argparse.Namespace) -> int:
    """Send the command, and show the answer."""
    command = "cancel" if args.mission_command == "stop" else args.mission_command
    asked: dict[str, object] = {"command": command}
    if args.mission_command == "start":
        asked["order"] = _order(args)
    elif args.mission_command == "keep-out":
        asked = asked_by(args)
    if command in FORGETFUL and args.yes:
        asked["discard"] = True
    is_list = args.mission_command == "keep-out" and args.keep_out_action == "list"
    if args.fleet is not None:
        from fasaco_edge.cli.fleet_wing import command_fleet

        return command_fleet(args, asked, names_of if is_list else None)
    reply = _answer(args, asked)
    if reply is None:
        return Exit.ERROR
    answer = decode_tolerant(reply.payload, Reply)
    if args.json:
        document = decode_json(reply.payload)
        print_json(msgspec.to_builtins(answer.mission.keep_outs) if is_list else document)
    elif is_list:
        show_keep_outs(answer)
    else:
        show_mission(reply)
        if asked["command"] == "keep_out_add" and answer.coverage is None:
            err().print(NO_MAP)
        if command == "reset":
            err().print(ROOMS_KEPT)
        if command == "cancel" and answer.coverage and answer.coverage.covered > 1:
            err().print(KEPT)
    return Exit.OK


def _answer(args: argparse.Namespace, asked: dict[str, object]) -> Answer | None:
    """Return the answer to a command; None if it would forget cells and the user declines."""
    try:
        return ask(args, "mission", payload=encode_json(asked))
    except RefusedError as error:
        if error.code != WouldForget.code or args.json or not may_ask():
            raise
        if not agrees(f"{error}."):
            err().print("nothing was changed")
            return None
    return ask(args, "mission", payload=encode_json(asked | {"discard": True}))


def _order(args: argparse.Namespace) -> dict[str, object]:
    """Return the order as a document; it is checked here, so that faults need no daemon."""
    options = {
        "zones": args.zone,
        "keep_out": args.keep_out,
        "passes": None if args.passes is None else passes_document(len(args.passes), args.passes),
        "return_home": args.return_home,
        "keep_covered": args.keep_covered,
        "until_min": args.until_min,
    }
    # Not by truth: 0 passes are a fault to report.
    given = {
        name: value for name, value in options.items() if value is not None and value is not False
    }
    if args.order is None:
        return order_document(read_order(given))
    if given:
        options_given = ("zone" if name == "zones" else name.replace("_", "-") for name in given)
        names = ", ".join(f"--{name}" for name in options_given)
        raise OrderError(f"--order says it all, got {names} with it", hint="put them into the file")
    return order_document(read_order_file(args.order))


def _zone(text: str) -> dict[str, object]:
    name, colon, corners = text.partition(":")
    if not name or (not colon and ";" in name):  # corners without a name
        raise argparse.ArgumentTypeError(f"must be NAME or NAME:x,y;x,y;..., got {text!r}")
    return {"name": name, "polygon": polygon(corners)} if colon else {"name": name}


COMMAND = Command(
    description="Command the mission of a running daemon over Zenoh, and show its progress.",
    run=run,
    add_options=_add_commands,
    epilog=EPILOG,
    is_group=True,
)
