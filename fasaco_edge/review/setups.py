"""What two runs were set up with, where that differs, and which of their figures compare."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# By the name of a member, or of a setting.
SETTINGS = {
    "tool width": "robot.tool_width_m",
    "robot radius": "robot.radius_m",
    "planner": "planner.name",
    "seed": "planner.seed",
    "turn time": "robot.turn_s",
}
# Where these differ, walks, cells and times are of other problems.
ANOTHER_PROBLEM = ("tool width", "robot radius", "building", "orders")
# These compare all the same.
ANYWAY = (
    *("faults", "faults_by_code", "recorder_lost", "samples_missing"),
    *("memory_mb_max", "recorder_memory_mb_max", "processor_percent_max", "threads_max"),
)
# Maps of one building by two missions differ a little: its sides [m], and its floor [share].
SIDE_M, FLOOR_SHARE = 1.0, 0.15

Difference = tuple[str, str, str]
"""What differs, and what it is in the first run and in the other."""


def setup_differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[Difference]:
    """Return what two documents' runs were not set up alike with; what is not told does not count.

    Args:
        one, other: as ``document.document`` returns them.
    """
    found = [
        (name, _text(one[name]), _text(other[name]))
        for name in ("robot", "version")
        if one[name] and other[name] and one[name] != other[name]
    ]
    for name, key in SETTINGS.items():
        mine, theirs = one["config"].get(key), other["config"].get(key)
        if mine is not None and theirs is not None and mine != theirs:
            found.append((name, _text(mine), _text(theirs)))
    if not _is_one_building(one, other):
        found.append(("building", _building(one), _building(other)))
    mine, theirs = len(one["orders"]), len(other["orders"])
    if mine != theirs:
        found.append(("orders", str(mine), str(theirs)))
    return found


def do_compare(differences: list[Difference]) -> bool:
    """Tell whether both runs had the same problem to solve."""
    return not any(name in ANOTHER_PROBLEM for name, _, _ in differences)


def _is_one_building(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    if not one["map"] or not other["map"]:
        return True
    pairs = zip(_sides_m(one["map"]), _sides_m(other["map"]), strict=True)
    if any(abs(mine - theirs) > SIDE_M for mine, theirs in pairs):
        return False
    mine, theirs = _floor_m2(one), _floor_m2(other)
    if mine is None or theirs is None:
        return True
    return abs(mine - theirs) <= FLOOR_SHARE * max(mine, theirs)


def _sides_m(grid: Mapping[str, Any]) -> tuple[float, float]:
    return grid["cols"] * grid["resolution_m"], grid["rows"] * grid["resolution_m"]


def _floor_m2(told: Mapping[str, Any]) -> float | None:
    """Return the area of all cells that a robot could cover in the end [m2]."""
    cells, width_m = told["coverable_cells"], told["config"].get("robot.tool_width_m")
    return None if cells is None or width_m is None else float(cells * width_m**2)


def _building(told: Mapping[str, Any]) -> str:
    width, depth = _sides_m(told["map"])
    floor = _floor_m2(told)
    return f"{width:.1f} x {depth:.1f} m" + ("" if floor is None else f", {floor:.1f} m2 to cover")


def _text(value: object) -> str:
    return str(value)
