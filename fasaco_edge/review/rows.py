"""The figures of a review as rows of text: one table for terminal and page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from msgspec.structs import astuple

from fasaco_edge.review.drive import MILESTONES
from fasaco_edge.review.run_data import TakenPath
from fasaco_edge.review.setups import ANOTHER_PROBLEM, ANYWAY, do_compare, setup_differences
from fasaco_edge.wire.status import Rectangle

Row = tuple[str, str, str, str]
"""Name, the texts of one recording and of the other, and the difference; "" for none."""

NOT_KNOWN = "not known"
NUMBERS = (
    ("covered again", "recovered_cells", "cells"),
    ("out of reach", "unreachable_cells", "cells"),
    ("steps", "steps", ""),
    ("revisits", "revisits", ""),
    ("quarter-turns", "turns_90", ""),
    ("about-turns", "turns_180", ""),
    ("driven", "driven_m", "m"),
    ("paths published", "paths", ""),
    ("replans", "replans", ""),
    ("first plan", "first_plan_ms", "ms"),
    ("replan, median", "replan_ms_p50", "ms"),
    ("replan, p99", "replan_ms_p99", "ms"),
    ("replan, slowest", "replan_ms_max", "ms"),
    ("plans made", "plans", ""),
    ("plans that became no path", "plans_unused", ""),
    ("slowest plan", "plan_ms_max", "ms"),
    ("attempts at a better path", "attempts", ""),
    ("attempts that found one", "attempts_used", ""),
    ("memory of the daemon, most", "memory_mb_max", "MB"),
    ("memory of the recorder, most", "recorder_memory_mb_max", "MB"),
    ("processor time, most", "processor_percent_max", "% of a core"),
    ("messages refused", "faults", ""),
    ("lost by the recorder", "recorder_lost", "samples"),
    ("samples missing", "samples_missing", ""),
)
"""Names of figures, the members of the document they are, and their units."""

REASONS = ("reason", "replans", "median", "slowest")
REPLANS = ("at", "took", "steps planned", "gap", "to drive", "changed on the map", "why")
"""Columns of ``reason_rows`` and ``replan_rows``."""
MOST_REPLANS = 8

# Settings that say most about a run; the others are in the run card and in the JSON document.
SETTINGS = ("planner.name", "robot.tool_width_m", "robot.radius_m", "planner.seed")


def ending(told: Mapping[str, Any]) -> str:
    """Return in words whether the mission was completed, and where it was left."""
    if told["complete"]:
        return "complete: all it was to cover, and could reach, is covered"
    if told["complete"] is None:
        return "the recording does not tell whether it was completed"
    ended = all(part["ended"] for part in told["files"])
    how = "ended" if ended else "broke off"
    return f"not complete: the recording {how} when the mission was {told['state']}"


def verdicts(told: Mapping[str, Any]) -> list[tuple[bool | None, str]]:
    """Return a verdict for each order: whether it was completed, and that in words."""
    orders = told["orders"]
    if len(orders) < 2:
        return [(told["complete"], ending(told))]
    found = []
    for number, order in enumerate(orders, 1):
        span = f"{clock(order['at_s'])} to {clock(order['until_s'])}"
        who = "ordered" if order["ordered"] == "command" else "begun by itself"
        by = {"start": "another order", "cancel": "cancel", "reset": "reset", None: ""}
        ended = by[order["ended_by"]]
        how = {
            True: "complete",
            False: f"not complete: {order['state'] or 'nothing was told'}"
            + (f" when {ended} came" if ended else " at the end of the recording"),
            None: "not known whether it was completed",
        }[order["complete"]]
        cells = order["covered_cells"], order["coverable_cells"]
        counted = "" if None in cells else f", {cells[0]} of {cells[1]} cells"
        found.append((order["complete"], f"order {number}, {who}, {span}: {how}{counted}"))
    return found


def card_rows(told: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what was run: robot, map, when, how."""
    config, grid = told["config"], told["map"]
    size = (
        f"{grid['cols'] * grid['resolution_m']:.1f} x {grid['rows'] * grid['resolution_m']:.1f} m, "
        f"{grid['resolution_m']:g} m a pixel"
        if grid
        else "none"
    )
    parts = told["files"]
    megabytes = sum(part["bytes"] for part in parts) / 1e6
    state = "" if all(part["ended"] for part in parts) else ", not ended in order"
    settings = [
        f"{name.rpartition('.')[2] if name != 'planner.name' else 'planner'} {config[name]}"
        for name in SETTINGS
        if name in config
    ]
    return [
        ("robot", told["robot"] or "not told"),
        ("began", _began(told["began"])),
        ("duration", clock(told["duration_s"])),
        ("map", size),
        ("version", told["version"] or "not told"),
        ("settings", ", ".join(settings) or "not told"),
        ("recording", f"{len(parts)} part{'s' * (len(parts) != 1)}, {megabytes:.1f} MB{state}"),
    ]


def reason_rows(told: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Return each kind of reason for a replan: how many there were, the median, the slowest."""
    took = told["replan_ms_by_reason"]
    return [
        (kind, str(count), amount(took[kind]["p50"], "ms"), amount(took[kind]["max"], "ms"))
        for kind, count in told["replans_by_reason"].items()
    ]


def replan_rows(paths: Iterable[TakenPath]) -> list[tuple[str, ...]]:
    """Return of each replan when it was, how long it took, what came of it, where and why."""
    return [
        (
            clock(path.at_s),
            amount(path.plan_ms, "ms"),
            str(path.steps if path.planned_steps is None else path.planned_steps),
            "-" if path.gap is None else f"{100 * path.gap:.1f} %",
            "-" if path.cost_s is None else clock(path.cost_s),
            _place(path.changed),
            path.reason,
        )
        for path in paths
    ]


def _place(changed: Rectangle | None) -> str:
    if changed is None:
        return "-"
    x0, y0, x1, y1 = astuple(changed)
    return f"{x1 - x0:.1f} x {y1 - y0:.1f} m at ({(x0 + x1) / 2:.1f}, {(y0 + y1) / 2:.1f})"


def figure_rows(told: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the figures that two runs are compared by, as text."""
    return [(figure.name, figure.text) for figure in _figures(told)]


def compared_rows(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[Row]:
    """Return the figures of two runs side by side, and where they compare, how they differ."""
    mine, theirs = ({figure.name: figure for figure in _figures(told)} for told in (one, other))
    compares = do_compare(setup_differences(one, other))
    anyway = {name for name, member, _ in NUMBERS if member in ANYWAY}
    return [
        _compared(mine[name], theirs[name], compares=compares or name in anyway)
        for name in mine
        if name in theirs
    ]


def setup_words(one: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """Return in a sentence whether two runs compare."""
    setup = setup_differences(one, other)
    if not setup:
        return "Both were set up alike."
    if do_compare(setup):
        return "They were set up differently:"
    another = ", ".join(name for name, _, _ in setup if name in ANOTHER_PROBLEM)
    return (
        f"These are not two runs of one problem: {another} differ. What hangs on that is shown, "
        "and not compared."
    )


@dataclass(frozen=True, slots=True)
class _Figure:
    """A figure: its text, and where it is a number, that."""

    name: str
    text: str
    value: float | None = None


def _figures(told: Mapping[str, Any]) -> Iterator[_Figure]:
    covered, coverable = told["covered_cells"], told["coverable_cells"]
    share = f" ({100 * covered / coverable:.1f} %)" if covered is not None and coverable else ""
    yield _Figure("complete", {True: "yes", False: "no", None: NOT_KNOWN}[told["complete"]])
    yield _Figure("duration", clock(told["duration_s"]), told["duration_s"])
    text = NOT_KNOWN if covered is None else f"{covered} of {coverable} cells{share}"
    yield _Figure("covered", text, covered)
    for percent in MILESTONES:
        at_s = (told["reached_s"] or {}).get(str(percent))
        text = "never" if told["reached_s"] else NOT_KNOWN
        yield _Figure(f"{percent} % covered after", text if at_s is None else clock(at_s), at_s)
    for name, member, unit in NUMBERS:
        yield _Figure(name, _count(told[member], unit), told[member])


def _compared(mine: _Figure, theirs: _Figure, *, compares: bool) -> Row:
    if mine.value is None or theirs.value is None or not compares:
        return mine.name, mine.text, theirs.text, ""
    less = round(mine.value - theirs.value, 1)
    text = f"{less:+,d}" if isinstance(less, int) else f"{less:+,.1f}"
    return mine.name, mine.text, theirs.text, text if less else "0"


def clock(seconds: float) -> str:
    """Return a time as minutes and seconds, or with hours."""
    minutes, rest = divmod(round(seconds, 1), 60)
    hours, minutes = divmod(int(minutes), 60)
    return f"{hours}:{minutes:02d}:{rest:04.1f}" if hours else f"{minutes}:{rest:04.1f}"


def amount(value: float | None, unit: str) -> str:
    """Return a value with its unit."""
    if value is None:
        return NOT_KNOWN
    digits = 0 if abs(value) >= 100 or value == round(value) else 1 if abs(value) >= 10 else 2
    return f"{value:,.{digits}f} {unit}".rstrip()


def _count(value: float | None, unit: str = "") -> str:
    if value is None:
        return NOT_KNOWN
    text = f"{value:,}" if isinstance(value, int) else f"{value:,.1f}"
    return f"{text} {unit}".rstrip()


def _began(told: str) -> str:
    """Return when it began; before this program was, no clock can have been right."""
    when = told.replace("T", " ").replace("Z", " UTC")
    return when if told >= "2024" else f"{when}, by a clock that was not set"
