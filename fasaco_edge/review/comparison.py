"""The comparison of two runs: the differences of their set-ups, their figures side by side."""

from __future__ import annotations

import msgspec

from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.review.document import ReviewDocument
from fasaco_edge.review.figures import figures

# Differences that make floor, cells and times incomparable.
ANOTHER_PROBLEM = (
    *("robot.tool_width_m", "robot.radius_m", "robot.overlap", "planner.line"),
    *("building", "orders"),
)
# Largest difference between the sides of two maps of the same building [m].
SIDE_M = 1.0

Difference = tuple[str, str, str]
"""Name of the difference, and its value in the first run and in the other."""
Row = tuple[str, str, str, str]
"""Name, the texts of one recording and of the other, and the difference; "" for none."""


def setup_differences(one: ReviewDocument, other: ReviewDocument) -> list[Difference]:
    """Return the differences of two runs' set-ups, without settings that only one run has."""
    found = []
    # Where its bus is changes nothing that a robot does; each demo has other ports.
    settings = {key: value for key, value in one.config.items() if not key.startswith("bus.")}
    for name, mine, theirs in (
        ("robot", one.robot, other.robot),
        ("version", one.version, other.version),
        *((key, value, other.config.get(key)) for key, value in settings.items()),
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
            if mine.is_time:
                words = f"{'+' * (less > 0)}{clock(less)}"
            difference = words if less else "0"
        found.append((mine.name, mine.text, theirs.text, difference))
    return found
