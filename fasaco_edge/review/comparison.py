"""The figures of a run by name, and the comparison of set-ups and figures of two runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeGuard

import msgspec

from fasaco_edge.judge.floor import swept_words
from fasaco_edge.review.document import MILESTONES, ReviewDocument
from fasaco_edge.review.wording import NOT_KNOWN, clock, count

# Keys of the configuration by the name of a setting.
SETTINGS = {
    "tool width": "robot.tool_width_m",
    "robot radius": "robot.radius_m",
    "planner": "planner.name",
    "own planner": "planner.own",
    "seed": "planner.seed",
    "turn time": "robot.quarter_turn_s",
    "turn rate": "robot.turn_deg_s",
    "turn acceleration": "robot.turn_deg_s2",
    "acceleration": "robot.acceleration_m_s2",
    "simulated seconds per second": "robot.time_scale",
}
# If these differ, walks, cells and times belong to different problems.
ANOTHER_PROBLEM = ("tool width", "robot radius", "line", "width of lanes", "building", "orders")
# Members that are compared in any case.
ANYWAY = (
    *("faults", "faults_by_code", "recorder_lost", "samples_missing"),
    *("memory_mb_max", "recorder_memory_mb_max", "processor_percent_max", "threads_max"),
    *("processor_s", "recorder_processor_s"),
)
# Maps of one building from two missions differ a little: its sides [m], and its cells [share].
SIDE_M, CELLS_SHARE = 1.0, 0.15

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
    ("plans made", "plans", ""),
    ("plans that became no path", "plans_unused", ""),
    ("slowest plan", "plan_ms_max", "ms"),
    ("attempts at a better path", "attempts", ""),
    ("attempts that found one", "attempts_used", ""),
    ("memory of the daemon, most", "memory_mb_max", "MB"),
    ("memory of the recorder, most", "recorder_memory_mb_max", "MB"),
    ("processor time of the daemon", "processor_s", "s"),
    ("processor time of the recorder", "recorder_processor_s", "s"),
    ("processor time, most", "processor_percent_max", "% of a core"),
    ("messages refused", "faults", ""),
    ("lost by the recorder", "recorder_lost", "samples"),
    ("samples missing", "samples_missing", ""),
)
"""Names of figures, the members of the document they are, and their units."""


def setup_differences(one: ReviewDocument, other: ReviewDocument) -> list[Difference]:
    """Return the differences of two runs' set-ups; settings missing in one do not count."""
    found = [
        (name, mine, theirs)
        for name, mine, theirs in (
            ("robot", one.robot, other.robot),
            ("version", one.version, other.version),
        )
        if mine and theirs and mine != theirs
    ]
    for name, key in SETTINGS.items():
        mine, theirs = one.config.get(key), other.config.get(key)
        if mine is not None and theirs is not None and mine != theirs:
            found.append((name, str(mine), str(theirs)))
    if _line(one) != _line(other):
        found.append(("line", _line(one), _line(other)))
    elif all(_lane_m(each) is not None for each in (one, other)):
        mine, theirs = (f"{_lane_m(each):.3f} m" for each in (one, other))
        if mine != theirs and not any(name == "tool width" for name, *_ in found):
            found.append(("width of lanes", mine, theirs))
    if not _is_one_building(one, other):
        found.append(("building", _building(one), _building(other)))
    if len(one.orders) != len(other.orders):
        found.append(("orders", str(len(one.orders)), str(len(other.orders))))
    return found


def do_compare(setup: list[Difference]) -> bool:
    """Return whether both runs solved the same problem, by how their set-ups differ."""
    return not any(name in ANOTHER_PROBLEM for name, _, _ in setup)


def setup_words(one: ReviewDocument, other: ReviewDocument) -> str:
    """Return a sentence on whether two runs compare."""
    setup = setup_differences(one, other)
    if not setup:
        return "Both had the same setup."
    if do_compare(setup):
        return "They had different setups:"
    another = ", ".join(name for name, _, _ in setup if name in ANOTHER_PROBLEM)
    return (
        f"These are not two runs of one problem: {another} differ. Figures that depend on that "
        "are shown, but not compared."
    )


def side_by_side(one: ReviewDocument, other: ReviewDocument) -> dict[str, object]:
    """Return two documents, the differences of their set-ups and of their numbers.

    A difference is the first less the second, of each number that both have and that compares.
    """
    setup = setup_differences(one, other)
    this, that = (msgspec.to_builtins(document) for document in (one, other))
    mine = this if do_compare(setup) else {name: this[name] for name in ANYWAY}
    return {
        "recording": this,
        "against": that,
        "setup": [dict(zip(("what", "recording", "against"), each, strict=True)) for each in setup],
        "compare": do_compare(setup),
        "difference": differences(mine, that),
    }


def differences(one: Mapping[str, object], other: Mapping[str, object]) -> dict[str, object]:
    """Return the first less the second of each number that both documents have."""
    found: dict[str, object] = {}
    for name, value in one.items():
        mate = other.get(name)
        if isinstance(value, dict) and isinstance(mate, dict):
            if inner := differences(value, mate):
                found[name] = inner
        elif _is_number(value) and _is_number(mate):
            found[name] = round(value - mate, 6)
    return found


def compared_rows(one: ReviewDocument, other: ReviewDocument) -> list[Row]:
    """Return the figures of two runs side by side, with the difference if they compare."""
    mine, theirs = ({figure.name: figure for figure in figures(each)} for each in (one, other))
    compares = do_compare(setup_differences(one, other))
    anyway = {name for name, member, _ in NUMBERS if member in ANYWAY}
    return [
        _compared(mine[name], theirs[name], compares=compares or name in anyway)
        for name in mine
        if name in theirs
    ]


def reason_counts(documents: Sequence[ReviewDocument]) -> list[tuple[str, list[int]]]:
    """Return each kind of reason for a replan, and how many there were in each run."""
    counts = [document.replans_by_reason for document in documents]
    kinds = dict.fromkeys(kind for count in counts for kind in count)
    return [(kind, [count.get(kind, 0) for count in counts]) for kind in kinds]


def _compared(mine: Figure, theirs: Figure, *, compares: bool) -> Row:
    if mine.value is None or theirs.value is None or not compares:
        return mine.name, mine.text, theirs.text, ""
    less = round(mine.value - theirs.value, 1)
    text = f"{less:+,d}" if isinstance(less, int) else f"{less:+,.1f}"
    return mine.name, mine.text, theirs.text, text if less else "0"


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_one_building(one: ReviewDocument, other: ReviewDocument) -> bool:
    if one.map is None or other.map is None:
        return True
    pairs = zip(one.map.sides_m, other.map.sides_m, strict=True)
    if any(abs(mine - theirs) > SIDE_M for mine, theirs in pairs):
        return False
    # A line also sweeps cells whose centres the robot cannot reach.
    if _line(one) != _line(other):
        return True
    mine, theirs = _cells_m2(one), _cells_m2(other)
    if mine is None or theirs is None:
        return True
    return abs(mine - theirs) <= CELLS_SHARE * max(mine, theirs)


def _line(document: ReviewDocument) -> str:
    """Return the form of path that was driven; older recordings only know cells."""
    return str(document.config.get("planner.line", "cells"))


def _lane_m(document: ReviewDocument) -> float | None:
    """Return the spacing of lanes, the edge of a cell [m]; None if not stated."""
    width_m, overlap = (
        document.config.get(f"robot.{name}", 0.0) for name in ("tool_width_m", "overlap")
    )
    if not isinstance(width_m, int | float) or not isinstance(overlap, int | float) or not width_m:
        return None
    return width_m if _line(document) == "cells" else width_m * (1.0 - overlap)


def _cells_m2(document: ReviewDocument) -> float | None:
    """Return the area of all cells that were coverable at the end [m2]."""
    cells, edge_m = document.coverable_cells, _lane_m(document)
    return None if cells is None or edge_m is None else cells * edge_m**2


def _building(document: ReviewDocument) -> str:
    width, depth = document.map.sides_m if document.map else (0.0, 0.0)
    cells_m2 = _cells_m2(document)
    cells = "" if cells_m2 is None else f", {cells_m2:.1f} m2 of cells to cover"
    return f"{width:.1f} x {depth:.1f} m{cells}"


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure: its name, its text, and its value where it is a number."""

    name: str
    text: str
    value: float | None = None


def figures(document: ReviewDocument) -> Iterator[Figure]:
    """Yield the figures used to compare two runs."""
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
    yield Figure("floor swept", text, swept_m2)
    patches, largest_m2 = document.patches_over_4_dm2, document.largest_patch_m2
    yield Figure("patches left, over 4 dm2", count(patches, ""), patches)
    yield Figure("largest patch left", count(largest_m2, "m2"), largest_m2)
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
        yield Figure(name, count(value, unit), value)


def _by_reason(floor: dict[str, float] | None) -> str:
    if floor is None:
        return NOT_KNOWN
    return "; ".join(f"{m2:.2f} m2 {reason}" for reason, m2 in floor.items()) or "none"
