"""``fasaco-edge mission ... --fleet``: one command to every robot of a fleet, and its answers."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.table import Table

from fasaco_edge.cli.ask import nobody_answers
from fasaco_edge.cli.console.arguments import Exit, robot_on_bus
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import out
from fasaco_edge.errors import NobodyAnswersError
from fasaco_edge.text import one_line
from fasaco_edge.watch import phrases
from fasaco_edge.wire.documents import replies
from fasaco_edge.wire.documents.json_text import decode_json, decode_tolerant
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import VERSION, Keys, is_chunk

if TYPE_CHECKING:
    from fasaco_edge.bus.queries import Reply
    from fasaco_edge.bus.session import Bus


@dataclass(frozen=True, slots=True)
class _Member:
    """A robot of the fleet, and its answer; None where it gave none."""

    robot: str
    answer: Reply | None

    @property
    def has_taken(self) -> bool:
        return self.answer is not None and not self.answer.is_error


def command_fleet(args: argparse.Namespace, payload: bytes) -> int:
    """Send a command to each robot of the fleet, and show the answers; 0 if all have taken it.

    Raises:
        NobodyAnswersError: no robot of this fleet answers.
        BusUnavailable: nobody listens at the endpoint.
    """
    from fasaco_edge.bus.session import open_bus

    keys, settings, _ = robot_on_bus(args)
    with open_bus(settings) as bus:
        robots = _robots(bus, keys, args.fleet, args.timeout)
        members = []
        for robot in robots:
            found = bus.get(Keys(robot, keys.base).rpc("mission"), args.timeout, payload)
            members.append(_Member(robot, found[0] if found else None))
    if args.json:
        print_json({member.robot: _document(member) for member in members})
    else:
        out().print(_table(args.fleet, members))
    return Exit.OK if all(member.has_taken for member in members) else Exit.ERROR


def _robots(bus: Bus, keys: Keys, fleet: str, timeout_s: float) -> list[str]:
    """Return the names of the robots of a fleet, in order."""
    found = bus.get(f"{keys.base}/{VERSION}/*/@rpc/status", timeout_s)
    statuses = [decode_tolerant(reply.payload, Status) for reply in found if not reply.is_error]
    names = {status.robot for status in statuses if _fleet(status) == fleet}
    if robots := sorted(name for name in names if is_chunk(name)):
        return robots
    fleets = one_line(", ".join(sorted({_fleet(status) for status in statuses} - {""})))
    if not statuses:
        raise nobody_answers(f"{keys.base}/{VERSION}/*", ())
    raise NobodyAnswersError(
        f"no robot of a fleet {one_line(fleet)!r} answers",
        hint=f"{len(statuses)} robots answer, of these fleets: {fleets or 'none'}; "
        "`fleet: {name: ...}` in its configuration makes a robot one of a fleet",
    )


def _fleet(status: Status) -> str:
    return status.fleet.name if status.fleet else ""


def _document(member: _Member) -> dict[str, object] | None:
    return None if member.answer is None else decode_json(member.answer.payload)


def _table(fleet: str, members: list[_Member]) -> Table:
    title = f"Fleet {one_line(fleet)}"
    table = Table("robot", "state", "covered", "answer", title=title, title_justify="left")
    for member in members:
        table.add_row(one_line(member.robot), *_cells(member.answer))
    return table


def _cells(reply: Reply | None) -> tuple[str, str, str]:
    if reply is None:
        return "-", "-", "no answer"
    if reply.is_error:
        error = decode_tolerant(reply.payload, replies.Error)
        return "-", "-", one_line(f"refused: {error.message}")
    answer = decode_tolerant(reply.payload, replies.Reply)
    covered = phrases.covered(answer.coverage) if answer.coverage else "-"
    return one_line(answer.state), covered, one_line(answer.reason)
