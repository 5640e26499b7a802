"""``fasaco-edge rooms``: the rooms of a running daemon, listed, named, split, merged and set."""

from __future__ import annotations

import argparse

from fasaco_edge.cli.ask import add_question, ask, show_rooms
from fasaco_edge.cli.console.arguments import Exit, Subcommand, add_common, pair_of_floats
from fasaco_edge.cli.console.checked_options import naming_options
from fasaco_edge.cli.console.pass_option import WORDS, add_passes
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import out
from fasaco_edge.cli.geojson import rooms_collection
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.mission.orders.commands import read_command
from fasaco_edge.mission.orders.passes import passes_document
from fasaco_edge.wire.documents.json_text import decode_json, decode_tolerant, encode_json
from fasaco_edge.wire.documents.rooms import Rooms

EPILOG = """\
examples:
  fasaco-edge rooms list
  fasaco-edge rooms list --geojson > rooms.geojson   for a drawing program, or as an order
  fasaco-edge rooms name 3 kitchen
  fasaco-edge rooms name kitchen ""                  removes the name
  fasaco-edge rooms split kitchen 1.5,0 1.5,3.2      from wall to wall, [m] in the map frame
  fasaco-edge rooms merge kitchen 5 --name "living room"
  fasaco-edge rooms set kitchen --passes auto,cross  for orders that give no passes
  fasaco-edge rooms set bath --skip                  orders for everything leave it out
  fasaco-edge rooms set kitchen --priority 90        comes first if time is short
  fasaco-edge mission start --zone kitchen --zone "room 5"

The daemon finds rooms on its map by itself, also without an order. Each room has a number of its
own, which is never used again; ROOM is this number, the name, or "room 3". Names, splits, merges
and settings are kept when maps change, and after restarts and resets; new maps do not split or
merge such rooms again.

exit codes: 0 done; 1 refused, or no answer; 2 usage error; 78 invalid robot name
"""

ACTIONS = {
    "list": "show the rooms: number, name, area, swept share, neighbours and settings",
    "name": "give a room a name, or remove its name",
    "split": "split a room along a line from wall to wall",
    "merge": "merge rooms that a passage connects",
    "set": "set passes, priority, or skipping of a room",
}


def _add_actions(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name, text in ACTIONS.items():
        described = f"{text[0].upper()}{text[1:]}."
        action = actions.add_parser(name, help=text, description=described)
        action.set_defaults(rooms_action=name)
        if name != "list":
            action.add_argument("room", type=_room, metavar="ROOM", help="its number or name")
        _ADD_OPTIONS[name](action)
        add_common(action)
        add_question(action)


def _add_name(action: argparse.ArgumentParser) -> None:
    text = 'the name, which no other room may have; "" removes it'
    action.add_argument("name", metavar="NAME", help=text)


def _add_split(action: argparse.ArgumentParser) -> None:
    for end in ("start", "end"):
        action.add_argument(end, type=pair_of_floats, metavar="X,Y", help=f"{end} of the line [m]")


def _add_merge(action: argparse.ArgumentParser) -> None:
    action.add_argument(
        "others", nargs="+", type=_room, metavar="ROOM", help="the rooms to merge with it"
    )
    action.add_argument("--name", metavar="NAME", help="name of the merged room")


def _add_set(action: argparse.ArgumentParser) -> None:
    add_passes(
        action, f"passes of orders that name this room without passes: their number, or {WORDS}"
    )
    action.add_argument(
        "--skip",
        action=argparse.BooleanOptionalAction,
        help="leave it out of orders for everything, or include it again",
    )
    action.add_argument(
        "--priority",
        type=int,
        metavar="0..100",
        help="rooms of higher priority come first if time or battery are short (default: 50)",
    )


def _add_list(action: argparse.ArgumentParser) -> None:
    action.add_argument(
        "--geojson",
        action="store_true",
        help="print polygons as GeoJSON, in metres in the frame of the map",
    )


_ADD_OPTIONS = {
    "list": _add_list,
    "name": _add_name,
    "split": _add_split,
    "merge": _add_merge,
    "set": _add_set,
}


def _room(text: str) -> int | str:
    return int(text) if text.isascii() and text.isdigit() else text


def run(args: argparse.Namespace) -> int:
    """List the rooms, or send a command that changes them."""
    if args.rooms_action != "list":
        asked = _asked(args)
        with naming_options(args, {"room.passes": "passes", "room.priority": "priority"}):
            read_command(asked)  # faults are reported without a daemon
        reply = ask(args, "mission", payload=encode_json(asked))
        if args.json:
            print_json(decode_json(reply.payload))
        else:
            out().print("done")
        return Exit.OK
    reply = ask(args, "rooms")
    if args.geojson:
        print_json(rooms_collection(decode_tolerant(reply.payload, Rooms)))
    elif args.json:
        print_json(decode_json(reply.payload))
    else:
        show_rooms(decode_tolerant(reply.payload, Rooms))
    return Exit.OK


def _asked(args: argparse.Namespace) -> dict[str, object]:
    room: dict[str, object] = {"id": args.room}
    match args.rooms_action:
        case "name":
            room |= {"name": args.name}
        case "split":
            room |= {"cut": [args.start, args.end]}
        case "merge":
            room |= {"others": args.others} | ({"name": args.name} if args.name else {})
        case "set":
            if args.passes is None and args.skip is None and args.priority is None:
                raise BadConfiguration(
                    "nothing to set: --passes, --priority, --skip or --no-skip must be given",
                    hint="fasaco-edge rooms set --help",
                )
            if args.passes is not None:
                room["passes"] = passes_document(len(args.passes), args.passes)
            if args.skip is not None:
                room["skip"] = args.skip
            if args.priority is not None:
                room["priority"] = args.priority
    return {"command": f"room_{args.rooms_action}", "room": room}


COMMAND = Subcommand(
    description="Show the rooms of a running daemon, and change their names, borders and settings.",
    run=run,
    add_options=_add_actions,
    epilog=EPILOG,
    is_group=True,
)
