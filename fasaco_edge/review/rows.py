"""The figures of a review as rows of text: the same for terminal and page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgspec.structs import astuple

from fasaco_edge.bench.floor import swept_words
from fasaco_edge.review.document import MILESTONES, ReviewDocument
from fasaco_edge.review.orders import order_words

if TYPE_CHECKING:
    from fasaco_edge.review.moments import Span
    from fasaco_edge.review.review import Review
    from fasaco_edge.review.run_data import PublishedPath
    from fasaco_edge.review.spot import Spot
    from fasaco_edge.wire.documents.path_documents import Rectangle

NOT_KNOWN = "not known"
NUMBERS = (
    ("floor swept by the ledger", "ledger_swept_m2", "m2"),
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

# The most important settings; the others are in the run card and in the JSON document.
CARD_SETTINGS = ("planner.name", "robot.tool_width_m", "robot.radius_m", "planner.seed")


ORDERS = ("order", "from", "to", "result", "driven", "replans", "paused", "asked for")
UNREACHED = ("order", "m2", "at", "why")
LEFT = ("m2", "at", "why")
COMMANDS = ("at", "command")
"""Columns of ``order_rows``, ``unreached_rows``, ``left_rows`` and ``command_rows``."""


def order_rows(document: ReviewDocument) -> list[tuple[str, ...]]:
    """Return a chapter of each order: when it held, how it went, and what it asked for."""
    return [
        (
            str(number),
            clock(order.at_s),
            clock(order.until_s),
            order.state or NOT_KNOWN,
            amount(order.driven_m, "m"),
            str(order.replans),
            clock(order.paused_s) if order.paused_s else "-",
            order_words(order.order) if order.order else "everything, or as ordered before",
        )
        for number, order in enumerate(document.orders, 1)
    ]


def unreached_rows(document: ReviewDocument) -> list[tuple[str, ...]]:
    """Return the areas that each order left uncovered: area, place, and the daemon's reason."""
    return [
        (str(number), f"{area.m2:.2f}", f"({area.x:.2f}, {area.y:.2f})", area.reason)
        for number, order in enumerate(document.orders, 1)
        for area in order.unreached
    ]


def left_rows(document: ReviewDocument, spots: Sequence[Spot]) -> list[tuple[str, ...]]:
    """Return the patches left of the reachable floor, and why; spots are of their places."""
    return [
        (f"{patch.m2:.2f}", f"({patch.x:.2f}, {patch.y:.2f})", f"{spot.why}: {spot.words}")
        for patch, spot in zip(document.left, spots, strict=True)
    ]


def command_rows(document: ReviewDocument) -> list[tuple[str, str]]:
    """Return when each command came, and what it said."""
    return [(clock(each.at_s), each.command) for each in document.commands]


def replans_in_time(review: Review) -> list[tuple[str, ...]]:
    """Return all replans as ``replan_rows`` has the slowest ones, in order of time."""
    return [_replan_row(path) for path in review.replans.later]


MOST_PLACES = 3


def screen_rows(review: Review, document: ReviewDocument) -> list[tuple[str, str]]:
    """Return what matters most, a line each: it fits on one screen with verdict and curve."""
    by_name = {figure.name: figure.text for figure in figures(document)}
    config, grid = document.config, document.map
    sides = "" if grid is None else "{:.1f} x {:.1f} m, ".format(*grid.sides_m)
    planner = f"{config.get('planner.name', 'planner not recorded')}"
    reached = [
        f"{percent} % {by_name[f'{percent} % of cells covered after']}" for percent in MILESTONES
    ]
    slowest = review.replans.slowest
    replans = f"{document.replans}"
    if slowest is not None and document.replan_ms_p50 is not None:
        replans += f", {amount(document.replan_ms_p50, 'ms')} in the median"
        replans += f", the slowest {amount(slowest.plan_ms, 'ms')} at {clock(slowest.at_s)}"
    left = [f"{patch.m2:.2f} m2 at ({patch.x:.2f}, {patch.y:.2f})" for patch in document.left]
    areas = [area for order in document.orders[-1:] for area in order.unreached]
    unreached = [
        f"{area.m2:.2f} m2 at ({area.x:.2f}, {area.y:.2f}) {area.reason}" for area in areas
    ]
    troubles = [
        f"{t.state} {clock(t.at_s or 0.0)} for {t.seconds or 0:.1f} s" for t in document.troubles
    ]
    commands = [" ".join(row) for row in command_rows(document)]
    charges = [f"{at} for {seconds}, {levels}" for at, seconds, levels in charge_rows(document)]
    return [
        ("run", f"{_began(document.began)}, {sides}{planner}, {document.robot or 'robot'}"),
        ("swept", by_name["reachable floor swept"]),
        ("covered", by_name["covered"]),
        ("cells after", ", ".join(reached)),
        ("left", _some(left)),
        ("not reached", _some(unreached)),
        ("driven", f"{amount(document.driven_m, 'm')}, {_count(document.steps, 'steps')}"),
        ("replans", replans),
        ("commands", _some(commands)),
        *([("charges", _some(charges))] if charges else []),
        ("troubles", _some(troubles)),
        ("refused", f"{document.faults} messages; lost {_count(document.recorder_lost, '')}"),
    ]


def _some(texts: Sequence[str]) -> str:
    more = f"; {len(texts) - MOST_PLACES} more" if len(texts) > MOST_PLACES else ""
    return "; ".join(texts[:MOST_PLACES]) + more or "none"


def verdicts(document: ReviewDocument) -> list[tuple[bool | None, str]]:
    """Return for each order whether it was completed, and that in words."""
    orders = document.orders
    if len(orders) < 2:
        return [(document.complete, _ending(document))]
    found = []
    for number, order in enumerate(orders, 1):
        span = f"{clock(order.at_s)} to {clock(order.until_s)}"
        who = "ordered" if order.ordered == "command" else "begun by itself"
        ended = "another order" if order.ended_by == "start" else order.ended_by
        how = {
            True: "complete",
            False: f"not complete: {order.state or 'no state recorded'}"
            + (f" when {ended} came" if ended else " at the end of the recording"),
            None: "not known whether it was completed",
        }[order.complete]
        cells = f", {order.covered_cells} of {order.coverable_cells} cells"
        counted = "" if None in (order.covered_cells, order.coverable_cells) else cells
        found.append((order.complete, f"order {number}, {who}, {span}: {how}{counted}"))
    return found


def _ending(document: ReviewDocument) -> str:
    if document.complete:
        return "complete: every reachable cell of the order is covered"
    if document.complete is None:
        return "not recorded whether it was completed"
    how = "ended" if document.is_ended else "broke off"
    return f"not complete: the recording {how} while the mission was {document.state}"


def card_rows(document: ReviewDocument) -> list[tuple[str, str]]:
    """Return robot, map, time and settings of a run."""
    config, grid, parts = document.config, document.map, document.files
    size = "none"
    if grid is not None:
        width, depth = grid.sides_m
        size = f"{width:.1f} x {depth:.1f} m, {grid.resolution_m:g} m a pixel"
    settings = [
        f"{name.rpartition('.')[2] if name != 'planner.name' else 'planner'} {config[name]}"
        for name in CARD_SETTINGS
        if name in config
    ]
    megabytes = sum(part.bytes for part in parts) / 1e6
    state = "" if document.is_ended else ", not ended in order"
    return [
        ("robot", document.robot or "not recorded"),
        ("began", _began(document.began)),
        ("duration", clock(document.duration_s)),
        ("map", size),
        ("version", document.version or "not recorded"),
        ("settings", ", ".join(settings) or "not recorded"),
        ("recording", f"{len(parts)} part{'s' * (len(parts) != 1)}, {megabytes:.1f} MB{state}"),
    ]


def figure_rows(document: ReviewDocument) -> list[tuple[str, str]]:
    """Return name and text of all figures."""
    return [(figure.name, figure.text) for figure in figures(document)]


def reason_rows(document: ReviewDocument) -> list[tuple[str, str, str, str]]:
    """Return each kind of reason for a replan: how many there were, the median, the slowest."""
    took = document.replan_ms_by_reason
    return [
        (kind, str(count), amount(took[kind].p50, "ms"), amount(took[kind].max, "ms"))
        for kind, count in document.replans_by_reason.items()
    ]


def replan_rows(review: Review) -> list[tuple[str, ...]]:
    """Return the slowest replans: when, how long, the plan, where the map changed, and why."""
    return [_replan_row(path) for path in review.replans.slowest_first(MOST_REPLANS)]


def _replan_row(path: PublishedPath) -> tuple[str, ...]:
    about = path.about
    return (
        clock(path.at_s),
        amount(path.plan_ms, "ms"),
        str(about.steps if about.planned_steps is None else about.planned_steps),
        "-" if about.gap is None else f"{100 * about.gap:.1f} %",
        "-" if about.planned_cost_s is None else clock(about.planned_cost_s),
        _place(about.changed),
        about.reason,
    )


def moment_rows(review: Review) -> list[tuple[str, ...]]:
    """Return the worst moments: what, how much, when, and a note."""
    return [(m.what, amount(m.value, m.unit), clock(m.at_s), m.note) for m in review.moments]


def trouble_rows(troubles: list[Span]) -> list[tuple[str, ...]]:
    """Return each trouble: the state, when, for how long, and why."""
    return [(s.name, clock(s.begin_s), f"{s.seconds:.1f} s", s.reason) for s in troubles]


CHARGES = ("at", "for", "battery")


def charge_rows(document: ReviewDocument) -> list[tuple[str, str, str]]:
    """Return each time the robot charged: when, for how long, and from what level to what."""
    return [
        (
            clock(charge.at_s),
            clock(charge.seconds),
            " to ".join(
                NOT_KNOWN if level is None else f"{level:.0%}"
                for level in (charge.level_from, charge.level_to)
            ),
        )
        for charge in document.charges
    ]


def fault_rows(document: ReviewDocument) -> list[tuple[str, str]]:
    """Return how many messages were refused, by code."""
    return [(code, str(count)) for code, count in document.faults_by_code.items()]


def unknown_lines(document: ReviewDocument) -> Iterator[str]:
    """Yield which samples and figures a recording does not give, and why."""
    for topic, count in document.unreadable.items():
        yield f"{count} samples of {topic} cannot be read"
    for names, why in document.not_recorded.items():
        yield f"not known: {names}: {why}"


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure: its name, its text, and its value where it is a number."""

    name: str
    text: str
    value: float | None = None


def figures(document: ReviewDocument) -> Iterator[Figure]:
    """Yield the figures that two runs are compared by."""
    share = f" ({document.share_covered})" if document.share_covered else ""
    covered = document.covered_cells
    yield Figure("complete", {True: "yes", False: "no", None: NOT_KNOWN}[document.complete])
    yield Figure("duration", clock(document.duration_s), document.duration_s)
    text = NOT_KNOWN if covered is None else f"{covered} of {document.coverable_cells} cells{share}"
    yield Figure("covered", text, covered)
    swept_m2, reachable_m2 = document.swept_m2, document.reachable_m2
    text = NOT_KNOWN
    if swept_m2 is not None and reachable_m2 is not None:
        text = swept_words(swept_m2, reachable_m2)
    yield Figure("reachable floor swept", text, swept_m2)
    patches, largest_m2 = document.patches_over_4_dm2, document.largest_patch_m2
    yield Figure("patches left, over 4 dm2", _count(patches, ""), patches)
    yield Figure("largest patch left", _count(largest_m2, "m2"), largest_m2)
    yield Figure("floor left", _by_reason(document.left_by_reason))
    yield Figure("floor out of reach", _by_reason(document.out_of_reach_by_reason))
    for percent in MILESTONES:
        at_s = (document.reached_s or {}).get(str(percent))
        text = "never" if document.reached_s else NOT_KNOWN
        yield Figure(
            f"{percent} % of cells covered after", text if at_s is None else clock(at_s), at_s
        )
    for name, member, unit in NUMBERS:
        value: float | None = getattr(document, member)
        yield Figure(name, _count(value, unit), value)


def _by_reason(floor: dict[str, float] | None) -> str:
    if floor is None:
        return NOT_KNOWN
    return "; ".join(f"{m2:.2f} m2 {reason}" for reason, m2 in floor.items()) or "none"


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


def _count(value: float | None, unit: str) -> str:
    if value is None:
        return NOT_KNOWN
    text = f"{value:,}" if isinstance(value, int) else f"{value:,.1f}"
    return f"{text} {unit}".rstrip()


def _place(changed: Rectangle | None) -> str:
    if changed is None:
        return "-"
    x0, y0, x1, y1 = astuple(changed)
    return f"{x1 - x0:.1f} x {y1 - y0:.1f} m at ({(x0 + x1) / 2:.1f}, {(y0 + y1) / 2:.1f})"


def _began(began: str) -> str:
    """Return when it began; a clock that shows a time before this program was is not set."""
    when = began.replace("T", " ").replace("Z", " UTC")
    return when if began >= "2024" else f"{when}, by a clock that was not set"
