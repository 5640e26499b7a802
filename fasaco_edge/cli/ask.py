"""``fasaco-edge ask``: a query to a running daemon, and its answer as a table or as JSON."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from fasaco_edge.cli.console.arguments import (
    Exit,
    Subcommand,
    add_json,
    add_robot_on_bus,
    robot_on_bus,
    seconds,
)
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import figures, known, out
from fasaco_edge.client import phrases
from fasaco_edge.errors import FasacoError, NobodyAnswersError
from fasaco_edge.host.plain_yaml import dump
from fasaco_edge.mission.orders.room_requests import USUAL_PRIORITY
from fasaco_edge.text import duration, one_line, percent
from fasaco_edge.wire import schemas
from fasaco_edge.wire.documents import replies
from fasaco_edge.wire.documents.json_text import decode_json, decode_tolerant
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms
from fasaco_edge.wire.messages.maps import CoverageValue, decode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path
from fasaco_edge.wire.messages.pheromone import decode_pheromone
from fasaco_edge.wire.query_table import RPC_NAMES

if TYPE_CHECKING:
    from fasaco_edge.bus.queries import QueryReply

EPILOG = """\
examples:
  fasaco-edge ask status
  fasaco-edge ask path                      the length of the path, and why it was planned
  fasaco-edge ask pheromone                 the pheromone trail, and how dominant its directions are
  fasaco-edge ask replan                    plans everything again now
  fasaco-edge ask config --json

Commands are given with `fasaco-edge mission`; protocol/commands.md describes the queries and their
answers.

exit codes: 0 answered; 1 refused, or no answer; 2 usage error; 78 invalid robot name
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("question", choices=RPC_NAMES, metavar="NAME", help=", ".join(RPC_NAMES))
    add_question(parser)


def run(args: argparse.Namespace) -> int:
    """Ask, and show the answer."""
    reply = ask(args, args.question)
    if args.json:
        print_answer(reply)
    else:
        show(args.question, reply)
    return Exit.OK


TIMEOUT_S = 5.0


def nobody_answers(prefix: str, robots: Collection[str]) -> NobodyAnswersError:
    """Return the error for no answer at ``prefix``; ``robots``: names of robots with a daemon."""
    if prefix.rpartition("/")[2] in robots:
        return NobodyAnswersError(
            f"the daemon at {prefix} is on the bus, but has not answered in time",
            hint="its process may hang or be stopped: check the robot, then ask again",
        )
    names = one_line(", ".join(sorted(robots)))
    there = (
        f"robots on this bus: {names}; choose one by --robot" if names else "no robot on this bus"
    )
    return NobodyAnswersError(
        f"no daemon answers at {prefix}",
        hint=f"{there}; `fasaco-edge run` starts a daemon",
    )


class RefusedError(FasacoError):
    """The daemon's answer is an error."""

    def __init__(self, answer: replies.Error) -> None:
        super().__init__(one_line(answer.message), hint=one_line(answer.hint))
        self.code = answer.code


def add_question(parser: argparse.ArgumentParser) -> None:
    """Add options for the robot, the timeout, and the form of the answer."""
    add_json(parser, "the answer")
    parser.add_argument(
        "--timeout",
        type=seconds(),
        default=TIMEOUT_S,
        metavar="S",
        help="how long to wait for the answer (default: %(default)s)",
    )
    add_robot_on_bus(parser)


def ask(args: argparse.Namespace, name: str, payload: bytes = b"") -> QueryReply:
    """Return the answer to a query.

    Raises:
        RefusedError: the answer is an error; with ``--json`` it is printed first.
        NobodyAnswersError: there is no answer in time.
        BusUnavailable: no process listens at the endpoint.
    """
    from fasaco_edge.bus.session import open_bus

    keys, settings, _ = robot_on_bus(args)
    with open_bus(settings) as bus:
        found = bus.get(keys.rpc(name), args.timeout, payload)
        if not found:
            alive = bus.alive(f"{keys.base}/@v1/*/alive")
            raise nobody_answers(keys.prefix, {key.split("/")[-2] for key in alive})
    reply = found[0]
    if reply.is_error:
        if args.json:
            print_json(decode_json(reply.payload))
        raise RefusedError(decode_tolerant(reply.payload, replies.Error))
    return reply


def show_mission(reply: QueryReply) -> None:
    """Print state, mission and troubles of a status, or of the answer to a command."""
    answer = decode_tolerant(reply.payload, replies.Reply)
    mission, console = answer.mission, out()
    console.print(figures(_rows(answer)))
    if mission.zones:
        console.print(_zones(mission.zones))
    if mission.unreached.areas:
        console.print(_unreached(mission.unreached))
    if found := phrases.troubles(answer):
        console.print(figures([("trouble", f"{what}: {to_do}") for what, to_do in found]))


def _rows(answer: replies.Reply) -> list[tuple[str, str]]:
    mission = answer.mission
    rows = [("robot", answer.robot), ("state", answer.state)]
    if reason := phrases.reason(answer):
        rows.append(("reason", reason))
    if mission.ordered is not None:
        began = "begun by itself" if mission.ordered == "itself" else "as ordered"
        stage = phrases.stage(mission)
        rows.append(("mission", f"{stage}, {began}"))
    if answer.coverage is not None:
        # Zones have their own counts in a table below.
        of_all = " of all floor" if mission.zones else ""
        rows.append(("covered", phrases.covered(answer.coverage) + of_all))
    if answer.floor is not None:
        rows.append(("floor swept", phrases.swept(answer.floor)))
    if mission.keep_out:
        names = [each.name for each in mission.keep_outs if each.by == "operator"]
        named = f": {', '.join(names)}" if names else ""
        more = f", {rest} more" if names and (rest := mission.keep_out - len(names)) else ""
        rows.append(("keep-out zones", f"{mission.keep_out}{named}{more}"))
    if mission.return_home:
        home = mission.home
        rows.append(("home", f"({home.x:.2f}, {home.y:.2f}) m" if home else "not known yet"))
    return rows


def _zones(zones: Sequence[replies.ZoneReport]) -> Table:
    table = Table("zone", "pass", "covered", title="Zones", title_justify="left")
    for zone in zones:
        table.add_row(zone.name, *phrases.zone_progress(zone))
    return table


def _unreached(unreached: replies.UnreachedReport) -> Table:
    table = Table("cells", "m2", "at", "why", title="Not reached", title_justify="left")
    for area in unreached.areas:
        place = f"({area.x:.2f}, {area.y:.2f}) m"
        table.add_row(str(area.cells), f"{area.m2:.2f}", place, area.reason)
    if unreached.areas_left_out:
        table.caption = f"and {unreached.areas_left_out} smaller areas"
    return table


def show_rooms(rooms: Rooms) -> None:
    """Print rooms, one per line."""
    if not rooms.rooms:
        out().print("no rooms yet: they are found some seconds after the first map")
        return
    table = Table(
        *("room", "name", "m2", "swept", "to go", "beside", "settings"),
        title="Rooms",
        title_justify="left",
    )
    for room in rooms.rooms:
        beside = ", ".join(map(str, room.neighbours)) or "-"
        swept = "-" if room.swept is None else percent(room.swept)
        # 0 also for a room that the path does not enter.
        to_go = duration(room.to_go_s) if room.to_go_s else "-"
        row = f"{room.area_m2:.1f}", swept, to_go, beside, _settings(room)
        table.add_row(str(room.id), room.name or "-", *row)
    out().print(table)


def _settings(room: RoomReport) -> str:
    words = []
    if isinstance(room.passes, int):
        words.append(f"passes: {room.passes}")
    elif room.passes:
        each = (item if isinstance(item, str) else _pass_words(item) for item in room.passes)
        words.append(f"passes: {', '.join(each)}")
    words += ["skip"] * room.skip
    words += [] if room.priority == USUAL_PRIORITY else [f"priority: {room.priority}"]
    return "; ".join(words) or "-"


def _pass_words(members: dict[str, object]) -> str:
    return " ".join(f"{name} {value}" for name, value in sorted(members.items()))


def print_answer(reply: QueryReply) -> None:
    """Print a JSON payload, or the figures of a ROS message as JSON."""
    print_json(_figures(reply) if reply.schema else decode_json(reply.payload))


def show(name: str, reply: QueryReply) -> None:
    """Print the answer to query ``name``."""
    if reply.schema:
        # ``known`` leaves out null: a path without a plan has no figures of a plan.
        out().print(figures(known(_figures(reply))))
    elif name in ("status", "mission"):
        show_mission(reply)
    elif name == "rooms":
        show_rooms(decode_tolerant(reply.payload, Rooms))
    else:
        print(dump(decode_json(reply.payload)), end="")


def _figures(reply: QueryReply) -> dict[str, object]:
    match reply.schema:
        case schemas.PATH:
            return _path_figures(reply)
        case schemas.OCCUPANCY_GRID:
            return _coverage_figures(reply)
        case _:
            return _trail_figures(reply)


def _path_figures(reply: QueryReply) -> dict[str, object]:
    path = decode_path(reply.payload)
    length_m = float(np.hypot(*np.diff(path.xy, axis=0).T).sum())
    return {
        "frame": path.frame,
        "poses": len(path.xy),
        "length_m": round(length_m, 2),
        **decode_json(reply.attachment),
    }


def _coverage_figures(reply: QueryReply) -> dict[str, object]:
    grid = decode_occupancy_grid(reply.payload)
    return {
        "frame": grid.frame,
        "rows": grid.geometry.rows,
        "cols": grid.geometry.cols,
        "cell_m": grid.geometry.resolution,
        **{value.name.lower(): int((grid.cells == value).sum()) for value in CoverageValue},
    }


def _trail_figures(reply: QueryReply) -> dict[str, object]:
    trail = decode_pheromone(reply.payload)
    about = decode_json(reply.attachment) if reply.attachment else {}
    return {
        "frame": trail.frame,
        "rows": trail.geometry.rows,
        "cols": trail.geometry.cols,
        "cell_m": trail.geometry.resolution,
        **about,
        "ants": trail.ants,
        "best_steps": trail.best_steps,
        "trail_min": trail.trail_min,
        "trail_max": trail.trail_max,
    }


COMMAND = Subcommand(
    description="Query a running daemon over Zenoh and show the answer.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
