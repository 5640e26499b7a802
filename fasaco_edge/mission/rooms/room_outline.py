"""Room outlines: polygons with few corners around rooms' squares; and joins between rooms."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Point, Polygon, Window
from fasaco_edge.grid.polygons import area_m2, is_near, polygon_flaw
from fasaco_edge.kernels.lattice.areas import find_areas
from fasaco_edge.mission.coverage.floor_tiles import Mask
from fasaco_edge.mission.rooms.room_book import LEAST_M2, MOST_NUMBER, Room, RoomBook, RoomSheet
from fasaco_edge.mission.rooms.room_raster import Ids

# Change of a room after which its outline is updated [m2]: pixels along walls are noisy.
STALE_M2 = 0.1
MOST_CORNERS = 100
# Largest distance of a dropped corner from the outline [m]: the first value that gives a valid
# outline is used.
TOLERANCES_M = (0.12, 0.06, 0.0, 0.25, 0.5, 1.0)
# Least length of the border that joined rooms share [m]: a doorway for a robot.
LEAST_DOOR_M = 0.3
# Steps along the border (row, col): east, north, west, south; the inside lies on the left.
STEPS = ((0, 1), (1, 0), (0, -1), (-1, 0))


def largest_part(mask: Mask) -> Mask:
    """Return the largest part connected by edges; the first of equal parts."""
    areas = find_areas(mask.astype(np.uint8))
    if len(areas.cells) < 2:
        return mask
    largest: Mask = areas.labels == 1 + int(np.argmax(areas.cells))
    return largest


def outline(window: Window, mask: Mask, square_m: float) -> Polygon:
    """Return the outline of the largest part of a room, counter-clockwise, without its holes [m].

    It has at most ``MOST_CORNERS`` corners, and does not touch itself.

    Args:
        window: the squares.
        mask: bool (rows, cols), the room's squares; at least one.
        square_m: edge of a square [m].
    """
    corners = _traced(_without_pinches(largest_part(mask)))
    for tolerance_m in TOLERANCES_M:
        kept = _simplified(corners, tolerance_m / square_m)
        found = tuple(_place(corner, window, square_m) for corner in kept.tolist())
        if len(found) <= MOST_CORNERS and not polygon_flaw(found):
            return found
    (row0, col0), (row1, col1) = corners.min(axis=0), corners.max(axis=0)
    box = ((row0, col0), (row0, col1), (row1, col1), (row1, col0))
    return tuple(_place([int(row), int(col)], window, square_m) for row, col in box)


def _place(corner: list[int], window: Window, square_m: float) -> Point:
    x, y = (corner[1] + window.col0) * square_m, (corner[0] + window.row0) * square_m
    return round(x, 3), round(y, 3)


def _without_pinches(mask: Mask) -> Mask:
    """Return the squares, with some added so that no two touch only at a corner."""
    mask = np.pad(mask, 1)
    while True:
        sw, se, nw, ne = mask[:-1, :-1], mask[:-1, 1:], mask[1:, :-1], mask[1:, 1:]
        rising, falling = sw & ne & ~se & ~nw, se & nw & ~sw & ~ne
        if not (rising.any() or falling.any()):
            return mask[1:-1, 1:-1]
        se |= rising
        sw |= falling


def _traced(mask: Mask) -> NDArray[np.int64]:
    inside = np.pad(mask, 1)
    row, col = (int(first) for first in divmod(int(np.argmax(inside)), inside.shape[1]))
    begin, heading = (row, col), 0
    at, corners = begin, [begin]
    while True:
        step = STEPS[heading]
        at = at[0] + step[0], at[1] + step[1]
        # The squares ahead, right and left of the border.
        right, left = _ahead(at, heading)
        turn = -1 if inside[right] else 0 if inside[left] else 1
        if at == begin and (heading + turn) % 4 == 0:
            break
        if turn:
            corners.append(at)
        heading = (heading + turn) % 4
    return np.array(corners, np.int64) - 1


def _ahead(at: tuple[int, int], heading: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the squares (row, col) right and left ahead of a corner."""
    row, col = at
    return (
        ((row - 1, col), (row, col)),
        ((row, col), (row, col - 1)),
        ((row, col - 1), (row - 1, col - 1)),
        ((row - 1, col - 1), (row - 1, col)),
    )[heading]


def _simplified(corners: NDArray[np.int64], tolerance: float) -> NDArray[np.int64]:
    """Return the corners kept by the Douglas-Peucker algorithm, int64 (m, 2).

    The closed border is divided at its first corner and at the corner farthest from it.
    """
    if tolerance <= 0.0 or len(corners) <= 4:
        return corners
    far = int(np.argmax(((corners - corners[0]) ** 2).sum(axis=1)))
    closed = np.concatenate((corners, corners[:1])).astype(np.float64)
    keep = np.zeros(len(closed), np.bool_)
    keep[[0, far, -1]] = True
    spans = [(0, far), (far, len(closed) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        start, along = closed[first], closed[last] - closed[first]
        off = closed[first + 1 : last] - start
        length2 = float((along**2).sum())
        share = np.clip((off @ along) / length2, 0.0, 1.0) if length2 else np.zeros(len(off))
        away = ((off - share[:, np.newaxis] * along) ** 2).sum(axis=1)
        worst = int(np.argmax(away))
        if away[worst] > tolerance**2:
            keep[first + 1 + worst] = True
            spans += [(first, first + 1 + worst), (first + 1 + worst, last)]
    return corners[keep[:-1]]


def room_joins(ids: Ids, square_m: float) -> dict[int, tuple[int, ...]]:
    """Return the numbers of the rooms that each room is joined to."""
    shared = Counter[tuple[int, int]]()
    for here, there in ((ids[1:], ids[:-1]), (ids[:, 1:], ids[:, :-1])):
        is_border = (here != there) & (here > 0) & (there > 0)
        pairs = np.sort(np.stack((here[is_border], there[is_border])), axis=0).astype(np.int64)
        values, counts = np.unique(pairs[0] << 16 | pairs[1], return_counts=True)
        for value, count in zip(values.tolist(), counts.tolist(), strict=True):
            shared[value >> 16, value & 0xFFFF] += count
    found = dict[int, set[int]]()
    for (one, other), count in shared.items():
        if count * square_m >= LEAST_DOOR_M:
            found.setdefault(one, set()).add(other)
            found.setdefault(other, set()).add(one)
    return {room: tuple(sorted(others)) for room, others in found.items()}


def stale(sheet: RoomSheet, before: Ids) -> list[int]:
    """Return the rooms with outdated outlines."""
    after = sheet.raster.ids
    squares = np.bincount(after.ravel(), minlength=MOST_NUMBER + 1)
    other = before != after
    changed = np.bincount(np.concatenate((before[other], after[other])), minlength=1)
    for room in np.flatnonzero(changed).tolist():
        sheet.stale[room] = sheet.stale.get(room, 0) + int(changed[room])
    least = STALE_M2 / sheet.raster.square_m**2
    return [
        number
        for number, room in sheet.rooms.items()
        if sheet.stale.get(number, 0) >= least or bool(room.outline) != bool(squares[number])
    ]


def refresh(book: RoomBook, changed: Iterable[int]) -> None:
    """Update outline and area of changed rooms, and the neighbours of all rooms."""
    sheet = book.sheet
    rooms = set(changed)
    if sheet is None or not rooms:
        return
    for room in rooms:
        sheet.stale.pop(room, None)
    square_m = sheet.raster.square_m
    beside, shapes = room_joins(sheet.raster.ids, square_m), list[Room]()
    for known in book.rooms:
        shape = replace(known, neighbours=beside.get(known.id, ()), encloses=())
        if known.id in rooms:
            window, mask = sheet.raster.squares(known.id)
            shape = replace(
                shape,
                outline=outline(window, mask, square_m) if mask.any() else (),
                area_m2=round(int(np.count_nonzero(mask)) * square_m**2, 2),
            )
        shapes.append(shape)
    # Rooms whose outline has a hole large enough for a room.
    rings = {
        each.id
        for each in shapes
        if each.outline and area_m2(each.outline) > each.area_m2 + LEAST_M2
    }
    inner = {each.id: _inner_point(sheet, each.id) for each in shapes if rings and each.outline}
    for each in shapes:
        encloses: list[int] = []
        if each.id in rings:
            encloses = [at for at, point in inner.items() if is_near(each.outline, point, 0.0)]
        book.put(replace(each, encloses=tuple(at for at in encloses if at != each.id)))


def _inner_point(sheet: RoomSheet, room: int) -> Point:
    """Return the centre of a square of a room, away from its border."""
    window, mask = sheet.raster.squares(room)
    row, col = find_areas(largest_part(mask).astype(np.uint8)).inner[0].tolist()
    square_m = sheet.raster.square_m
    return (window.col0 + col + 0.5) * square_m, (window.row0 + row + 0.5) * square_m
