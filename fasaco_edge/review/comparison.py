"""The comparison of two runs: their set-ups and figures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import msgspec

from fasaco_edge.judge.floor import swept_words
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.review.document import ReviewDocument
from fasaco_edge.review.floor_and_rooms import MILESTONES

# Differences that make floor, cells and times incomparable.
ANOTHER_PROBLEM = (
    *("robot.tool_width_m", "robot.radius_m", "robot.overlap", "planner.line"),
    *("building", "orders"),
)
NOT_KNOWN = "not known"
# Largest difference between the sides of two maps of the same building [m].
SIDE_M = 1.0

Difference = tuple[str, str, str]
"""Name of the difference, and its value in the first run and in the other."""
Row = tuple[str, str, str, str]
"""Name, the texts of one recording and of the other, and the difference; "" for none."""
NUMBERS = (
    ("floor swept, by the daemon", "ledger_swept_m2", "m2"),
    ("covered again", "recovered_cells", "cells"),
    ("out of reach", "unreachable_cells", "cells"),
    ("driven", "driven_m", "m"),
    ("paths published", "paths", ""),
    ("replans", "replans", ""),
    ("first plan", "first_plan_ms", "ms"),
    ("replan, median", "replan_ms_p50", "ms"),
    ("replan, p99", "replan_ms_p99", "ms"),
    ("replan, slowest", "replan_ms_max", "ms"),
    ("peak memory of the daemon", "memory_mb_max", "MB"),
    ("peak memory of the recorder", "recorder_memory_mb_max", "MB"),
    ("processor time of the daemon", "processor_s", "s"),
    ("processor time of the recorder", "recorder_processor_s", "s"),
    ("messages refused", "faults", ""),
    ("lost by the recorder", "recorder_lost", "samples"),
    ("samples missing", "samples_missing", ""),
)
"""Name of each figure, its member of ``ReviewDocument``, and its unit."""


def amount(value: float | None, unit: str) -> str:
    """Return a value with its unit."""
    if value is None:
        return NOT_KNOWN
    digits = 0 if abs(value) >= 100 or value == round(value) else 1 if abs(value) >= 10 else 2
    return f"{value:,.{digits}f} {unit}".rstrip()


def count(value: float | None, unit: str) -> str:
    """Return a value with its unit: a whole number with all digits, others with one decimal."""
    if value is None:
        return NOT_KNOWN
    text = f"{value:,}" if isinstance(value, int) else f"{value:,.1f}"
    return f"{text} {unit}".rstrip()


def setup_differences(one: ReviewDocument, other: ReviewDocument) -> list[Difference]:
    """Return the differences of two runs' set-ups, without settings that only one run has."""
    found = []
    for name, mine, theirs in (
        ("robot", one.robot, other.robot),
        ("version", one.version, other.version),
        *((key, value, other.config.get(key)) for key, value in one.config.items()),
        ("orders", len(one.orders), len(other.orders)),
    ):
        if mine is not None and theirs is not None and mine != theirs:
            found.append((name, str(mine), str(theirs)))
    if one.map is not None and other.map is not None:
        sides = one.map.sides_m, other.map.sides_m
        if any(abs(mine - theirs) > SIDE_M for mine, theirs in zip(*sides, strict=True)):
            mine, theirs = (f"{width:.1f} x {depth:.1f} m" for width, depth in sides)
            found.append(("building", mine, theirs))
    return found


def other_problem(setup: list[Difference]) -> str:
    """Return the names of differences that make two runs incomparable; "" for none."""
    return ", ".join(name for name, _, _ in setup if name in ANOTHER_PROBLEM)


def setup_words(setup: list[Difference]) -> str:
    """Return a sentence on whether the figures of two runs can be compared."""
    if other := other_problem(setup):
        return f"The figures cannot be compared, as the runs differ in {other}."
    return "They had different setups:" if setup else "Both had the same setup."


def side_by_side(one: ReviewDocument, other: ReviewDocument) -> dict[str, object]:
    """Return two documents, and the differences of their set-ups."""
    setup = setup_differences(one, other)
    return {
        "recording": msgspec.to_builtins(one),
        "against": msgspec.to_builtins(other),
        "setup": [dict(zip(("what", "recording", "against"), each, strict=True)) for each in setup],
        "compare": not other_problem(setup),
    }


def compared_rows(one: ReviewDocument, other: ReviewDocument) -> list[Row]:
    """Return the figures of two runs side by side, with the difference of numbers."""
    found = []
    for mine, theirs in zip(figures(one), figures(other), strict=True):
        difference = ""
        if mine.value is not None and theirs.value is not None:
            less = round(mine.value - theirs.value, 1)
            words = f"{less:+,d}" if isinstance(less, int) else f"{less:+,.1f}"
            difference = words if less else "0"
        found.append((mine.name, mine.text, theirs.text, difference))
    return found


@dataclass(frozen=True, slots=True)
class ReviewFigure:
    """A figure: name, text, and its value if it is a number."""

    name: str
    text: str
    value: float | None = None


def floor_words(document: ReviewDocument) -> str:
    """Return swept and reachable floor as text; "" if unknown."""
    if document.swept_m2 is None or document.reachable_m2 is None:
        return ""
    return swept_words(document.swept_m2, document.reachable_m2)


def figures(document: ReviewDocument) -> Iterator[ReviewFigure]:
    """Yield the figures used to compare two runs."""
    share = f" ({document.share_covered})" if document.share_covered else ""
    covered = document.covered_cells
    yield ReviewFigure("complete", {True: "yes", False: "no", None: NOT_KNOWN}[document.complete])
    yield ReviewFigure("duration", clock(document.duration_s), document.duration_s)
    text = NOT_KNOWN if covered is None else f"{covered} of {document.coverable_cells} cells{share}"
    yield ReviewFigure("covered", text, covered)
    yield ReviewFigure("floor swept", floor_words(document) or NOT_KNOWN, document.swept_m2)
    patches, largest_m2 = document.patches_over_4_dm2, document.largest_patch_m2
    yield ReviewFigure("patches left, over 4 dm2", count(patches, ""), patches)
    yield ReviewFigure("largest patch left", count(largest_m2, "m2"), largest_m2)
    yield ReviewFigure("floor left", _by_reason(document.left_by_reason))
    yield ReviewFigure("floor out of reach", _by_reason(document.out_of_reach_by_reason))
    for percent in MILESTONES:
        at_s = (document.reached_s or {}).get(str(percent))
        text = "never" if document.reached_s else NOT_KNOWN
        yield ReviewFigure(
            f"{percent} % of cells covered after", text if at_s is None else clock(at_s), at_s
        )
    for name, member, unit in NUMBERS:
        value: float | None = getattr(document, member)
        yield ReviewFigure(name, count(value, unit), value)


def _by_reason(floor: dict[str, float] | None) -> str:
    if floor is None:
        return NOT_KNOWN
    return "; ".join(f"{m2:.2f} m2 {reason}" for reason, m2 in floor.items()) or "none"
