"""``fasaco-edge mission ... --fleet``: one command to all robots of a fleet, and their answers."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.table import Table

from fasaco_edge.cli.ask import nobody_answers
from fasaco_edge.cli.console.arguments import Exit, robot_on_bus
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import agrees, may_ask, out
from fasaco_edge.client import phrases
from fasaco_edge.errors import MalformedMessage, NobodyAnswersError, WouldForget
from fasaco_edge.text import one_line
from fasaco_edge.wire.documents import replies
from fasaco_edge.wire.documents.json_text import decode_json, decode_tolerant, encode_json, tolerant
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import VERSION, Keys, is_chunk
from fasaco_edge.wire.reasons import plain

if TYPE_CHECKING:
    from fasaco_edge.bus.queries import QueryReply
    from fasaco_edge.bus.session import Bus


# A silent robot gets the command, too, if others received a message from it within this time [s].
RECENT_S = 600.0
# Number of robots asked in parallel, so that a robot that does not answer delays no other.
AT_ONCE = 64


@dataclass(frozen=True, slots=True)
class _Member:
    """A robot's answer (``document``; None if invalid), and why it refused ("" if it accepted)."""

    robot: str
    document: dict[str, object] | None
    refused: str
    would_forget: bool = False


Shown = Callable[[replies.Reply], str]


def command_fleet(args: argparse.Namespace, asked: dict[str, object], shown: Shown | None) -> int:
    """Send a command to each robot of the fleet, and show the answers; 0 if all accept it.

    On a terminal, it asks for consent once if any robots would forget covered cells.

    Args:
        args: arguments of the command line.
        asked: the command as a document.
        shown: returns the text for the answer of a robot that accepts; None for "accepted" and the
            reason of the robot's state.

    Raises:
        NobodyAnswersError: no robot of this fleet answers.
        BusUnavailable: no process listens at the endpoint.
    """
    from fasaco_edge.bus.session import open_bus

    keys, settings, _ = robot_on_bus(args)
    with open_bus(settings) as bus:
        robots = _robots(bus, keys, args.fleet, args.timeout)

        def command(robots: list[str], asked: dict[str, object]) -> dict[str, _Member]:
            payload = encode_json(asked)

            def command_one(robot: str) -> _Member:
                key = Keys(robot, keys.base).rpc("mission")
                return _member(robot, bus.get(key, args.timeout, payload))

            with ThreadPoolExecutor(min(len(robots), AT_ONCE)) as pool:
                return {member.robot: member for member in pool.map(command_one, robots)}

        answers = command(robots, asked)
        losing = [member for member in answers.values() if member.would_forget]
        if losing and not args.json and may_ask():
            facts = [f"{one_line(member.robot)}: {one_line(member.refused)}" for member in losing]
            if agrees(*facts):
                more = [member.robot for member in losing]
                answers |= command(more, asked | {"discard": True})
        members = list(answers.values())
    if args.json:
        print_json({member.robot: member.document for member in members})
    else:
        # The reason explains the robot's state, which may have nothing to do with the command.
        accepted = "" if asked.get("command") == "status" else "accepted: "
        shown = shown or (lambda answer: f"{accepted}{plain(answer.reason)}".removesuffix(": "))
        out().print(_table(args.fleet, members, shown))
    return Exit.ERROR if any(member.refused for member in members) else Exit.OK


def _robots(bus: Bus, keys: Keys, fleet: str, timeout_s: float) -> list[str]:
    """Return the sorted names of the robots of a fleet.

    These are all robots that answer, and all robots that sent a message to one of them recently: a
    robot that does not answer, as it is frozen or has lost its network, may still drive.
    """
    statuses = []
    for reply in bus.get(f"{keys.base}/{VERSION}/*/@rpc/status", timeout_s):
        # An invalid status must not stop the command to the other robots.
        with suppress(MalformedMessage):
            statuses += [] if reply.is_error else [decode_tolerant(reply.payload, Status)]
    names = set[str]()
    for status in statuses:
        if status.fleet and status.fleet.name == fleet:
            members = (member for member in status.fleet.members if member.heard_s <= RECENT_S)
            names |= {status.robot, *(member.name for member in members)}
    if robots := sorted(name for name in names if is_chunk(name)):
        return robots
    fleets = one_line(", ".join(sorted({_fleet(status) for status in statuses} - {""})))
    if not statuses:
        raise nobody_answers(f"{keys.base}/{VERSION}/*", ())
    raise NobodyAnswersError(
        f"no robot of a fleet {one_line(fleet)!r} answers",
        hint=f"robots that answer: {len(statuses)}, of these fleets: {fleets or 'none'}; "
        "`fleet: {name: ...}` in the configuration of a robot makes it a member",
    )


def _fleet(status: Status) -> str:
    return status.fleet.name if status.fleet else ""


def _member(robot: str, found: list[QueryReply]) -> _Member:
    if not found:
        return _Member(robot, None, "no answer")
    try:
        document = decode_json(found[0].payload)
    except MalformedMessage as error:
        return _Member(robot, None, f"its answer cannot be read: {error}")
    if not found[0].is_error:
        return _Member(robot, document, "")
    refusal = tolerant(document, replies.Error)
    is_loss = refusal.code == WouldForget.code
    yes = "; to forget these cells, repeat the command with --yes" if is_loss else ""
    return _Member(robot, document, f"refused: {refusal.message}{yes}", is_loss)


def _table(fleet: str, members: list[_Member], shown: Shown) -> Table:
    title = f"Fleet {one_line(fleet)}"
    table = Table("robot", "state", "covered", "answer", title=title, title_justify="left")
    for member in members:
        table.add_row(one_line(member.robot), *_cells(member, shown))
    return table


def _cells(member: _Member, shown: Shown) -> tuple[str, str, str]:
    if member.refused or member.document is None:
        return "-", "-", one_line(member.refused)
    answer = tolerant(member.document, replies.Reply)
    covered = phrases.covered(answer.coverage) if answer.coverage else "-"
    return one_line(answer.state), covered, one_line(shown(answer))
