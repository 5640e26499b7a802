"""One moment of a recorded mission: robot, paths before and after, map, command.

It shows why the robot acted as it did then. Maps are decoded again up to that time. Paths are read
from their drawings; not all paths in quick succession are drawn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.occupancy import FREE, OccupancyGrid
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import RunRecord
from fasaco_edge.recording.read.timeline import DrawnLine, lines_in, read_drawings
from fasaco_edge.review.floor_and_rooms import nearest_points, swept_between
from fasaco_edge.review.orders import CommandThen, commands_of, order_words
from fasaco_edge.review.run_data import maps_of
from fasaco_edge.wire.documents.path_documents import Rectangle
from fasaco_edge.wire.reasons import plain

if TYPE_CHECKING:
    from fasaco_edge.review.review import Review
    from fasaco_edge.review.run_data import PathSample

# Period before the moment in which changes of the map are reported [s].
MAP_S = 5.0
# Period after the moment in which swept floor is counted, and around it whose track is drawn [s].
DRIVE_S = 10.0
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


class PathThen(msgspec.Struct):
    """A path: its time and reason, and its heading at the robot's position [deg]."""

    at_s: float
    revision: int
    reason: str
    steps: int
    leads_deg: float | None
    changed: Rectangle | None


class PlanThen(msgspec.Struct):
    """The plan of a path: its time and reason, and the driving time that its search saved [s].

    Attributes:
        revision: the path that published it.
        saved_by_velocity_s: time saved by each cohort of ants, by velocity [s].
    """

    at_s: float
    revision: int
    reason: str
    planner: str
    ants: int
    saved_by_velocity_s: dict[str, float]
    saved_by_local_search_s: float


class MapThen(msgspec.Struct):
    """Changes of the map since a time [m2], and their bounding rectangle."""

    since_s: float
    seen_m2: float
    blocked_m2: float
    freed_m2: float
    around: Rectangle | None


class Instant(msgspec.Struct):
    """The state at one moment; times are the robot's [s] since the recording began.

    ``sweeps_m2``: floor that the tool passes in the ``DRIVE_S`` after it; ``sweeps_new_m2``: the
    part of it that was not swept before.
    """

    at_s: float
    state: str | None
    state_reason: str
    order: str
    x: float | None
    y: float | None
    yaw_deg: float | None
    speed_m_s: float | None
    sweeps_m2: float | None
    sweeps_new_m2: float | None
    turn: TurnThen | None
    path_before: PathThen | None
    path: PathThen | None
    path_after: PathThen | None
    plan: PlanThen | None
    map: MapThen | None
    command: CommandThen | None
    next_command: CommandThen | None


class InstantPicture(msgspec.Struct, frozen=True):
    """An instant with the data of its picture: map, and lines of the paths."""

    instant: Instant
    grid: OccupancyGrid | None
    before: DrawnLine | None
    line: DrawnLine | None
    after: DrawnLine | None


def instant_at(review: Review, at_s: float) -> InstantPicture:
    """Return the instant at a time [s], with the data of its picture.

    Raises:
        UnreadableRecording: a file of the recording is gone.
    """
    record, data = review.record, review.data
    pose_index = int(np.searchsorted(data.times, at_s, side="right")) - 1
    pose = data.poses[pose_index] if pose_index >= 0 else None
    lines: dict[int, DrawnLine] = {}
    for line in read_drawings(record.drawn.get(entities.PATH, ()), lines_in, record.anchor):
        lines.setdefault(line.revision, line)
    span = next((s for s in reversed(review.states) if s.begin_s <= at_s), None)
    chapter = next((c for c in reversed(review.orders) if c.at_s <= at_s), None)
    turn = turn_at(review, lines, at_s)
    # A turn is caused by the path at its beginning.
    place = (turn.x, turn.y) if turn else pose[:2] if pose else None
    index = sum(path.at_s <= at_s for path in data.paths) - 1
    before, path, after = (
        _path(data.paths, number, lines, place) for number in (index - 1, index, index + 1)
    )
    grid, change = _map_at(record, at_s)
    commands = commands_of(data)
    lattice, sweeps = review.lattice, None
    if lattice is not None:
        sweeps = swept_between(data, lattice, at_s, at_s + DRIVE_S)
    past = [each for each in commands if each.at_s <= at_s]
    instant = Instant(
        at_s=round(at_s, 3),
        state=span.name if span else None,
        state_reason=span.reason if span else "",
        order=order_words(chapter.order) if chapter and chapter.order else "",
        x=round(pose[0], 3) if pose else None,
        y=round(pose[1], 3) if pose else None,
        yaw_deg=round(math.degrees(math.remainder(pose[2], math.tau)), 1) if pose else None,
        speed_m_s=_speed(data.times, data.track, at_s),
        sweeps_m2=sweeps and round(sweeps[0], 3),
        sweeps_new_m2=sweeps and round(sweeps[1], 3),
        turn=turn,
        path_before=before,
        path=path,
        path_after=after,
        plan=_plan(data.paths[: index + 1]),
        map=change,
        command=past[-1] if past else None,
        next_command=next((each for each in commands if each.at_s > at_s), None),
    )
    shown = (lines.get(each.revision if each else 0) for each in (before, path, after))
    return InstantPicture(instant, grid, *shown)


def _path(
    paths: Sequence[PathSample],
    number: int,
    lines: Mapping[int, DrawnLine],
    place: tuple[float, float] | None,
) -> PathThen | None:
    if not 0 <= number < len(paths):
        return None
    at_s, about = paths[number].at_s, paths[number].about
    line = lines.get(about.revision)
    leads = heading_from(line.xy, place) if line is not None and place is not None else None
    return PathThen(
        round(at_s, 3),
        about.revision,
        about.reason,
        about.steps,
        None if leads is None else round(leads, 1),
        about.changed,
    )


def _plan(paths: Sequence[PathSample]) -> PlanThen | None:
    for sample in reversed(paths):
        about = sample.about
        if about.planner is not None:
            return PlanThen(
                round(sample.at_s, 3),
                about.revision,
                about.reason,
                about.planner,
                about.ants or 0,
                about.saved_by_velocity_s or {},
                about.saved_by_local_search_s or 0.0,
            )
    return None


def _speed(times: NDArray[np.float64], track: NDArray[np.float64], at_s: float) -> float | None:
    near = np.abs(times - at_s) <= 0.5
    if np.count_nonzero(near) < 2:
        return None
    way = np.hypot(*np.diff(track[near, :2], axis=0).T).sum()
    seconds = np.ptp(times[near])
    return round(float(way / seconds), 2) if seconds > 0 else None


def _map_at(record: RunRecord, at_s: float) -> tuple[OccupancyGrid | None, MapThen | None]:
    """Return the map in force at a time [s], and its changes in the ``MAP_S`` before."""
    since_s = max(at_s - MAP_S, 0.0)
    old: OccupancyGrid | None = None
    new: OccupancyGrid | None = None
    for came_s, grid in maps_of(record):
        if came_s > at_s:
            break
        new = grid
        old = grid if came_s <= since_s or old is None else old
    if new is None or old is None:
        return None, None
    return new, _map_change(old, new, since_s)


def _map_change(old: OccupancyGrid, new: OccupancyGrid, since_s: float) -> MapThen:
    rows, cols = np.indices(new.cells.shape).reshape(2, -1) + 0.5
    places = np.column_stack(new.geometry.to_map(cols, rows))
    # Pixels outside the older map were unknown, -1.
    before = (old.geometry.values_at(old.cells + 1, places) - 1).reshape(new.cells.shape)
    known, free, was_free = new.cells >= FREE, new.cells < 50, before < 50
    seen = known & (before < FREE)
    blocked = known & (before >= FREE) & was_free & ~free
    freed = known & (before >= FREE) & ~was_free & free
    pixel_m2 = new.geometry.resolution**2
    seen_m2, blocked_m2, freed_m2 = (
        round(int(np.count_nonzero(mask)) * pixel_m2, 2) for mask in (seen, blocked, freed)
    )
    window = Window.of(seen | blocked | freed)
    around = None
    if window is not None:
        around = Rectangle(*(round(edge, 2) for edge in new.geometry.bounds(window)))
    return MapThen(round(since_s, 3), seen_m2, blocked_m2, freed_m2, around)


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
