"""Homes and offices with furniture and known rooms, and the part that a robot has seen.

A home has a hall with rooms on both sides; some lie behind others, some are joined by a wide
passage. An office has a corridor with rooms and an open-plan room. Walls are at any angle.
Furniture is as seen by a laser scanner at ankle height: a table is four legs, a cabinet is unknown
inside. The same seed gives the same floor (with the same release of numpy).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.random import PCG64, Generator
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from fasaco_edge.kernels.lattice.raycast import Scanner, cast_rays, reveal_disc

KINDS = ("home", "office")
RESOLUTION_M = 0.05
# Range of the scanner, and radius around the robot that is always seen [m].
REACH_M, HULL_M = 8.0, 0.25
# Floor in front of a door that stays clear of furniture [m].
CLEAR_M = 0.8
# A box (x0, y0, x1, y1) [m] in the building's own frame.
Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Home:
    """A floor and its true rooms.

    Attributes:
        name: its kind and seed.
        grid: the map of all of it.
        rooms: int32 (rows, cols), the true room of each pixel, from 1; 0 for walls and doors.
        start: a free pixel (row, col) in the first room.
    """

    name: str
    grid: OccupancyGrid
    rooms: NDArray[np.int32]
    start: tuple[int, int]


@dataclass(slots=True)
class _Plan:
    """A building being drawn, in its own frame [m]."""

    rooms: list[list[Box]] = field(default_factory=list)
    doors: list[Box] = field(default_factory=list)
    blocks: list[Box] = field(default_factory=list)


def home(kind: str, seed: int) -> Home:
    """Return a floor of one of ``KINDS``."""
    rng = Generator(PCG64((seed, len(kind))))
    plan = _Plan()
    (_lay_home if kind == "home" else _lay_office)(plan, rng)
    for boxes in plan.rooms:
        _furnish(plan, boxes[0], kind == "office", rng)
    return _drawn(f"{kind}-{seed}", plan, float(rng.uniform(-40.0, 40.0)))


def seen(floor: Home, share: float, seed: int) -> OccupancyGrid:
    """Return what a robot has mapped once it saw ``share`` of the free floor, the same geometry.

    With a share of 1 it has seen all that it can: not what is behind furniture.
    """
    wanted = share * np.count_nonzero(floor.grid.cells == FREE)
    grid = floor.grid
    for grid in growing(floor, seed):
        if np.count_nonzero(grid.cells == FREE) >= wanted:
            break
    return grid


def growing(floor: Home, seed: int) -> Iterator[OccupancyGrid]:
    """Yield what a robot has mapped at each place from which it looks, the same geometry."""
    truth, rng = floor.grid.cells, Generator(PCG64((seed, 1)))
    known = np.full_like(truth, UNKNOWN)
    angles = np.arange(0.0, 2.0 * math.pi, RESOLUTION_M / REACH_M)
    rays = np.column_stack((np.cos(angles), np.sin(angles)))
    is_free = truth == FREE
    place, unvisited = np.array(floor.start), _roomy(is_free)
    while True:
        x, y = place[1] + 0.5, place[0] + 0.5
        cast_rays(truth, known, Scanner(x, y, REACH_M / RESOLUTION_M, 0), rays)
        reveal_disc(truth, known, x, y, HULL_M / RESOLUTION_M)
        yield OccupancyGrid(floor.grid.geometry, known.copy(), floor.grid.frame)
        # On to the nearest place from which something new may be seen, or nearly the nearest.
        unvisited[tuple(slice(max(at - 5, 0), at + 6) for at in place)] = False
        frontier = unvisited & (known == FREE) & _beside(is_free & (known == UNKNOWN), 8)
        places = np.argwhere(frontier)
        if not len(places):
            return
        far = np.hypot(*(places - place).T)
        near = np.flatnonzero(far <= far.min() + 0.5 / RESOLUTION_M)
        place = places[rng.choice(near)]


def _beside(mask: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Return the pixels at most ``reach`` pixels along both axes from a marked one."""
    for axis in (0, 1):
        grown = mask.copy()
        for by in range(1, reach + 1):
            for sign in (-1, 1):
                grown |= np.roll(mask, sign * by, axis)
        mask = grown
    return mask


def _roomy(is_free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return ~_beside(~is_free, round(0.2 / RESOLUTION_M))


def _lay_home(plan: _Plan, rng: Generator) -> None:
    """A hall; on both sides a row of rooms, some of them two deep."""
    length, wide, wall = rng.uniform(7.0, 13.0), rng.uniform(1.1, 1.8), rng.uniform(0.1, 0.2)
    plan.rooms.append([(0.0, 0.0, length, wide)])
    for up in (True, False):
        depth = rng.uniform(3.0, 5.2)
        y0, y1 = (wide + wall, wide + wall + depth) if up else (-wall - depth, -wall)
        x = 0.0
        while x < length - 1.6:
            size = min(rng.uniform(1.7, 5.2), length - x)
            if length - x - size < 1.9:
                size = length - x
            _lay_rooms(plan, (x, y0, x + size, y1), up, wall, rng)
            x += size + wall


def _lay_rooms(plan: _Plan, box: Box, up: bool, wall: float, rng: Generator) -> None:
    """One room at the hall, or two of which one is behind or beside the other."""
    x0, y0, x1, y1 = box
    chance = rng.random()
    depth = y1 - y0
    inner = box
    if chance < 0.25 and depth > 3.9 and x1 - x0 > 1.8:
        # A room behind, entered through the one in front.
        cut = y0 + depth * rng.uniform(0.42, 0.58)
        front, back = (x0, y0, x1, cut), (x0, cut + wall, x1, y1)
        if not up:
            front, back = (x0, cut + wall, x1, y1), (x0, y0, x1, cut)
        at = rng.uniform(x0 + 0.2, x1 - 1.1)
        opening = min(1.2 if rng.random() < 0.3 else rng.uniform(0.75, 0.95), x1 - at - 0.1)
        plan.doors.append((at, cut, at + opening, cut + wall))
        plan.rooms += [[front], [back]]
        inner = front
    elif chance < 0.4 and x1 - x0 > 3.4:
        # An L: a small bath or store in its corner at the outer wall.
        bath_w, bath_d = rng.uniform(1.3, 1.9), rng.uniform(1.5, 2.2)
        edge, far = (y1 - bath_d, y1) if up else (y0, y0 + bath_d)
        bath = (x0, edge, x0 + bath_w, far)
        rest = (x0, y0, x1, edge - wall) if up else (x0, far + wall, x1, y1)
        plan.rooms += [[rest, (x0 + bath_w + wall, y0, x1, y1)], [bath]]
        at = rng.uniform(edge + 0.1, far - 0.9)
        plan.doors.append((x0 + bath_w, at, x0 + bath_w + wall, at + 0.75))
        inner = rest
    else:
        plan.rooms.append([box])
    width = rng.uniform(0.75, 0.95) if rng.random() < 0.85 else 1.15
    at = rng.uniform(inner[0] + 0.05, max(inner[2] - width - 0.05, inner[0] + 0.06))
    door_y = y0 - wall if up else y1
    plan.doors.append((at, door_y, at + width, door_y + wall))


def _lay_office(plan: _Plan, rng: Generator) -> None:
    """A corridor, rooms on both sides, an open-plan office at its end."""
    length, wide, wall = rng.uniform(14.0, 24.0), rng.uniform(1.6, 2.6), rng.uniform(0.1, 0.25)
    plan.rooms.append([(0.0, 0.0, length, wide)])
    for up in (True, False):
        depth = rng.uniform(3.5, 6.5)
        y0, y1 = (wide + wall, wide + wall + depth) if up else (-wall - depth, -wall)
        x = 0.0
        while x < length - 2.2:
            size = min(rng.uniform(2.4, 7.5), length - x)
            if length - x - size < 2.4:
                size = length - x
            box = (x, y0, x + size, y1)
            plan.rooms.append([box])
            doors = 1 + (size > 6.0)
            for number in range(doors):
                width = rng.uniform(0.85, 1.15)
                low, high = x + number * size / doors + 0.1, x + (number + 1) * size / doors - 0.1
                at = rng.uniform(low, high - width)
                door_y = y0 - wall if up else y1
                plan.doors.append((at, door_y, at + width, door_y + wall))
            if x > 0 and rng.random() < 0.2:
                at = rng.uniform(y0 + 0.3, y1 - 1.3)
                plan.doors.append((x - wall, at, x, at + 0.9))
            x += size + wall
    side = rng.uniform(6.0, 10.0)
    y0 = wide / 2 - side / 2
    plan.rooms.append([(length + wall, y0, length + wall + side, y0 + side)])
    width = rng.uniform(0.9, min(1.25, wide - 0.3))
    at = rng.uniform(0.1, wide - width - 0.1)
    plan.doors.append((length, at, length + wall, at + width))


def _furnish(plan: _Plan, box: Box, is_office: bool, rng: Generator) -> None:
    x0, y0, x1, y1 = box
    wide, deep = x1 - x0, y1 - y0
    if min(wide, deep) < 1.35 and max(wide, deep) > 3.0:
        # A hall: a narrow chest or none.
        if rng.random() < 0.6:
            _along_wall(plan, box, (rng.uniform(0.6, 1.2), 0.3), rng)
        return
    if wide * deep < 4.5:
        for size in ((0.6, 0.4), (0.4, 0.55), (0.6, 0.6)):
            _along_wall(plan, box, size, rng)
        return
    # Along walls: wardrobes, beds, worktops, sofas, shelves.
    sizes = ((2.0, 0.6), (1.2, 0.6), (1.6, 2.0), (0.9, 2.0), (2.0, 0.9), (1.6, 0.35), (2.8, 0.6))
    for _ in range(int(rng.integers(2, 4)) + int(wide * deep > 14)):
        _along_wall(plan, box, sizes[int(rng.integers(len(sizes)))], rng)
    for _ in range(int(wide * deep / (7.0 if is_office else 14.0))):
        _table(plan, box, rng)


def _clashes(plan: _Plan, box: Box, gap: float) -> bool:
    return any(_overlap(box, door, CLEAR_M) for door in plan.doors) or any(
        _overlap(box, other, gap) for other in plan.blocks
    )


def _overlap(a: Box, b: Box, gap: float) -> bool:
    return a[0] < b[2] + gap and b[0] < a[2] + gap and a[1] < b[3] + gap and b[1] < a[3] + gap


def _along_wall(plan: _Plan, box: Box, size: tuple[float, float], rng: Generator) -> None:
    """Put a thing of width and depth ``size`` with its back to a wall, if there is room."""
    x0, y0, x1, y1 = box
    for _ in range(6):
        along, deep = size
        off = rng.choice((0.0, 0.0, 0.05, 0.1))
        side = int(rng.integers(4))
        if side < 2:
            if along > x1 - x0:
                continue
            at = rng.uniform(x0, x1 - along)
            low = y0 + off if side == 0 else y1 - deep - off
            thing = (at, low, at + along, low + deep)
        else:
            if along > y1 - y0:
                continue
            at = rng.uniform(y0, y1 - along)
            low = x0 + off if side == 2 else x1 - deep - off
            thing = (low, at, low + deep, at + along)
        inside = thing[0] >= x0 and thing[1] >= y0 and thing[2] <= x1 and thing[3] <= y1
        if inside and not _clashes(plan, thing, 0.45 if rng.random() < 0.7 else 0.0):
            plan.blocks.append(thing)
            return


def _table(plan: _Plan, box: Box, rng: Generator) -> None:
    """Put a table on four legs somewhere, with chairs, or a closed desk or kitchen block."""
    x0, y0, x1, y1 = box
    for _ in range(8):
        wide, deep = rng.uniform(0.8, 1.8), rng.uniform(0.7, 0.9)
        if wide > x1 - x0 - 0.8 or deep > y1 - y0 - 0.8:
            return
        x, y = rng.uniform(x0 + 0.4, x1 - wide - 0.4), rng.uniform(y0 + 0.4, y1 - deep - 0.4)
        table = (x, y, x + wide, y + deep)
        if _clashes(plan, table, 0.5):
            continue
        if rng.random() < 0.2:
            plan.blocks.append(table)
            return
        legs = [table]
        for _ in range(int(rng.integers(1, 5))):
            a = x + rng.uniform(0.0, wide - 0.4)
            b = y - 0.3 if rng.random() < 0.5 else y + deep - 0.1
            legs.append((a, b, a + 0.4, b + 0.4))
        for a, b, c, d in legs:
            for leg_x, leg_y in ((a, b), (c - 0.05, b), (a, d - 0.05), (c - 0.05, d - 0.05)):
                plan.blocks.append((leg_x, leg_y, leg_x + 0.05, leg_y + 0.05))
        return


def _drawn(name: str, plan: _Plan, angle_deg: float) -> Home:
    """Return the plan as pixels, turned by an angle."""
    boxes = [box for boxes in plan.rooms for box in boxes] + plan.doors
    corners = np.array([(x, y) for x0, y0, x1, y1 in boxes for x in (x0, x1) for y in (y0, y1)])
    turn = math.radians(angle_deg)
    cos, sin = math.cos(turn), math.sin(turn)
    turned = corners @ np.array([[cos, sin], [-sin, cos]])
    low, high = turned.min(axis=0) - 0.6, turned.max(axis=0) + 0.6
    rows, cols = (math.ceil((high - low)[axis] / RESOLUTION_M) for axis in (1, 0))
    px = low[0] + (np.arange(cols) + 0.5) * RESOLUTION_M
    py = low[1] + (np.arange(rows) + 0.5)[:, None] * RESOLUTION_M
    x, y = px * cos + py * sin, py * cos - px * sin

    def inside(box: Box, shrunk: float = 0.0) -> NDArray[np.bool_]:
        x0, y0, x1, y1 = box
        result: NDArray[np.bool_] = (x >= x0 + shrunk) & (x < x1 - shrunk)
        result &= (y >= y0 + shrunk) & (y < y1 - shrunk)
        return result

    rooms = np.zeros((rows, cols), np.int32)
    for number, parts in enumerate(plan.rooms, 1):
        for part in parts:
            rooms[inside(part)] = number
    free = rooms > 0
    for door in plan.doors:
        x0, y0, x1, y1 = door
        # A little into the rooms, so that no pixel of a turned wall stays in the door.
        free |= inside((x0, y0, x1, y1), -0.03 if min(x1 - x0, y1 - y0) < 0.3 else 0.0)
    cells = np.full((rows, cols), UNKNOWN, np.int8)
    cells[_beside(free, 2) & ~free] = OCCUPIED
    cells[free] = FREE
    for block in plan.blocks:
        area = inside(block)
        cells[area] = OCCUPIED
        if min(block[2] - block[0], block[3] - block[1]) > 0.3:
            cells[inside(block, 0.1)] = UNKNOWN
    rooms[cells != FREE] = 0
    places = np.argwhere((rooms == 1) & _roomy(cells == FREE))
    row, col = places[len(places) // 2].tolist()
    geometry = GridGeometry(rows, cols, RESOLUTION_M, Pose2D(float(low[0]), float(low[1])))
    return Home(name, OccupancyGrid(geometry, cells), rooms, (row, col))
