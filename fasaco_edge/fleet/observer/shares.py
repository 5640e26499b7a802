"""Shares of the robots in a division, and the cells that several of them swept.

A cell belongs to the robot whose seed has the shortest travel time to it, plus its handicap, as in
the robots' own division; here over the cells that they report as reachable.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.observer.cells import (
    FAR,
    Cells,
    Seat,
    distances,
    mask_of,
    together,
    window_of,
)
from fasaco_edge.fleet.observer.members import M, Members
from fasaco_edge.grid.geometry import GridGeometry, Window

NOBODY = -1


@dataclass(frozen=True, slots=True, eq=False)
class Shares:
    """Owners of the remaining cells.

    Attributes:
        geometry: of the cells, in the fleet's frame.
        owners: number of the robot of each cell, int16 (rows, cols); NOBODY for none.
        cells: number of cells of each robot, by its name.
    """

    geometry: GridGeometry
    owners: NDArray[np.int16]
    cells: Counter[str]


def union_on(seat: Seat, members: Members[M], what: str) -> Cells:
    """Return cells of all robots on one robot's lattice, int64 (n, 2); ``what``: of which set."""
    return together(member.seat.carried(getattr(member, what).cells(), seat) for member in members)


def shares_of(members: Members[M], now_ns: int) -> Shares | None:
    """Return the shares by the division in force at a time; None before there is one."""
    telling = members.dividing(now_ns)
    if telling is None:
        return None
    ground = union_on(telling.seat, members, "ground")
    window = window_of(ground)
    if window is None:
        return None
    known = mask_of(ground, window)
    owners = owners_of(telling, members, known, window)
    owners[mask_of(union_on(telling.seat, members, "swept"), window)] = NOBODY
    names = {member.number: member.name for member in members}
    counted = zip(*np.unique(owners[owners != NOBODY], return_counts=True), strict=True)
    cells = Counter({names[int(number)]: int(count) for number, count in counted})
    return Shares(telling.seat.geometry(window), owners, cells)


def owners_of(
    telling: M,
    members: Members[M],
    known: NDArray[np.bool_],
    window: Window,
    most_steps: int | None = None,
) -> NDArray[np.int16]:
    """Return the number of the robot that a division gives each cell to; NOBODY for none.

    Args:
        telling: a robot that sends the division.
        members: the robots.
        known: reachable cells, bool (rows, cols).
        window: of these cells, on the telling robot's lattice.
        most_steps: largest number of steps searched, over all robots; None for no limit.
    """
    first = np.full(known.shape, np.float32(np.inf))
    owners = np.full(known.shape, NOBODY, np.int16)
    if not telling.newest.parts:
        owners[known] = telling.number
        return owners
    for part in sorted(telling.newest.parts, key=lambda part: part.robot):
        member = members.get(part.robot)
        if member is None:
            continue
        away = distances(known, (part.row - window.row0, part.col - window.col0), most_steps)
        if most_steps is not None:
            most_steps -= int(away[away < FAR].max(initial=0))
        times_s = away * np.float32(part.step_s) + np.float32(part.handicap_s)
        is_earlier = (times_s < first) & (away < FAR)
        owners[is_earlier] = member.number
        first[is_earlier] = times_s[is_earlier]
    return owners


def swept_twice(members: Members[M]) -> tuple[GridGeometry, NDArray[np.bool_]] | None:
    """Return the cells that two or more robots swept, and where they lie; None for none."""
    seats = [member.seat for member in members]
    if len(seats) < 2:
        return None
    each = [member.seat.carried(member.swept.cells(), seats[0]) for member in members]
    cells, counts = np.unique(
        np.concatenate([np.unique(one, axis=0) for one in each]), axis=0, return_counts=True
    )
    twice = cells[counts > 1]
    window = window_of(twice)
    if window is None:
        return None
    return seats[0].geometry(window), mask_of(twice, window)
