"""Figures of a run as text, in the order in which two runs are compared."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fasaco_edge.judge.floor import swept_words
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.review.document import ReviewDocument
from fasaco_edge.review.floor_and_rooms import MILESTONES

NOT_KNOWN = "not known"
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


@dataclass(frozen=True, slots=True)
class ReviewFigure:
    """A figure: name, text, its value if it is a number, and whether that is a time [s]."""

    name: str
    text: str
    value: float | None = None
    is_time: bool = False


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
    duration_s = document.duration_s
    yield ReviewFigure("duration", clock(duration_s), duration_s, is_time=True)
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
        never = "never" if document.reached_s else NOT_KNOWN
        text = never if at_s is None else clock(at_s)
        yield ReviewFigure(f"{percent} % of cells covered after", text, at_s, is_time=True)
    for name, member, unit in NUMBERS:
        value: float | None = getattr(document, member)
        yield ReviewFigure(name, count(value, unit), value)


def _by_reason(floor: dict[str, float] | None) -> str:
    if floor is None:
        return NOT_KNOWN
    return "; ".join(f"{m2:.2f} m2 {reason}" for reason, m2 in floor.items()) or "none"
