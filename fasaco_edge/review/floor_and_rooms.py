"""The floor of a recording: cells passed, floor swept, and the rooms with their shares of it.

Cells are counted as in the mission's ledger: a cell counts when the tool passes over its centre.
Swept floor is counted in pixels of the last map, along the recorded poses, with tool and robot of
the configuration. Pixels that touch a keep-out zone count as wall.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import (
    GridGeometry,
    Point,
    Polygon,
    Pose2D,
    Window,
    polygon_bounds,
)
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.polygons import area_m2, is_near
from fasaco_edge.judge.floor import JudgedFloor, SweepingRobot, judge_floor
from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.orders.zones import cells_inside, with_kept_out
from fasaco_edge.review.moments import Span
from fasaco_edge.review.run_data import RunData
from fasaco_edge.states import Activity, states_of
from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.rooms import RoomReport
from fasaco_edge.wire.documents.settings import known_settings

MILESTONES = (50, 90, 99, 100)
"""Shares of the cells that are coverable at the end [percent]."""
# States in which the robot is not at work.
RESTS = states_of(Activity.NONE, Activity.HELD)


def visits_of(
    poses: Iterable[tuple[float, tuple[float, float, float]]],
    lost_pose_s: float,
    lattice: CoverageLattice,
) -> NDArray[np.uint16]:
    """Return how often the tool passed over each cell, uint16 in the shape of the lattice.

    Args:
        poses: times [s], and x, y [m] and yaw [rad].
        lost_pose_s: the track is broken where no pose came for this time [s]; 0: never.
        lattice: the cells.
    """
    ledger, before = CoverageLedger(lattice.cell_m), math.inf
    for now, (x, y, _) in poses:
        # Poses outside the lattice are invalid, as in the mission.
        if not lattice.contains(lattice.cell_at(x, y)):
            continue
        if 0 < lost_pose_s < now - before:
            ledger.break_track()
        ledger.record(Pose2D(x, y))
        before = now
    return ledger.visits(lattice.window)


def nearest_points(line: NDArray[np.float64], place: tuple[float, float]) -> NDArray[np.float64]:
    """Return the point of each segment of a line (n, 2) nearest to a place, float64 (n - 1, 2)."""
    starts, ways = line[:-1], np.diff(line, axis=0)
    squares = np.maximum((ways**2).sum(axis=1), 1e-12)
    shares = np.clip(((np.array(place) - starts) * ways).sum(axis=1) / squares, 0.0, 1.0)
    found: NDArray[np.float64] = starts + shares[:, None] * ways
    return found


def swept_floor(
    data: RunData,
    lattice: CoverageLattice,
    keep_out: tuple[Polygon, ...] | None = None,
) -> JudgedFloor | None:
    """Return the swept floor; None without a map, a configuration, or a pose on the map.

    Also None if cells were covered before a restart, as the recording may lack those poses.

    Args:
        data: data of the samples.
        lattice: lattice over the last map; poses outside it are invalid.
        keep_out: keep-out zones; None for those of ``data``.
    """
    footprint = data.footprint
    if data.grid is None or footprint is None or data.restored_cells:
        return None
    cells = np.floor(data.track[:, 1::-1] / lattice.cell_m)
    window = lattice.window
    low, high = (window.row0, window.col0), (window.row1, window.col1)
    on_map = ((cells >= low) & (cells < high)).all(axis=1)
    kept = replace(data, pose_s=data.times[on_map].tolist(), poses=data.track[on_map].tolist())
    track = kept.track[:, :2]
    if not len(track):
        return None
    tool_m = known_settings(data.config).robot.tool_width_m
    robot = SweepingRobot(tool_m, footprint.robot_radius_m, free_at_most=footprint.free_at_most)
    # Floor and cells are reachable if the robot can reach them from its last position.
    x, y = track[-1].tolist()
    grid = with_kept_out(data.grid, data.keep_out if keep_out is None else keep_out)
    return judge_floor(grid, track, robot, driven=kept.driven, stands_at=(x, y))


def swept_between(
    data: RunData, lattice: CoverageLattice, begin_s: float, end_s: float
) -> tuple[float, float] | None:
    """Return the floor swept between two times [m2]: all of it, and what was not swept before.

    None if one of them is not known.
    """
    times = data.times

    def swept(kept: NDArray[np.bool_]) -> JudgedFloor | None:
        part = replace(data, pose_s=times[kept].tolist(), poses=data.track[kept].tolist())
        return swept_floor(part, lattice)

    before, then = swept(times <= begin_s), swept((times >= begin_s) & (times <= end_s))
    if before is None or then is None:
        return None
    pixel_m2 = then.geometry.resolution**2
    all_of_it, new = (int(pixels.sum()) for pixels in (then.swept, then.swept & ~before.swept))
    return pixel_m2 * all_of_it, pixel_m2 * new


@dataclass(frozen=True, slots=True)
class RoomChapter:
    """A room at the end of the recording; see ``ReviewDocument.rooms``."""

    room: int
    name: str
    area_m2: float
    seconds: float
    entered: int
    swept_share: float | None
    left_m2: float | None
    counted_share: float | None
    passes: int | None
    skip: bool

    @property
    def share(self) -> float | None:
        """Swept share by recorded poses; if unknown, the daemon's count."""
        return self.counted_share if self.swept_share is None else self.swept_share

    @property
    def title(self) -> str:
        """Name of the room, else its number."""
        return one_line(self.name) or f"room {self.room}"


def outlined(data: RunData) -> list[RoomReport]:
    """Return the rooms with an outline, the largest first, as it may enclose others."""
    return sorted(data.rooms.outlined, key=lambda room: -area_m2(room.outline))


def room_at(data: RunData, point: Point) -> RoomReport | None:
    """Return the room that contains a point (x, y) [m]; None for none."""
    there = [room for room in outlined(data) if is_near(room.outline, point, 0.0)]
    return there[-1] if there else None


def room_chapters(
    data: RunData, states: Sequence[Span], floor: JudgedFloor | None
) -> tuple[RoomChapter, ...]:
    """Return the rooms in order of number; () if no rooms were recorded.

    Args:
        data: data of the samples.
        states: states of the mission, in order.
        floor: swept and unswept floor; None if unknown.
    """
    rooms = outlined(data)
    geometry = floor.geometry if floor else data.grid.geometry if data.grid else None
    if not rooms or geometry is None:
        return ()
    labels = labels_of(geometry, [room.outline for room in rooms])
    at = geometry.values_at(labels, data.track[:, :2])
    seconds = np.bincount(at[:-1], _work_s(data, states), len(rooms) + 1) if len(at) else None
    # 0 is no room: doors, and floor beside furniture.
    passed = at[at > 0]
    entered = np.bincount(passed[np.diff(passed, prepend=0) != 0], minlength=len(rooms) + 1)
    pixel_m2, done, left = geometry.resolution**2, None, None
    if floor is not None:
        done, left = (
            np.bincount(labels[mask], minlength=len(rooms) + 1) * pixel_m2
            for mask in (floor.swept, floor.unswept)
        )
    found = []
    for index, room in enumerate(rooms, 1):
        share = left_m2 = None
        if done is not None and left is not None and done[index] + left[index]:
            share = round(float(done[index] / (done[index] + left[index])), 4)
            left_m2 = round(float(left[index]), 3)
        found.append(
            RoomChapter(
                room.id,
                room.name,
                round(room.area_m2, 2),
                round(float(seconds[index]), 1) if seconds is not None else 0.0,
                int(entered[index]),
                share,
                left_m2,
                room.swept,
                _passes(data, room),
                room.skip,
            )
        )
    return tuple(sorted(found, key=lambda chapter: chapter.room))


def labels_of(geometry: GridGeometry, outlines: Sequence[Polygon]) -> NDArray[np.int16]:
    """Return the number of each pixel's outline, int16 (rows, cols): from 1, 0 for none.

    A pixel within several outlines gets the number of the last one.
    """
    whole = geometry.window
    labels = np.zeros((geometry.rows, geometry.cols), np.int16)
    for number, outline in enumerate(outlines, 1):
        corners = tuple(geometry.to_pixels(x, y) for x, y in outline)
        x0, y0, x1, y1 = polygon_bounds(corners)
        around = Window(math.floor(y0), math.floor(x0), math.ceil(y1), math.ceil(x1))
        if box := around.intersection(whole):
            labels[box.slices_in(whole)][cells_inside(corners, box, 1.0)] = number
    return labels


def _work_s(data: RunData, states: Sequence[Span]) -> NDArray[np.float64]:
    """Return the working time from each pose to the next [s], float64 (n - 1,)."""
    times = data.times
    lasted = np.diff(times)
    lasted[lasted > (data.lost_pose_s or math.inf)] = 0.0
    for span in states:
        if span.name in RESTS:
            lasted[(times[:-1] >= span.begin_s) & (times[:-1] < span.end_s)] = 0.0
    return lasted


def _passes(data: RunData, room: RoomReport) -> int | None:
    """Return the current pass of a room in the last order that names it; None for none."""
    titles = (room.title, f"room {room.id}")
    for each in reversed(data.statuses):
        for zone in each.status.mission.zones:
            if zone.name in titles:
                return zone.pass_number
    return None
