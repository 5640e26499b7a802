"""Two runs side by side: how their set-ups differ, and which of their figures compare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fasaco_edge.review.rows import NUMBERS, Figure, figures

# By the name of a setting.
SETTINGS = {
    "tool width": "robot.tool_width_m",
    "robot radius": "robot.radius_m",
    "planner": "planner.name",
    "seed": "planner.seed",
    "turn time": "robot.turn_s",
}
# Where these differ, walks, cells and times belong to different problems.
ANOTHER_PROBLEM = ("tool width", "robot radius", "building", "orders")
# These members compare in any case.
ANYWAY = (
    *("faults", "faults_by_code", "recorder_lost", "samples_missing"),
    *("memory_mb_max", "recorder_memory_mb_max", "processor_percent_max", "threads_max"),
)
# Maps of one building from two missions differ a little: its sides [m], and its floor [share].
SIDE_M, FLOOR_SHARE = 1.0, 0.15

Document = Mapping[str, Any]
"""A review as ``document.document`` returns it."""
Difference = tuple[str, str, str]
"""What differs, and its value in the first run and in the other."""
Row = tuple[str, str, str, str]
"""Name, the texts of one recording and of the other, and the difference; "" for none."""


def setup_differences(one: Document, other: Document) -> list[Difference]:
    """Return in what the set-ups of two runs differ; what one does not state does not count."""
    found = [
        (name, str(one[name]), str(other[name]))
        for name in ("robot", "version")
        if one[name] and other[name] and one[name] != other[name]
    ]
    for name, key in SETTINGS.items():
        mine, theirs = one["config"].get(key), other["config"].get(key)
        if mine is not None and theirs is not None and mine != theirs:
            found.append((name, str(mine), str(theirs)))
    if not _is_one_building(one, other):
        found.append(("building", _building(one), _building(other)))
    mine, theirs = len(one["orders"]), len(other["orders"])
    if mine != theirs:
        found.append(("orders", str(mine), str(theirs)))
    return found


def do_compare(setup: list[Difference]) -> bool:
    """Return whether both runs solved the same problem, by how their set-ups differ."""
    return not any(name in ANOTHER_PROBLEM for name, _, _ in setup)


def setup_words(one: Document, other: Document) -> str:
    """Return a sentence on whether two runs compare."""
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


def side_by_side(one: Document, other: Document) -> dict[str, Any]:
    """Return two documents, how their set-ups differ, and the differences of their numbers.

    A difference is the first less the second, of each number that both have and that compares.
    """
    setup = setup_differences(one, other)
    mine = one if do_compare(setup) else {name: one[name] for name in ANYWAY}
    return {
        "recording": dict(one),
        "against": dict(other),
        "setup": [{"what": what, "recording": this, "against": that} for what, this, that in setup],
        "compare": do_compare(setup),
        "difference": differences(mine, other),
    }


def differences(one: Document, other: Document) -> dict[str, Any]:
    """Return the first less the second of each number that both documents have."""
    found: dict[str, Any] = {}
    for name, value in one.items():
        mate = other.get(name)
        if isinstance(value, dict) and isinstance(mate, dict):
            if inner := differences(value, mate):
                found[name] = inner
        elif _is_number(value) and _is_number(mate):
            found[name] = round(value - mate, 6)
    return found


def compared_rows(one: Document, other: Document) -> list[Row]:
    """Return the figures of two runs side by side, with the difference where they compare."""
    mine, theirs = ({figure.name: figure for figure in figures(each)} for each in (one, other))
    compares = do_compare(setup_differences(one, other))
    anyway = {name for name, member, _ in NUMBERS if member in ANYWAY}
    return [
        _compared(mine[name], theirs[name], compares=compares or name in anyway)
        for name in mine
        if name in theirs
    ]


def reason_counts(documents: Sequence[Document]) -> list[tuple[str, list[int]]]:
    """Return each kind of reason for a replan, and how many there were in each run."""
    counts = [document["replans_by_reason"] for document in documents]
    kinds = dict.fromkeys(kind for count in counts for kind in count)
    return [(kind, [count.get(kind, 0) for count in counts]) for kind in kinds]


def _compared(mine: Figure, theirs: Figure, *, compares: bool) -> Row:
    if mine.value is None or theirs.value is None or not compares:
        return mine.name, mine.text, theirs.text, ""
    less = round(mine.value - theirs.value, 1)
    text = f"{less:+,d}" if isinstance(less, int) else f"{less:+,.1f}"
    return mine.name, mine.text, theirs.text, text if less else "0"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_one_building(one: Document, other: Document) -> bool:
    if not one["map"] or not other["map"]:
        return True
    pairs = zip(_sides_m(one["map"]), _sides_m(other["map"]), strict=True)
    if any(abs(mine - theirs) > SIDE_M for mine, theirs in pairs):
        return False
    mine, theirs = _floor_m2(one), _floor_m2(other)
    if mine is None or theirs is None:
        return True
    return abs(mine - theirs) <= FLOOR_SHARE * max(mine, theirs)


def _sides_m(grid: Document) -> tuple[float, float]:
    return grid["cols"] * grid["resolution_m"], grid["rows"] * grid["resolution_m"]


def _floor_m2(document: Document) -> float | None:
    """Return the area of all cells that were coverable at the end [m2]."""
    cells, width_m = document["coverable_cells"], document["config"].get("robot.tool_width_m")
    return None if cells is None or width_m is None else float(cells * width_m**2)


def _building(document: Document) -> str:
    width, depth = _sides_m(document["map"])
    floor = _floor_m2(document)
    return f"{width:.1f} x {depth:.1f} m" + ("" if floor is None else f", {floor:.1f} m2 to cover")
