"""The orders of a recording: for each the period in which it was in force, and its result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import msgspec

from fasaco_edge.grid.geometry import Polygon
from fasaco_edge.mission.orders.order import (
    MissionOrder,
    OrderDocument,
    ZoneDocument,
    order_document,
)
from fasaco_edge.mission.orders.passes import passes_words
from fasaco_edge.recording.scene.runcard import cells_of
from fasaco_edge.review.moments import Replans, Span
from fasaco_edge.review.run_data import RunData
from fasaco_edge.states import Activity, states_of
from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.replies import UnreachedArea, ZoneReport

ENDS = ("cancel", "reset")
# States without an order in force: in these states even an equal order begins anew.
OVER = states_of(Activity.NONE, Activity.NONE)
# States without work, before a mission or in a gap of the recording.
NOT_BEGUN = {*states_of(Activity.NONE, Activity.STARTING), "silent"}


@dataclass(frozen=True, slots=True)
class OrderChapter:
    """An order, from its command to the next one; see ``ReviewDocument.orders``."""

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
    """A command: time [s] and text."""

    at_s: float
    command: str


def commands_of(data: RunData) -> list[CommandThen]:
    """Return the commands of a recording, in order."""
    found = []
    for at_s, command in data.commands:
        words: str = command.name
        if command.name == "start":
            words = f"start: {order_words(_document(command.order))}"
        elif command.keep_out is not None:
            words = f"{words} {one_line(command.keep_out.name)}"
        elif command.room is not None:
            words = f"{words} {command.room.id}"
        found.append(CommandThen(round(at_s, 3), words))
    return found


def _document(order: MissionOrder) -> OrderDocument:
    return msgspec.convert(order_document(order), OrderDocument)


def order_words(order: OrderDocument) -> str:
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
    """Return the orders of a recording, one or more, in order of time.

    Args:
        data: data of the recording's samples.
        states: states of the mission, in order.
        end_s: end of the recording [s].
    """
    held = list(_held(data, states, end_s))
    return tuple(
        _chapter(data, states, *one)
        for one in held
        # The period before the first command counts only if the mission was at work.
        if len(held) == 1 or one[4] is not None or _has_begun(states, one[1], one[2])
    )


def ordered_words(orders: Sequence[OrderChapter]) -> str:
    """Return the zones whose floor was counted, as " of A and B"; "" if all floor was."""
    asked = [order.order.zones if order.order else [] for order in orders]
    names = dict.fromkeys(one_line(zone.name) for zones in asked for zone in zones)
    return f" of {' and '.join(names)}" if names and all(asked) else ""


def ordered_zones(data: RunData, orders: Sequence[OrderChapter]) -> tuple[Polygon, ...]:
    """Return the polygons of all ordered zones [m]; () if one order was for everything."""
    found: tuple[Polygon, ...] = ()
    for order in orders:
        zones = _zones(data, order.at_s, order.until_s)
        if not zones:
            return ()
        found += tuple(zone.polygon for zone in zones if zone.polygon)
    return found


def _zones(data: RunData, begin_s: float, end_s: float) -> tuple[ZoneReport, ...]:
    """Return the zones of the last status with zones between two times [s]; () for none."""
    reported = (
        each.status.mission.zones
        for each in reversed(data.statuses)
        if begin_s <= each.at_s <= end_s
    )
    return next(filter(None, reported), ())


def _by_zones(zones: Sequence[ZoneReport]) -> OrderDocument | None:
    """Rebuild an order that was not recorded from its reported zones; None without zones."""
    asked = [ZoneDocument(zone.name, list(zone.polygon) or None, zone.passes) for zone in zones]
    return OrderDocument(asked) if asked else None


def _held(
    data: RunData, states: Sequence[Span], end_s: float
) -> Iterator[tuple[str, float, float, str | None, MissionOrder | None]]:
    """Yield for each order its source, beginning and end [s], ending command, content."""
    # An order may be older than the recording: then only the first statuses say who gave it.
    first_s = next((at_s for at_s, command in data.commands if command.name == "start"), end_s)
    reported = (each.status.mission.ordered for each in data.statuses if each.at_s < first_s)
    source = next(filter(None, reported), None)
    ordered, began, order = source or "itself", 0.0, None
    # A mission that has begun by itself is equal to an order for everything.
    present = MissionOrder() if source == "itself" else None
    is_open = True
    for at_s, (name, given, *_) in data.commands:
        is_the_same = name == "start" and is_open and present == given
        if is_the_same and _state_at(states, at_s) not in OVER:
            continue
        if name == "start" or (name in ENDS and is_open):
            if is_open:
                yield ordered, began, at_s, name, order
            ordered, began, order, is_open = "command", at_s, given, name == "start"
            present = order
    if is_open:
        yield ordered, began, end_s, None, order


def _state_at(states: Sequence[Span], at_s: float) -> str:
    """Return the last state before a time [s]; "" for none."""
    names = [span.name for span in states if span.begin_s < at_s and span.name != "silent"]
    return names[-1] if names else ""


def _has_begun(states: Sequence[Span], begin_s: float, end_s: float) -> bool:
    during = (span for span in states if span.begin_s < end_s and span.end_s > begin_s)
    return any(span.name not in NOT_BEGUN for span in during)


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
    counted = [cells for status in statuses if (cells := cells_of(status)) is not None]
    covered, coverable = counted[-1] if counted else (None, None)
    complete: bool | None = None
    if state and (state != "done" or counted):
        complete = state == "done" and bool(covered) and covered == coverable
    paused_s = sum(
        max(min(span.end_s, end_s) - max(span.begin_s, begin_s), 0.0)
        for span in states
        if span.name == "paused"
    )
    times = data.times[1:]
    paths = [path for path in data.paths if begin_s <= path.at_s < until]
    zones = _zones(data, begin_s, until)
    return OrderChapter(
        ordered,
        begin_s,
        end_s,
        ended_by,
        state or None,
        complete,
        covered,
        coverable,
        order=_document(order) if order else _by_zones(zones),
        replans=len(Replans.of(paths).later),
        paused_s=round(paused_s, 3),
        driven_m=round(float(data.ways_m[(times >= begin_s) & (times < until)].sum()), 2),
        unreached=list(statuses[-1].mission.unreached.areas) if statuses else [],
    )
