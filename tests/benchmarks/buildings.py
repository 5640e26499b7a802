"""Synthetic buildings of any size, to measure how planners scale.

Corridors divide the floor into blocks until a block is shallow enough for two rows of rooms, or by
chance becomes a hall. So larger buildings have more rooms, doors and furniture, of the same sizes.
Cells are 0.3 m wide.

All parts are drawn on views of one array, rotated and mirrored so that row 0 is the wall with the
door. Blocks and rooms have walls of one cell at their first and last rows and columns.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.random import Generator
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.planners.grids import MAP_FOOTPRINT, NamedGrid

# Kinds of cells of a floor plan.
SOLID, ROOM, CORRIDOR = 0, 1, 2

FEWEST_CELLS = 1_000
# How far from the number asked for the number of free cells may be.
TOLERANCE = 0.02
# Free cells per cell within the outline, about; corrected by the plans that missed.
FREE_SHARE = 0.735

# Sizes [cells]. A block that is deeper or longer than this is divided by another corridor.
DEEPEST_BLOCK, LONGEST_BLOCK = 46, 110
LONGEST_HALL, SHALLOWEST_BLOCK = 80, 11
NARROWEST_CORRIDOR, WIDEST_CORRIDOR = 4, 7
DEEPEST_ROOM, NARROWEST_ROOM, USUAL_ROOM, WIDEST_ROOM = 20, 6, 11, 34
# Shares of the blocks.
HALL_SHARE, YARD_SHARE = 0.12, 0.03
# Share of the rooms.
LOCKED_SHARE = 0.05
# Share of the walls between rooms.
LINKED_SHARE = 0.12

Plan = NDArray[np.uint8]
# Whether there is a corridor at a block's first row, last row, first column, last column.
Sides = tuple[bool, bool, bool, bool]


def building(cells: int, seed: int) -> NamedGrid:
    """Return a building of ``cells`` free cells, 2 % more or less, that starts in a corridor.

    All free cells are connected. The same arguments give the same building (with the same
    release of numpy, since another may draw differently).

    Raises:
        ValueError: ``cells`` are too few for a corridor and rooms (``FEWEST_CELLS``).
    """
    if cells < FEWEST_CELLS:
        raise ValueError(f"cells must be at least {FEWEST_CELLS}, got {cells}")
    rng = Generator(np.random.PCG64((seed, cells)))
    outlines = found = 0
    while True:
        side = math.sqrt(cells / (found / outlines if found else FREE_SHARE))
        aspect = rng.uniform(0.92, 1.09)
        plan = floor_plan(round(side * aspect), round(side / aspect), rng)
        row, col = rng.choice(np.argwhere(plan == CORRIDOR)).tolist()
        steps = CoverageLattice.from_free(plan != SOLID).steps
        free = reachable_from(steps, row, col).astype(bool)
        count = int(np.count_nonzero(free))
        if abs(count - cells) <= TOLERANCE * cells:
            lattice = CoverageLattice.from_free(free, MAP_FOOTPRINT.cell_m)
            return NamedGrid(f"building-{cells}-s{seed}", lattice, (row, col))
        outlines, found = outlines + free.size, found + count


def floor_plan(rows: int, cols: int, rng: Generator) -> Plan:
    """Return what each cell is, uint8 (rows, cols): SOLID, ROOM or CORRIDOR.

    All corridors are connected; furniture and locked rooms may cut off a few cells of rooms.
    """
    plan = np.full((rows, cols), SOLID, np.uint8)
    corridors: list[Plan] = []
    _divide(plan, (False, False, False, False), rng, corridors)
    for outer_wall in (plan[0], plan[-1], plan[:, 0], plan[:, -1]):
        outer_wall[:] = SOLID
    for corridor in corridors:
        _put_along_wall(corridor, rng)
        _put_along_wall(corridor[:, ::-1], rng)
    return plan


def _divide(block: Plan, sides: Sides, rng: Generator, corridors: list[Plan]) -> None:
    """Fill a block, or lead a corridor through it and divide what lies on either side."""
    outermost = not any(sides)
    # Doors go to row 0: to corridors on two opposite sides if there are, else on the longer.
    if (sum(sides[2:]), block.shape[0]) > (sum(sides[:2]), block.shape[1]):
        block, sides = block.T, sides[2:] + sides[:2]
    if not sides[0]:
        block, sides = block[::-1], (sides[1], sides[0], *sides[2:])
    depth, length = block.shape
    fits = depth <= DEEPEST_BLOCK and length <= LONGEST_BLOCK
    hall = max(depth, length) <= LONGEST_HALL and rng.random() < HALL_SHARE
    if not outermost and (fits or hall):
        _fill(block, sides, hall, rng)
        return
    # The corridor has to meet one that is there, at its first row or its last.
    if depth > length and (any(sides[2:]) or outermost):
        block, sides, length = block.T, sides[2:] + sides[:2], depth
    width = int(rng.integers(NARROWEST_CORRIDOR, WIDEST_CORRIDOR + 1))
    furthest = length - width - SHALLOWEST_BLOCK
    if furthest < SHALLOWEST_BLOCK:
        _fill(block, sides, True, rng)
        return
    at = int((length - width) * rng.uniform(0.35, 0.65))
    at = min(max(at, SHALLOWEST_BLOCK), furthest)
    block[:, at : at + width] = CORRIDOR
    corridors.append(block[:, at - 1 : at + width + 1])
    _divide(block[:, :at], (*sides[:3], True), rng, corridors)
    _divide(block[:, at + width :], (*sides[:2], True, sides[3]), rng, corridors)


def _put_along_wall(corridor: Plan, rng: Generator) -> None:
    """Put benches and boxes along a corridor's first wall, column 0, but not at doors."""
    wall = corridor[:, 0]
    for at in rng.integers(2, len(corridor), len(corridor) // 12).tolist():
        length = int(rng.integers(1, 5))
        if not wall[at - 2 : at + length + 2].any():
            corridor[at : at + length, 1] = SOLID


def _fill(block: Plan, sides: Sides, hall: bool, rng: Generator) -> None:
    """Make a block a hall or rows of rooms, or leave it closed: a yard, a shaft."""
    if rng.random() < YARD_SHARE:
        return
    if hall:
        block[1:-1, 1:-1] = ROOM
        walls = zip((block, block[::-1], block.T, block.T[::-1]), sides, strict=True)
        open_walls = [wall[:3] for wall, opens in walls if opens]
        rooms = [block]
        doors = [_door(wall, rng) for wall in open_walls for _ in range(0, wall.shape[1], 30)]
    else:
        rooms, doors = _rooms(block, sides[1], rng)
    for room in rooms:
        _furnish(room[1:-1, 1:-1], rng)
    for door in doors:
        door[:] = ROOM


def _rooms(block: Plan, opens_at_back: bool, rng: Generator) -> tuple[list[Plan], list[Plan]]:
    """Divide a block into one or two rows of rooms; return them and their doors."""
    depth = len(block)
    if depth <= DEEPEST_ROOM:
        rooms, doors = _row_of_rooms(block, block[:3], rng)
        if opens_at_back:
            doors += [_door(room[::-1][:3], rng) for room in rooms if rng.random() < 0.3]
        return rooms, doors
    middle = depth // 2 + int(rng.integers(-(depth // 8), depth // 8 + 1))
    rooms, doors = _row_of_rooms(block[: middle + 1], block[:3], rng)
    # Without a corridor at the back one gets to the inner rooms through those in front.
    wall = block[::-1][:3] if opens_at_back else block[middle - 2 : middle + 3]
    behind = block[middle:][::-1] if opens_at_back else block[middle:]
    more_rooms, more_doors = _row_of_rooms(behind, wall, rng)
    return rooms + more_rooms, doors + more_doors


def _row_of_rooms(row: Plan, across: Plan, rng: Generator) -> tuple[list[Plan], list[Plan]]:
    """Free rooms side by side; their doors go through the wall that ``across`` crosses."""
    walls, last = [0], row.shape[1] - 1
    while walls[-1] < last:
        width = int(rng.triangular(NARROWEST_ROOM, USUAL_ROOM, WIDEST_ROOM))
        narrow = last - walls[-1] - width < NARROWEST_ROOM
        walls.append(last if narrow else walls[-1] + width)
    rooms, doors = [], []
    for left, right in pairwise(walls):
        if rng.random() < LOCKED_SHARE:
            continue
        rooms.append(row[:, left : right + 1])
        rooms[-1][1:-1, 1:-1] = ROOM
        wall = across[:, left : right + 1]
        doors += [_door(wall, rng) for _ in range(1 + (right - left) // 20)]
        if left and rng.random() < LINKED_SHARE:
            doors.append(_door(row[:, left - 2 : left + 3].T, rng))
    return rooms, doors


def _door(across: Plan, rng: Generator) -> Plan:
    """Choose a door of one to three cells; return the part of ``across`` to free for it.

    ``across`` has the wall among its rows, and what lies before and behind it in the others.
    """
    passable = np.count_nonzero(across, axis=0) >= len(across) - 1
    for width in range(int(rng.choice((1, 2, 2, 3, 3))), 0, -1):
        places = np.flatnonzero(sliding_window_view(passable, width).all(axis=1))
        if len(places):
            at = int(rng.choice(places))
            return across[:, at : at + width]
    return across[:, :0]


def _furnish(room: Plan, rng: Generator) -> None:
    """Furnish a room or hall, given without its walls."""
    room = (room, room[::-1], room.T, room.T[::-1])[int(rng.integers(4))]
    rows, cols = room.shape
    large = min(rows, cols) > DEEPEST_ROOM
    kind = rng.random()
    if kind < 0.35:
        _tables(room, (int(rng.integers(2, 4)), int(rng.integers(3, 7))), rng)
    elif kind < 0.6:
        _shelves(room, 3 if large else int(rng.integers(1, 3)), rng)
    elif kind < 0.7 and not large:
        _tables(room, (max(rows // 2, 2), max(cols // 2, 2)), rng)
    elif kind < 0.8 and not large:
        # Cubicles: thin walls from one side.
        room[: rows // 3, 3::4] = SOLID
    if large and kind > 0.5:
        pitch = int(rng.integers(8, 15))
        room[pitch // 2 :: pitch, pitch // 2 :: pitch] = SOLID
    for wall in (room, room.T[::-1]):
        for col in range(int(rng.integers(4)), wall.shape[1] - 2, 8):
            if rng.random() < 0.5:
                wall[: int(rng.integers(1, 3)), col : col + int(rng.integers(2, 7))] = SOLID
    for _ in range(int(rng.poisson((0.005 if large else 0.012) * room.size))):
        row, col = int(rng.integers(rows)), int(rng.integers(cols))
        room[row, col : col + int(rng.integers(1, 3))] = SOLID


def _tables(room: Plan, size: Cell, rng: Generator) -> None:
    """Put tables in rows and columns, some missing, with chairs here and there."""
    rows, cols = size
    gap = int(rng.integers(2, 6))
    # A laser scanner sees the legs of a table, or a desk that is closed to the floor.
    legs = rng.random() < 0.4
    for row in range(2, len(room) - rows - 1, rows + gap):
        for col in range(2, room.shape[1] - cols - 1, cols + gap):
            if rng.random() < 0.12:
                continue
            table = room[row : row + rows, col : col + cols]
            table[:: rows - 1 if legs else 1, :: cols - 1 if legs else 1] = SOLID
            for beside in (row - 1, row + rows):
                if rng.random() < 0.4:
                    room[beside, col + int(rng.integers(cols))] = SOLID


def _shelves(room: Plan, thick: int, rng: Generator) -> None:
    """Put rows of shelves with aisles between them, long rows with gaps."""
    pitch = 2 * thick + int(rng.integers(1, 4))
    for row in range(int(rng.integers(2, 4)), len(room) - thick - 1, pitch):
        col, last = 2, room.shape[1] - 2
        while last - col > 2:
            length = min(int(rng.integers(6, 25)), last - col)
            room[row : row + thick, col : col + length] = SOLID
            col += length + int(rng.integers(2, 4))
