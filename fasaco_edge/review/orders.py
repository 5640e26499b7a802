"""The orders of a recording, one section each: when it was in force, and its result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.mission.orders.order import MissionOrder, OrderDocument, order_document
from fasaco_edge.mission.orders.passes import passes_words
from fasaco_edge.review.moments import Span
from fasaco_edge.review.run_data import RunData, StatusSample
from fasaco_edge.wire.documents.replies import UnreachedArea

# Samples this soon after a status are of the same step, by the recorder's clock [s].
SAME_STEP_S = 1.5
ENDS = ("cancel", "reset")
# States in which an order is over, or there is none: the same order would start again.
OVER = ("done", "idle")


@dataclass(frozen=True, slots=True)
class OrderChapter:
    """An order, from its command to the next one.

    Attributes:
        ordered: "command", or "itself" for one that was given before the recording.
        at_s, until_s: period in force [s].
        ended_by: "cancel" or "reset"; "start" if another replaced it; None for the end of the
            recording.
        state: of the mission, the last one; None without any.
        covered_cells, coverable_cells: by the last status; None if that is outdated.
        complete: whether it reached ``done`` with nothing missing; None if not recorded.
        order: its content as in a command; None for one from before the recording.
        replans: paths from a plan while it was in force.
        paused_s: time paused [s].
        driven_m: distance driven meanwhile, without jumps [m].
        unreached: uncovered areas by its last status: position, area and reason of each.
    """

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


def chapters(
    data: RunData, states: Sequence[Span], fractions: NDArray[np.float64], end_s: float
) -> tuple[OrderChapter, ...]:
    """Return the chapters of a recording, in order; one at least.

    Args:
        data: of its samples.
        states: of the mission, in order.
        fractions: float64 (n, 2), when [s], and the covered share as the daemon published it.
        end_s: of the recording [s].
    """
    held = list(_held(data, states, end_s))
    track = data.track[:, :2]
    ways = np.hypot(*np.diff(track, axis=0).T) if len(track) > 1 else np.zeros(0)
    ways[ways > data.jump_m] = 0.0
    return tuple(
        _chapter(data, states, fractions, ways, *one)
        for one in held
        # Before the first command there may have been nothing.
        if len(held) == 1 or one[0] == "command" or _has_begun(states, one[1], one[2])
    )


def is_complete(state: str, sample: StatusSample | None, covered: int, coverable: int) -> bool:
    """Return whether an order is done with nothing left uncovered."""
    if state != "done":
        return False
    zones = sample.status.mission.zones if sample else ()
    if zones:
        return all(zone.covered == zone.cells for zone in zones)
    return covered == coverable > 0


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
    fractions: NDArray[np.float64],
    ways: NDArray[np.float64],
    ordered: str,
    begin_s: float,
    end_s: float,
    ended_by: str | None,
    order: MissionOrder | None,
) -> OrderChapter:
    until = end_s if ended_by else float("inf")
    state = _state_at(states, until)
    counted = [
        each
        for each in data.statuses
        if begin_s <= each.at_s < until and each.status.coverage is not None
    ]
    own = fractions[(fractions[:, 0] >= begin_s) & (fractions[:, 0] < until)]
    last = counted[-1] if counted and is_still_true(counted[-1], own, data.time_scale) else None
    coverage = last.status.coverage if last else None
    covered, coverable = (coverage.covered, coverage.coverable) if coverage else (None, None)
    complete: bool | None = None
    if state and state != "done":
        complete = False
    elif state and covered is not None and coverable is not None:
        complete = is_complete(state, last, covered, coverable)
    times = data.times[1:]
    reports = [each.status for each in data.statuses if begin_s <= each.at_s < until]
    return OrderChapter(
        ordered,
        begin_s,
        end_s,
        ended_by,
        state or None,
        complete,
        covered,
        coverable,
        order=msgspec.convert(order_document(order), OrderDocument) if order else None,
        replans=sum(
            begin_s <= path.at_s < until for path in data.paths if path.about.planner is not None
        ),
        paused_s=sum(
            max(min(span.end_s, end_s) - max(span.begin_s, begin_s), 0.0)
            for span in states
            if span.name == "paused"
        ),
        driven_m=round(float(ways[(times >= begin_s) & (times < until)].sum()), 2),
        unreached=list(reports[-1].mission.unreached.areas) if reports else [],
    )


def is_still_true(sample: StatusSample, fractions: NDArray[np.float64], scale: float) -> bool:
    """Return whether the covered share has not changed since a status came.

    The curve is drawn up to two seconds late, its last point at the end of the recording: after the
    end of an order, which covers no more, it says nothing. ``scale``: seconds of the robot, in
    which the times are, per second.
    """
    if sample.status.state in OVER:
        return True
    until_s = sample.at_s + scale * SAME_STEP_S
    later = fractions[fractions[:, 0] > until_s]
    then = fractions[fractions[:, 0] <= until_s]
    return not len(later) or (len(then) > 0 and bool((later[:, 1] == then[-1, 1]).all()))
