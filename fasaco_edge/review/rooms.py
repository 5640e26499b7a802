"""The rooms of a recording: working time, swept and unswept floor of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Point, Polygon, Window, polygon_bounds
from fasaco_edge.grid.polygons import area_m2, is_near
from fasaco_edge.judge.floor import JudgedFloor
from fasaco_edge.mission.orders.zones import cells_inside
from fasaco_edge.review.moments import Span
from fasaco_edge.review.run_data import RunData
from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.rooms import RoomReport

# States in which the robot is not at work.
RESTS = ("idle", "done", "paused", "charging", "loading", "waiting for map", "waiting for pose")


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
    # 0 is in no room: doors, and floor beside furniture.
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
    whole = Window(0, 0, geometry.rows, geometry.cols)
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
