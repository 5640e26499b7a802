"""``fasaco-edge mission``: commands to one daemon or to those of a fleet, and their progress."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from fasaco_edge.cli.ask import RefusedError, add_question, ask, show_mission
from fasaco_edge.cli.console.arguments import Exit, Subcommand, add_common, fleet_name
from fasaco_edge.cli.console.checked_options import naming_options
from fasaco_edge.cli.console.pass_option import WORDS, add_passes
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import agrees, err, may_ask
from fasaco_edge.cli.geojson import read_order_file
from fasaco_edge.cli.mission.keep_outs import (
    add_actions,
    asked_by,
    names_of,
    polygon,
    show_keep_outs,
)
from fasaco_edge.errors import OrderError, WouldForget
from fasaco_edge.mission.orders.commands import FORGETFUL
from fasaco_edge.mission.orders.order import order_document, read_order
from fasaco_edge.mission.orders.passes import passes_document
from fasaco_edge.wire.documents.json_text import decode_json, decode_tolerant, encode_json
from fasaco_edge.wire.documents.replies import Reply

if TYPE_CHECKING:
    from fasaco_edge.bus.queries import QueryReply

NO_MAP = "there is no map yet: `mission status` shows later whether known floor lies in the area"
ROOMS_KEPT = (
    "rooms keep names, borders and settings, and keep-outs stay; in another building with the same "
    "map frame, stop the daemon, delete <robot>.rooms.json beside the ledger, and start it"
)
KEPT = "what is covered is kept: `mission start --keep-covered` covers the rest"

EPILOG = """\
examples:
  fasaco-edge mission status
  fasaco-edge mission start                         all floor that the robot can reach
  fasaco-edge mission start --passes 2 --return-home
  fasaco-edge mission start --passes edge,auto,cross@0.15   a lap along walls, lanes, lanes across
  fasaco-edge mission start --zone "kitchen:0,0;4,0;4,3;0,3" --zone "hall:4,0;6,0;6,9;4,9"
  fasaco-edge mission start --zone kitchen          a zone of the configuration, or a room
  fasaco-edge mission start --until-min 40          home after 40 minutes
  fasaco-edge mission start --keep-out "1,1;2,1;2,2;1,2"
  fasaco-edge mission start --order evening.yaml
  fasaco-edge mission start --fleet building_7      for each of its robots: they share the floor
  fasaco-edge mission pause && fasaco-edge mission resume
  fasaco-edge mission keep-out add --name vase "1,1;2,1;2,2;1,2"   during a mission; nothing is lost

evening.yaml, or the same as JSON; all lengths in metres in the frame of the map:
  zones:                # in this order; without any: all reachable floor
    - name: kitchen
      polygon: [[0, 0], [4, 0], [4, 3], [0, 3]]
      passes: 2
    - name: hall        # no polygon: a room, or one of mission.zones
  keep_out:             # in addition to mission.keep_out
    - [[1, 1], [2, 1], [2, 2], [1, 2]]
  passes: 1             # for zones without passes; or a list:
                        # [edge, auto, {lanes: cross, speed_m_s: 0.15}]
  return_home: true     # to mission.home, mission.dock, or the start
  keep_covered: false   # true: the first pass skips covered floor
  unknown: refuse       # wait: until a room has the zone's name
  until_min: 40         # time limit [min]; then the robot is home

evening.geojson, as a drawing program writes it: each polygon is a zone with the properties name and
passes; with "keep_out": true it is a keep-out. Coordinates are metres in the frame of the map.

Each pass covers all its floor again; only the pass `rest` leaves out what the pass `edge` covered.
A restart of the daemon keeps the order, its progress, and whether it is paused. Without an order
the daemon covers everything by itself (mission.autostart of its configuration).

A new order and a reset forget the progress of an order that is not over. On a terminal they say how
much that is, and ask first; elsewhere they need --yes. `start --keep-covered` keeps the progress
and covers the rest. A reset keeps keep-outs, and names, borders and settings of rooms. To forget
rooms, as in another building with the same map frame, stop the daemon, and delete
<robot>.rooms.json beside the ledger.

With --fleet each robot of the fleet gets the command, also a robot from which the others received
messages within the last ten minutes. If a robot refuses or does not answer, the others still obey,
and the exit code is 1; a robot that has not answered may still drive. The robots share each zone.
Corners are in the frame of each robot's own map: with fleet.frame use the zones and keep-outs of
the configurations.

exit codes: 0 done; 1 refused, or no answer, by at least one robot; 2 usage error; 78 invalid robot
name
"""

COMMANDS = {
    "start": "start an order in place of the current one; an equal order continues",
    "pause": "stop the robot; what it passes over still counts as covered",
    "resume": "continue after a pause: the order, or the drive home or to the dock",
    "home": "drive home and stay there; `resume` continues the order",
    "cancel": "stop and drop the order; what is covered is kept",
    "stop": "the same as cancel; to continue the order later, use pause",
    "replan": "plan everything again now, starting from the current path",
    "reset": "stop and drop the order and what is covered; rooms keep their names",
    "keep-out": "add, remove or list keep-outs, also during a mission",
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
                help="forget what is covered without asking; scripts need this",
            )
        _add_receiver(command)


def _add_receiver(parser: argparse.ArgumentParser) -> None:
    """Add the options of all commands: the robots, and the form of their answers."""
    add_common(parser)
    parser.add_argument(
        "--fleet",
        type=fleet_name,
        metavar="NAME",
        help="command each robot of this fleet (`fleet.name` of its configuration)",
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
        help="area to cover: corners [m], or the name of a room or of a zone of the daemon's "
        "configuration; may be repeated, and is covered in this order",
    )
    parser.add_argument(
        "--keep-out",
        type=polygon,
        action="append",
        metavar="X,Y;X,Y;...",
        help="area that the robot must not touch, in addition to those of the daemon's "
        "configuration; may be repeated",
    )
    add_passes(parser, f"number of passes, or {WORDS} (default: 1)")
    parser.add_argument(
        "--return-home",
        action="store_true",
        help="drive home at the end, or to the start of the mission",
    )
    parser.add_argument(
        "--keep-covered", action="store_true", help="skip covered floor in the first pass"
    )
    parser.add_argument(
        "--until-min",
        type=float,
        metavar="MIN",
        help="time limit [min], at which the robot is home again; a robot in its dock, or on its "
        "way there, ends in the dock, a paused one stays where it is; 0 for no limit (default: "
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


def _answer(args: argparse.Namespace, asked: dict[str, object]) -> QueryReply | None:
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
    # Compared with None, as 0 passes are a fault to report.
    given = {
        name: value for name, value in options.items() if value is not None and value is not False
    }
    if args.order is None:
        with naming_options(args, {"passes": "passes", "until_min": "until_min"}):
            return order_document(read_order(given))
    if given:
        options_given = ("zone" if name == "zones" else name.replace("_", "-") for name in given)
        names = ", ".join(f"--{name}" for name in options_given)
        raise OrderError(
            f"--order must be the only option for the order, got {names}",
            hint="put them into the file",
        )
    return order_document(read_order_file(args.order))


def _zone(text: str) -> dict[str, object]:
    name, colon, corners = text.partition(":")
    if not name or (not colon and ";" in name):  # corners without a name
        raise argparse.ArgumentTypeError(f"must be NAME or NAME:x,y;x,y;..., got {text!r}")
    return {"name": name, "polygon": polygon(corners)} if colon else {"name": name}


COMMAND = Subcommand(
    description="Command the mission of a running daemon over Zenoh, and show its progress.",
    run=run,
    add_options=_add_commands,
    epilog=EPILOG,
    is_group=True,
)
