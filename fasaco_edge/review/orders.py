"""The orders of a recording, one section each: when it was in force, and its result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import msgspec

from fasaco_edge.mission.orders.order import MissionOrder, OrderDocument, order_document
from fasaco_edge.mission.orders.passes import passes_words
from fasaco_edge.review.moments import Span
from fasaco_edge.review.run_data import RunData
from fasaco_edge.wire.documents.replies import UnreachedArea
from fasaco_edge.wire.documents.status import Status

ENDS = ("cancel", "reset")
# States in which an order is over, or there is none: the same order would start again.
OVER = ("done", "idle")


@dataclass(frozen=True, slots=True)
class OrderChapter:
    """An order, from its command to the next one; ``ReviewDocument`` describes its members."""

    ordered: str
    at_s: float
    until_s: float
    ended_by: str | None
    state: str | None
    complete: bool | None
    covered_cells: int | None
    coverable_cells: int | None
    order: OrderDocument | None = None
    replans: int = 0
    paused_s: float = 0.0
    driven_m: float = 0.0
    unreached: list[UnreachedArea] = field(default_factory=list)


class CommandThen(msgspec.Struct):
    """A command: its time [s] and its text."""

    at_s: float
    command: str


def commands_of(data: RunData) -> list[CommandThen]:
    """Return the commands of a recording, in order."""
    return [
        CommandThen(round(at_s, 3), command_words(name, order))
        for at_s, name, order in data.commands
    ]


def command_words(name: str, order: MissionOrder) -> str:
    """Return a command in words, with its order."""
    if name != "start":
        return name
    return f"start: {order_words(msgspec.convert(order_document(order), OrderDocument))}"


def order_words(order: OrderDocument) -> str:
    """Return an order in words."""
    asked = [f"zone {zone.name}" + passes_words(zone.passes or 1) for zone in order.zones] or [
        "everything" + passes_words(order.passes or 1)
    ]
    if order.keep_out:
        corners = "; ".join(
            " ".join(f"({x:g}, {y:g})" for x, y in polygon) for polygon in order.keep_out
        )
        asked.append(f"keep out of {corners}")
    asked += ["return home"] * order.return_home + ["keep what is covered"] * order.keep_covered
    asked += [f"at most {order.until_min:g} min"] if order.until_min else []
    return ", ".join(asked)


def chapters(data: RunData, states: Sequence[Span], end_s: float) -> tuple[OrderChapter, ...]:
    """Return the chapters of a recording, in order; one at least.

    Args:
        data: of its samples.
        states: of the mission, in order.
        end_s: of the recording [s].
    """
    held = list(_held(data, states, end_s))
    return tuple(
        _chapter(data, states, *one)
        for one in held
        # Before the first command there may have been nothing.
        if len(held) == 1 or one[0] == "command" or _has_begun(states, one[1], one[2])
    )


def _is_complete(status: Status) -> bool:
    """Return whether an order is done with nothing left uncovered, by its last status."""
    if zones := status.mission.zones:
        return all(zone.covered == zone.cells for zone in zones)
    count = status.coverage
    return count is not None and count.covered == count.coverable > 0


def _held(
    data: RunData, states: Sequence[Span], end_s: float
) -> Iterator[tuple[str, float, float, str | None, MissionOrder | None]]:
    """Yield each order with its source, its period in force [s] and its end."""
    ordered, began, order = "itself", 0.0, None
    is_open = True
    for at_s, name, given in data.commands:
        if name == "start" and is_open and _goes_on(order, given, _state_at(states, at_s)):
            continue
        if name == "start" or (name in ENDS and is_open):
            if is_open:
                yield ordered, began, at_s, name, order
            ordered, began, order, is_open = "command", at_s, given, name == "start"
    if is_open:
        yield ordered, began, end_s, None, order


def _goes_on(order: MissionOrder | None, given: MissionOrder, state: str) -> bool:
    return order is not None and order == given and state not in OVER


def _state_at(states: Sequence[Span], at_s: float) -> str:
    """Return the last state before a time [s]; "" without any."""
    names = [span.name for span in states if span.begin_s < at_s and span.name != "silent"]
    return names[-1] if names else ""


def _has_begun(states: Sequence[Span], begin_s: float, end_s: float) -> bool:
    idle = (*OVER, "loading", "waiting for map", "waiting for pose", "silent")
    return any(
        span.name not in idle and span.begin_s < end_s and span.end_s > begin_s for span in states
    )


def _chapter(
    data: RunData,
    states: Sequence[Span],
    ordered: str,
    begin_s: float,
    end_s: float,
    ended_by: str | None,
    order: MissionOrder | None,
) -> OrderChapter:
    until = end_s if ended_by else float("inf")
    state = _state_at(states, until)
    statuses = [each.status for each in data.statuses if begin_s <= each.at_s < until]
    counted = [status for status in statuses if status.coverage is not None]
    complete: bool | None = None
    if state and (state != "done" or counted):
        complete = state == "done" and _is_complete(counted[-1])
    count = counted[-1].coverage if counted else None
    times = data.times[1:]
    return OrderChapter(
        ordered,
        begin_s,
        end_s,
        ended_by,
        state or None,
        complete,
        count.covered if count else None,
        count.coverable if count else None,
        order=msgspec.convert(order_document(order), OrderDocument) if order else None,
        replans=sum(
            begin_s <= path.at_s < until for path in data.paths if path.about.planner is not None
        ),
        paused_s=sum(
            max(min(span.end_s, end_s) - max(span.begin_s, begin_s), 0.0)
            for span in states
            if span.name == "paused"
        ),
        driven_m=round(float(data.ways_m[(times >= begin_s) & (times < until)].sum()), 2),
        unreached=list(statuses[-1].mission.unreached.areas) if statuses else [],
    )
