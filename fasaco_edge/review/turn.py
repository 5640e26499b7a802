"""The turn of a robot near a moment, and the path that caused it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.recording.read.drawn import DrawnLine
from fasaco_edge.review.drive import nearest_points
from fasaco_edge.wire.reasons import plain

if TYPE_CHECKING:
    from fasaco_edge.review.review import Review
    from fasaco_edge.review.run_data import PathSample


# Period before and after the moment in which turns are searched, and longest turn [s].
TURN_S = 2.0


# Least angle of a turn [deg]. Among several turns the largest angle counts, minus this many degrees
# for each second of duration and of distance from the moment [deg/s].
TURN_DEG, SHORTER_DEG_S = 60.0, 20.0


# Distance ahead at which a path's heading is taken [m]; least difference of two headings [deg].
AHEAD_M = 0.5


APART_DEG = 60.0


DIRECTIONS = (
    *("east", "north-east", "north", "north-west"),
    *("west", "south-west", "south", "south-east"),
)


class TurnThen(msgspec.Struct):
    """The sharpest turn near a time: angle to the left [deg], position [m], reason."""

    begin_s: float
    end_s: float
    degrees: float
    x: float
    y: float
    why: str


def heading_from(line: NDArray[np.float64], place: tuple[float, float]) -> float | None:
    """Return the heading of a line (n, 2) at its point nearest to a place, in (-180, 180] [deg].

    None if the line ends there.
    """
    if len(line) < 2:
        return None
    nearest = nearest_points(line, place)
    index = int(np.argmin(np.hypot(*(nearest - place).T)))
    rest = np.vstack([nearest[index], line[index + 1 :]])
    far = np.hypot(*(rest - rest[0]).T) >= AHEAD_M
    dx, dy = (rest[int(np.argmax(far))] if far.any() else rest[-1]) - rest[0]
    return math.degrees(math.atan2(dy, dx)) if dx or dy else None


def turn_at(review: Review, lines: Mapping[int, DrawnLine], at_s: float) -> TurnThen | None:
    """Return the sharpest turn near a time; None if the robot made none."""
    data = review.data
    times, track = data.times, data.track
    about = np.abs(times - at_s) <= TURN_S
    times, track = times[about], track[about]
    if len(times) < 2:
        return None
    yaw = np.degrees(np.unwrap(track[:, 2]))
    turned = yaw[None, :] - yaw[:, None]
    seconds = times[None, :] - times[:, None]
    # Short turns near the moment come first; so two successive turns are not taken for one.
    away = np.abs((times[None, :] + times[:, None]) / 2 - at_s)
    sharp = np.minimum(np.abs(turned), 180.0) - SHORTER_DEG_S * (seconds + away)
    worth = np.where((seconds > 0) & (seconds <= TURN_S), sharp, 0.0)
    first, last = np.unravel_index(int(np.argmax(worth)), worth.shape)
    degrees = float(turned[first, last])
    if abs(degrees) < TURN_DEG:
        return None
    x, y, _ = track[first].tolist()
    begin_s, end_s = float(times[first]), float(times[last])
    why = _why(data.paths, lines, (x, y), begin_s, end_s)
    return TurnThen(
        round(begin_s, 3), round(end_s, 3), round(degrees, 1), round(x, 3), round(y, 3), why
    )


def _why(
    paths: Sequence[PathSample],
    lines: Mapping[int, DrawnLine],
    place: tuple[float, float],
    begin_s: float,
    end_s: float,
) -> str:
    """Return the path that caused a turn: a new path, or the one the robot followed."""
    index = sum(path.at_s <= begin_s for path in paths) - 1
    known = [
        (path, heading)
        for path in paths[max(index - 1, 0) :]
        if path.at_s <= end_s
        and (line := lines.get(path.about.revision)) is not None
        and (heading := heading_from(line.xy, place)) is not None
    ]
    for (old, was), (new, now) in pairwise(known):
        apart = abs(math.remainder(now - was, 360.0))
        if new.at_s >= begin_s - TURN_S and apart > APART_DEG:
            return (
                f"path {new.about.revision} came ({plain(new.about.reason)}) and leads "
                f"{direction(now)}, "
                f"where path {old.about.revision} led {direction(was)}"
            )
    led = [path.about for path in paths if path.at_s <= end_s and path.about.steps]
    if not led:
        return "there was no path"
    planned = next((about for about in reversed(led) if about.planner), led[-1])
    by = f", by the plan of path {planned.revision}" if planned is not led[-1] else ""
    return f"as planned: path {led[-1].revision} turns there{by} ({plain(planned.reason)})"


def direction(degrees: float) -> str:
    """Return the compass point of a heading in the map frame [deg]; 0 is east, 90 north."""
    return DIRECTIONS[round(degrees / 45.0) % 8]
