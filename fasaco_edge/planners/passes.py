"""Passes over a floor: the cells that each covers, and the direction of its lanes.

Lanes lie along the rows or the columns of the lattice, and the angle of the lattice is chosen for
them. So two passes whose lanes cross use the same lattice.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.planners.cost import ANY_LANES, COLUMNS, ROWS, Lanes
from fasaco_edge.text import percent

# All cells; the cells along walls and furniture; the other cells.
Covers = Literal["all", "edge", "rest"]
# Lanes in the cheapest direction; across the lanes of the previous pass.
Direction = Literal["auto", "cross"]
MOST_PASSES = 100
MOST_ANGLE_DEG = 360
MOST_OVERLAP = 0.5
# Steps in all directions.
_OPEN = 1 << EAST | 1 << NORTH | 1 << WEST | 1 << SOUTH


@dataclass(frozen=True, slots=True)
class Pass:
    """A pass over the floor.

    Attributes:
        covers: the cells to cover: all, those along edges, or the rest after the edges.
        lanes: direction of its lanes: auto or cross.
        angle_deg: angle of its lanes to the x axis of the map frame in place of ``lanes`` [deg].
        overlap: share of the tool's width by which its lanes overlap; None for the robot's overlap.
        speed_m_s: speed of the robot [m/s]; None for its usual speed.
    """

    covers: Covers = "all"
    lanes: Direction = "auto"
    angle_deg: float | None = None
    speed_m_s: float | None = None
    overlap: float | None = None

    @property
    def name(self) -> str:
        """How the pass differs from a usual pass, as text; "" if it does not."""
        angle = "cross" if self.lanes == "cross" else ""
        if self.angle_deg is not None:
            angle = f"{self.angle_deg:g} degrees"
        covers = "" if self.covers == "all" else self.covers
        overlap = "" if self.overlap is None else f"{percent(self.overlap, 0)} overlap"
        return " ".join(filter(None, (covers, angle, overlap)))


class Laid(NamedTuple):
    """A pass on a lattice.

    Attributes:
        covers: as ``Pass.covers``.
        lanes: direction of its lanes on the lattice.
        angle_deg: angle of the lattice's rows to the x axis of the map frame [deg]; None for the
            usual angle.
        overlap: as ``Pass.overlap``.
    """

    covers: Covers = "all"
    lanes: Lanes = ANY_LANES
    angle_deg: float | None = None
    overlap: float | None = None


def lane_and_tool_m(tool_m: float, usual_lane_m: float, overlap: float) -> tuple[float, float]:
    """Return the distance of lanes that overlap, and the width of the tool to plan them with [m].

    If lanes are closer than usual, the planned tool is narrower, too: a line for the full width
    would skip swept floor, so that its lanes would be as far apart as usual.

    Args:
        tool_m: width of the tool [m].
        usual_lane_m: distance of the robot's lanes in other passes [m].
        overlap: share of the tool's width by which neighbouring lanes overlap.
    """
    lane_m = tool_m * (1.0 - overlap)
    return lane_m, tool_m * min(lane_m / usual_lane_m, 1.0)


def laid(passes: Sequence[Pass]) -> list[Laid]:
    """Return passes on lattices.

    Lanes that a later pass crosses run along the rows; an edge has no lanes.

    Raises:
        BadConfiguration: see ``check_passes``.
    """
    check_passes(passes)
    found: list[Laid] = []
    before = Laid()
    for index, each in enumerate(passes):
        if each.covers == "edge":
            found.append(Laid("edge"))
            continue
        if each.lanes == "cross":
            lanes, angle_deg = (ROWS if before.lanes == COLUMNS else COLUMNS), before.angle_deg
        else:
            is_laned = each.angle_deg is not None or _is_crossed(passes[index + 1 :])
            lanes, angle_deg = (ROWS if is_laned else ANY_LANES), each.angle_deg
        before = Laid(each.covers, lanes, angle_deg, each.overlap)
        found.append(before)
    return found


def _is_crossed(after: Iterable[Pass]) -> bool:
    """Return whether the first pass with lanes crosses the lanes before it."""
    return next((each.lanes == "cross" for each in after if each.covers != "edge"), False)


def check_passes(passes: Sequence[Pass], name: str = "passes") -> None:
    """Check passes and their order.

    Raises:
        BadConfiguration: a cross pass does not follow lanes, or a rest pass an edge; options of a
            pass exclude each other; or all passes are edges.
    """
    if not 1 <= len(passes) <= MOST_PASSES:
        raise BadConfiguration(f"must be 1 to {MOST_PASSES}, got {len(passes)}", key=name)
    crossed = False
    for index, each in enumerate(passes):
        if why := _why_not(each, passes[:index], crossed=crossed):
            raise BadConfiguration(why, key=f"{name}[{index}]")
        crossed = crossed or each.covers != "edge"
    if not crossed:
        raise BadConfiguration("edge alone leaves most of the floor; add auto or rest", key=name)


def _why_not(each: Pass, before: Sequence[Pass], *, crossed: bool) -> str:
    """Return why a pass cannot follow others; "" if it can."""
    if each.lanes == "cross" and not crossed:
        return "cross goes after a pass with lanes, which is missing"
    if each.covers == "rest" and all(other.covers != "edge" for other in before):
        return "rest goes after an edge, which is missing"
    if each.lanes == "cross" and each.angle_deg is not None:
        return "cross is an angle, got another one beside it"
    if each.covers == "edge" and (each.lanes == "cross" or each.angle_deg is not None):
        return "edge follows the walls, and has no lanes"
    if each.covers == "edge" and each.overlap is not None:
        return "edge has no lanes that could overlap"
    return ""


def read_pass(text: str) -> Pass:
    """Return the pass in a text as edge, rest, auto, cross, 30deg, rest:cross, cross%30@0.15.

    Raises:
        BadConfiguration: the text is no pass.
    """
    what, at, speed = text.partition("@")
    what, percent, overlap_text = what.partition("%")
    has_cells = what.partition(":")[0] in get_args(Covers)
    covers, _, lanes = (what if has_cells else f"all:{what}").partition(":")
    lanes = "auto" if what == covers else lanes
    angle_deg = None if lanes in get_args(Direction) else _number(lanes.removesuffix("deg"))
    speed_m_s = _number(speed) if at else None
    overlap = _number(overlap_text) / 100.0 if percent else None
    is_angle = angle_deg is None or lanes.endswith("deg")
    if not is_angle or any(map(math.isnan, (angle_deg or 0.0, speed_m_s or 0.0, overlap or 0.0))):
        raise BadConfiguration(
            "a pass is edge, rest, auto, cross, rest:cross, or an angle such as 30deg, then %30 "
            f"for an overlap and @0.15 for a speed; got {text!r}"
        )
    if abs(angle_deg or 0.0) > MOST_ANGLE_DEG:
        raise BadConfiguration(f"an angle is up to {MOST_ANGLE_DEG} deg, got {text!r}")
    if speed_m_s is not None and not 0.0 < speed_m_s <= 10:
        raise BadConfiguration(f"a speed is above 0 and at most 10 m/s, got {text!r}")
    if not 0.0 <= (overlap or 0.0) <= MOST_OVERLAP:
        raise BadConfiguration(f"an overlap is 0 to {100 * MOST_OVERLAP:g} percent, got {text!r}")
    direction: Direction = "cross" if lanes == "cross" else "auto"
    return Pass(covers, direction, angle_deg, speed_m_s, overlap)  # type: ignore[arg-type]


def read_passes(text: str) -> tuple[Pass, ...]:
    """Return the passes in a text: their number, or one text for each, with commas between.

    Raises:
        BadConfiguration: the text is neither.
    """
    if text.isdecimal():
        if float(text) > MOST_PASSES:
            raise BadConfiguration(f"at most {MOST_PASSES} passes, got {text}")
        return (Pass(),) * int(text)
    return tuple(read_pass(each) for each in text.split(","))


def _number(text: str) -> float:
    """Return a number; NaN for other texts."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def edge_cells(steps: NDArray[np.uint8], reachable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which reachable cells miss a step to one of the four cells beside them.

    Args:
        steps: uint8 (rows, cols), step masks of a lattice.
        reachable: bool (rows, cols).
    """
    edge: NDArray[np.bool_] = reachable & (steps != _OPEN)
    return edge


def wanted_by(
    covers: Covers, steps: NDArray[np.uint8], reachable: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which reachable cells a pass covers; the arrays are as in ``edge_cells``."""
    if covers == "all":
        return reachable
    edge = edge_cells(steps, reachable)
    return edge if covers == "edge" else reachable & ~edge
