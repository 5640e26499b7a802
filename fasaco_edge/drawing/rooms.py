"""Pictures of rooms: each with its number, in a colour that differs from its neighbours'."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.plot import MapLayer, Plot, View
from fasaco_edge.drawing.sheet import Sheet
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rooms import FoundRooms
from fasaco_edge.kernels.rooms.clearance import clearances

# Share of the colour on white, low so that drawings on a room are visible.
TINT = 0.38
# Distance up to which rooms are neighbours, the depth of a door [m].
NEAR_M = 0.2
# Edge of a cell, for the margin around the map [m].
CELL_M = 0.3


def draw_rooms(grid: OccupancyGrid, rooms: FoundRooms, title: str = "Rooms") -> Image.Image:
    """Return a picture, RGB, of a map with its rooms."""
    plot = Plot(
        View.over(rooms.geometry.bounds() if rooms.count else grid.geometry.bounds(), CELL_M)
    )
    plot.ground(grid)
    paint_rooms(plot, rooms)
    number_rooms(plot, rooms)
    area_m2 = np.count_nonzero(rooms.labels) * rooms.geometry.resolution**2
    lines = [f"{rooms.count} rooms, {area_m2:,.1f} m2 in all"]
    return Sheet(title, lines, (), None, plot.view.scale).around(plot.finished())


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
