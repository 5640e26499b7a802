"""Floor of a picture: cells of a lattice, tinted by a walk's number of visits, and rooms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.plot import MapLayer, Plot
from fasaco_edge.drawing.sheet import KeyEntry
from fasaco_edge.grid.lattice import COVERABLE, Cell, CoverageLattice
from fasaco_edge.grid.rooms import FoundRooms
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.kernels.rooms.clearance import clearances

ENDS = (KeyEntry("disc", palette.START, "start"), KeyEntry("square", palette.END, "end"))
# Share of a room's colour on white, low so that drawings on a room are visible.
TINT = 0.38
# Distance up to which rooms are neighbours, the depth of a door [m].
NEAR_M = 0.2


def draw_visits(
    plot: Plot, lattice: CoverageLattice, visits: NDArray[np.integer], start: Cell
) -> list[KeyEntry]:
    """Tint the lattice's cells by number of visits; return the tints' legend.

    Args:
        plot: the plot to draw on.
        lattice: the planning grid.
        visits: number of visits of each cell, shape of the lattice.
        start: cell (row, col) from which reachable cells are found.
    """
    never = lattice.coverable & (visits == 0)
    reachable = _reachable(lattice, start)
    left_out, unreachable = never & reachable, never & ~reachable

    tints = np.array([palette.PAPER, palette.COVERED, *palette.REVISITED], np.uint8)
    colours = tints[np.minimum(visits, len(tints) - 1)]
    colours[left_out] = palette.LEFT_OUT
    plot.tint(lattice, colours)
    plot.hatch(lattice, unreachable, palette.UNREACHABLE)

    key = _visit_key(visits)
    if left_out.any():
        key.append(_entry("tile", palette.LEFT_OUT, "not passed", left_out))
    if unreachable.any():
        key.append(_entry("hatch", palette.UNREACHABLE, "unreachable", unreachable))
    return key


def _reachable(lattice: CoverageLattice, start: Cell) -> NDArray[np.bool_]:
    if not lattice.contains(start) or lattice.states[lattice.local(start)] != COVERABLE:
        # Without a valid start, all cells count as reachable.
        return np.ones(lattice.states.shape, np.bool_)
    return reachable_from(lattice.steps, *lattice.local(start)).astype(np.bool_)


def _visit_key(visits: NDArray[np.integer]) -> list[KeyEntry]:
    key = [*ENDS, _entry("tile", palette.COVERED, "covered once", visits == 1)]
    most = len(palette.REVISITED) + 1
    for times, colour in enumerate(palette.REVISITED, start=2):
        cells = visits >= times if times == most else visits == times
        if cells.any():
            label = f"{times} times or more" if times == most else f"{times} times"
            key.append(_entry("tile", colour, label, cells))
    return key


def _entry(symbol: str, colour: palette.Colour, label: str, cells: NDArray[np.bool_]) -> KeyEntry:
    count = int(np.count_nonzero(cells))
    return KeyEntry(symbol, colour, f"{label} ({count:,} cell{'s' * (count != 1)})")


def visits_of(lattice: CoverageLattice, cells: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return the number of visits of a walk to each cell, int64, shape of the lattice."""
    visits = np.zeros(lattice.states.shape, np.int64)
    window = lattice.window
    np.add.at(visits, (cells[:, 0] - window.row0, cells[:, 1] - window.col0), 1)
    return visits


def paint_rooms(plot: Plot, rooms: FoundRooms) -> None:
    """Paint rooms onto a map."""
    reach = round(NEAR_M / rooms.geometry.resolution)
    colours = _colours(rooms.labels, rooms.count, reach)
    for number in range(1, rooms.count + 1):
        mask = rooms.labels == number
        plot.paint(MapLayer(rooms.geometry, mask), colours[number - 1])


def number_rooms(plot: Plot, rooms: FoundRooms) -> None:
    """Write each room's number where it is widest."""
    for number in range(1, rooms.count + 1):
        clear = clearances(rooms.labels != number, 100)
        row, col = np.unravel_index(int(clear.argmax()), clear.shape)
        place = rooms.geometry.to_map(float(col) + 0.5, float(row) + 0.5)
        plot.text(str(number), place)


def _colours(labels: NDArray[np.int32], count: int, reach: int) -> list[palette.Colour]:
    """Return a colour for each room; neighbours differ if there are enough colours."""
    near: list[set[int]] = [set() for _ in range(count + 1)]
    for axis in (0, 1):
        for by in range(1, reach + 1):
            one = labels[by:] if axis == 0 else labels[:, by:]
            other = labels[:-by] if axis == 0 else labels[:, :-by]
            touch = (one != other) & (one > 0) & (other > 0)
            for a, b in set(zip(one[touch].tolist(), other[touch].tolist(), strict=True)):
                near[a].add(b)
                near[b].add(a)
    chosen = [-1] * (count + 1)
    for number in range(1, count + 1):
        taken = [chosen[other] for other in near[number]]
        used = [chosen.count(colour) for colour in range(len(palette.ROBOTS))]
        chosen[number] = min(
            range(len(palette.ROBOTS)), key=lambda colour: (taken.count(colour), used[colour])
        )
    return [palette.tint(palette.robot(colour)[1], TINT) for colour in chosen[1:]]
