"""Refuge: the cell that a robot of a fleet goes to in order to make way, and its way there.

Two robots may stand almost in contact, for instance in a doorway. The robot that makes way must not
first come nearer to the other: its sensors, or contact, would stop it permanently.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.mission.traffic import AHEAD_M, Neighbour, Points, least_apart_m, spaced
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.lattice.reach import FAR, shortest_walk, ways_from
from fasaco_edge.mission.line.way import comes_nearer, corner_past

Places = Callable[[NDArray[np.int32]], Points]
Sees = Callable[[Points, Points], bool]


def discs(radius_m: float, neighbours: Mapping[str, Neighbour]) -> Points:
    """Return the discs that the robot's centre must stay out of, float64 (n, 3): x, y, radius [m].

    ``Route.beside`` takes them.
    """
    messages = [near.message for _, near in sorted(neighbours.items())]
    rows = [(one.x, one.y, least_apart_m(radius_m, one)) for one in messages]
    return np.array(rows, np.float64).reshape(-1, 3)


def refuge(
    area: ReachableArea,
    cell: Cell,
    place: tuple[float, float],
    radius_m: float,
    neighbours: Mapping[str, Neighbour],
    places: Places,
    sees: Sees,
) -> NDArray[np.int32] | None:
    """Return the cells of the way to the refuge, int32 (n, 2), or None.

    The refuge is the nearest cell outside the discs of other robots and off their paths; the way
    avoids their discs. The way begins at the robot's cell or a cell beside it, where the robot can
    drive without coming nearer to another robot. Else it begins at the robot's cell.

    Args:
        area: the reachable area.
        cell: the robot's cell.
        place: the robot's position (x, y) [m].
        radius_m: radius of its disc [m].
        neighbours: the other robots.
        places: returns the points of cells.
        sees: returns whether the robot can drive straight between two points.
    """
    lattice, window = area.lattice, area.lattice.window
    reach = math.ceil((2 * AHEAD_M + 2.0) / lattice.cell_m)
    row, col = lattice.local(cell)
    rows = slice(max(row - reach, 0), row + reach + 1)
    cols = slice(max(col - reach, 0), col + reach + 1)
    at = np.argwhere(area.reachable[rows, cols])
    corner = np.array((window.row0 + rows.start, window.col0 + cols.start))
    points = places((at + corner).astype(np.int32))
    is_free, is_passable = np.ones(len(at), np.bool_), np.ones(len(at), np.bool_)
    local = row - rows.start, col - cols.start
    here = (at == local).all(axis=1)
    for near in neighbours.values():
        message = near.message
        clear_m = least_apart_m(radius_m, message)
        theirs = spaced([(message.x, message.y), *message.ahead])
        apart = np.hypot(*(points[:, None] - theirs[None]).transpose(2, 0, 1))
        is_free &= (apart >= clear_m).all(axis=1)
        # A robot too near to another may only move away from it.
        is_farther = apart[:, 0] > math.dist(place, (message.x, message.y)) + 1e-6
        is_passable &= (apart[:, 0] >= clear_m) | here | is_farther
    closed = np.zeros(area.reachable[rows, cols].shape, np.bool_)
    closed[tuple(at[~is_passable].T)] = True
    steps = _inside(without(lattice.steps[rows, cols], closed))
    beside, first = discs(radius_m, neighbours), np.array(place)
    is_beside = (np.abs(at - local) <= 1).all(axis=1) & is_passable
    begins = [
        (math.dist(place, point) / lattice.cell_m, (begin[0], begin[1]))
        for begin, point in zip(at[is_beside].tolist(), points[is_beside], strict=True)
        if _leads_away(first, point, beside, sees)
    ]
    way = _nearest(steps, begins, at[is_free], corner)
    # Without such a way, the robot first comes nearer to another robot, which may let it pass.
    return _nearest(steps, [(0.0, local)], at[is_free], corner) if way is None else way


def _leads_away(here: Points, to: Points, beside: Points, sees: Sees) -> bool:
    """Return whether a straight drive, or a drive with one corner, comes no nearer to any robot."""
    if not comes_nearer(here, to, beside):
        return sees(here, to)
    corner = corner_past(here, to, beside)
    return corner is not None and sees(here, corner) and sees(corner, to)


def _nearest(
    steps: NDArray[np.uint8],
    begins: Sequence[tuple[float, Cell]],
    ends: NDArray[np.int64],
    corner: NDArray[np.int64],
) -> NDArray[np.int32] | None:
    """Return the shortest way from any of ``begins``, each with its distance from the robot."""
    best, way = float(FAR), None
    for far, begin in begins:
        away = ways_from(steps, begin[0] * steps.shape[1] + begin[1]).reshape(steps.shape)
        lengths = away[tuple(ends.T)]
        if len(ends) and lengths.min() < FAR and far + lengths.min() < best:
            best, way = far + float(lengths.min()), (begin, ends[int(lengths.argmin())].tolist())
    if way is None:
        return None
    begin, (row, col) = way
    cells: NDArray[np.int32] = (shortest_walk(steps, begin, (row, col)) + corner).astype(np.int32)
    return cells


def _inside(steps: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the step masks of a part of a lattice, without the steps that lead out of it."""
    edges = ((EAST, np.s_[:, -1]), (WEST, np.s_[:, 0]), (NORTH, np.s_[-1]), (SOUTH, np.s_[0]))
    for direction, edge in edges:
        steps[edge] &= np.uint8(0xFF ^ (1 << direction))
    return steps


def without(steps: NDArray[np.uint8], closed: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return step masks without steps from and to closed cells, uint8 (rows, cols)."""
    steps = np.where(closed, 0, steps).astype(np.uint8)
    for direction, here, there in (
        (EAST, np.s_[:, :-1], np.s_[:, 1:]),
        (WEST, np.s_[:, 1:], np.s_[:, :-1]),
        (NORTH, np.s_[:-1], np.s_[1:]),
        (SOUTH, np.s_[1:], np.s_[:-1]),
    ):
        steps[here] &= ~(closed[there].astype(np.uint8) << direction)
    return steps
