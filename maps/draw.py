"""Draws the maps in this folder: ``python maps/draw.py [folder]``."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from floor import RESOLUTION, Floor, Point
from map_writer import write_map


def office() -> Floor:
    """One room of 6.5 x 7.6 m, the door in the south."""
    floor = Floor(-3.6, -3.6, 4.1, 5.4)
    floor.room(-3.0, -2.8, 3.5, 4.8)
    floor.room(-2.3, -3.1, -1.4, -2.8)
    floor.walls()
    for x, y, drawers in ((-2.2, 2.9, 1), (-0.6, 2.9, -1), (1.2, 0.6, 1), (2.6, 0.6, -1)):
        floor.legs(x, y, 1.4, 0.8)
        floor.block(x + drawers * 0.45, y + 0.05, 0.4, 0.55)
    floor.block(-1.4, 3.35, 3.0, 0.05)
    for x, y, turn in ((-2.35, 2.15, 12), (-0.5, 2.2, -20), (1.0, 1.35, 35), (2.75, -0.2, 8)):
        _office_chair(floor, x, y, turn)
    floor.block(-1.0, 4.6, 2.4, 0.4)
    floor.block(1.2, 4.6, 1.6, 0.4)
    floor.block(3.275, 3.2, 0.45, 2.0)
    floor.block(-2.8, -0.5, 0.4, 1.6)
    floor.block(3.2, -2.5, 0.6, 0.6)
    floor.round(0.6, -1.6, 0.15)
    for degrees in (20, 110, 200, 290):
        angle = math.radians(degrees)
        floor.legs(0.6 + 0.8 * math.cos(angle), -1.6 + 0.8 * math.sin(angle), 0.4, 0.4, degrees)
    floor.round(-2.75, 4.55, 0.2)
    floor.round(3.2, -1.5, 0.2)
    return floor


def _office_chair(floor: Floor, x: float, y: float, turn: float) -> None:
    floor.block(x, y, 0.1, 0.1)
    for castor in range(5):
        angle = math.radians(turn + 72 * castor)
        floor.block(x + 0.28 * math.cos(angle), y + 0.28 * math.sin(angle), 0.06, 0.06)


def flat() -> Floor:
    """Living room, kitchen, bath, bedroom, study and hall; doors of 0.85 m."""
    floor = Floor(-2.6, -3.8, 7.6, 5.6)
    hall, bath, bedroom = (1.4, -3.0, 2.6, 5.0), (-2.0, -3.0, 1.25, -0.8), (-2.0, -0.65, 1.25, 2.9)
    study, living, kitchen = (-2.0, 3.05, 1.25, 5.0), (2.75, -3.0, 7.0, 2.15), (2.75, 2.3, 7.0, 5.0)
    for room in (hall, bath, bedroom, study, living, kitchen):
        floor.room(*room)
    for y, x in ((-2.0, 1.25), (0.2, 1.25), (3.5, 1.25), (-0.6, 2.6), (2.9, 2.6)):
        floor.room(x, y, x + 0.15, y + 0.85)
    floor.room(4.2, 2.15, 5.4, 2.3)
    floor.room(1.6, -3.2, 2.45, -3.0)
    floor.walls()
    _furnish_living_room(floor)
    # Kitchen: worktop, fridge, table, stools.
    floor.block(4.55, 4.7, 3.6, 0.6)
    floor.block(6.65, 4.65, 0.65, 0.65)
    floor.legs(6.3, 3.1, 0.9, 0.7)
    for x, y, turn in ((5.65, 3.2, 10), (6.3, 3.75, 25)):
        floor.legs(x, y, 0.35, 0.35, turn)
    # Bedroom: bed, bedside tables, wardrobe.
    floor.block(-0.95, 0.8, 2.1, 1.5)
    floor.block(-1.8, -0.2, 0.4, 0.4)
    floor.block(-1.8, 1.8, 0.4, 0.4)
    floor.block(-0.3, 2.6, 1.9, 0.6)
    # Bath: tub, toilet, basin, washing machine.
    floor.block(-1.15, -2.62, 1.7, 0.75)
    floor.block(-1.7, -1.5, 0.6, 0.4)
    floor.block(-0.4, -1.0, 0.6, 0.4)
    floor.block(0.9, -2.7, 0.6, 0.6)
    # Study and hall.
    floor.legs(-1.3, 4.55, 1.4, 0.7)
    _office_chair(floor, -1.2, 3.95, 30)
    floor.block(0.6, 4.8, 1.2, 0.35)
    floor.block(2.0, 4.75, 1.2, 0.5)
    floor.block(2.5, -2.2, 0.2, 1.0)
    return floor


def _furnish_living_room(floor: Floor) -> None:
    floor.block(6.5, -1.4, 0.9, 2.1)
    floor.legs(5.2, -1.3, 0.6, 1.1)
    floor.block(2.95, -1.8, 0.4, 1.6)
    floor.block(4.7, -2.5, 0.8, 0.8, 25)
    floor.legs(5.1, 0.9, 1.6, 0.9)
    for x, y, turn in ((4.7, 1.6, 5), (5.5, 1.55, -8), (4.7, 0.25, 0), (5.6, 0.2, 20)):
        floor.legs(x, y, 0.42, 0.42, turn)
    floor.block(6.85, 1.1, 0.3, 1.4)
    floor.round(3.15, 1.7, 0.2)


def walled_grid() -> Floor:
    """A square of 15 x 15 m with wall pieces in a regular order."""
    floor = Floor(-8.0, -8.0, 8.0, 8.0)
    floor.room(-7.5, -7.5, 7.5, 7.5)
    floor.walls()
    places = (-4.5, -1.5, 1.5, 4.5)
    for i, x in enumerate(places):
        for j, y in enumerate(places):
            lies = (i + j) % 2 == 0
            floor.block(x, y, *((1.8, 0.15) if lies else (0.15, 1.8)))
    for along in (-3.0, 0.0, 3.0):
        floor.block(along, 6.9, 0.15, 1.2)
        floor.block(along, -6.9, 0.15, 1.2)
        floor.block(6.9, along, 1.2, 0.15)
        floor.block(-6.9, along, 1.2, 0.15)
    return floor


COMPARTMENTS = ((-10.8, -8.4), (-8.2, -5.9), (-5.7, -3.4), (-3.2, -0.6), (-0.4, 3.2), (3.4, 6.4))


def basement() -> Floor:
    """Rooms with slanted walls, joined by passages of 0.8 to 1.0 m; 28 x 18.5 m."""
    floor = Floor(-11.4, -7.4, 17.4, 11.9)
    boiler_room = ((-10.8, -6.8), (-4.6, -6.8), (-4.6, -2.2), (-6.2, -1.4), (-10.8, -1.4))
    store = ((-10.8, 0.2), (-7.0, 0.2), (-6.4, 1.2), (-6.4, 5.0), (-10.8, 5.4))
    hall = ((-5.2, -0.6), (-3.4, -1.2), (4.8, -1.2), (5.6, 0.4), (5.6, 5.6), (-5.2, 6.0))
    bicycles = ((-1.2, -6.8), (5.4, -6.8), (5.4, -2.6), (-1.2, -3.0))
    laundry = ((6.8, -6.8), (12.4, -6.8), (12.4, -1.6), (10.8, -0.4), (6.8, -0.4))
    stairs = ((13.4, -6.8), (16.8, -6.8), (16.8, -0.4), (13.4, -0.4))
    workshop = ((7.0, 1.0), (16.8, 1.0), (16.8, 8.2), (14.0, 11.3), (7.6, 11.3), (7.0, 9.4))
    for room in (boiler_room, store, hall, bicycles, laundry, stairs, workshop):
        floor.hall(*room)
    for left, right in COMPARTMENTS:
        floor.room(left, 8.0, right, 11.2)
        floor.room(left + 0.6, 7.8, left + 1.4, 8.0)
    passages = (
        (-10.8, 6.9, 7.0, 7.8), (-9.9, 5.2, -9.0, 6.9), (0.4, 5.6, 1.3, 6.9),
        (-6.4, 2.4, -5.2, 3.3), (-4.6, -3.4, -2.0, -2.5), (-2.9, -3.4, -2.0, -1.2),
        (1.8, -2.9, 2.7, -1.2), (5.4, -5.2, 6.8, -4.4), (5.6, 2.2, 7.0, 3.2),
        (8.2, -0.4, 9.1, 1.0), (12.4, -3.8, 13.4, -2.9), (14.6, -0.4, 15.5, 1.0),
    )  # fmt: skip
    for passage in passages:
        floor.room(*passage)
    floor.walls()
    _furnish_basement(floor)
    return floor


def _furnish_basement(floor: Floor) -> None:
    # Boiler room: boilers, tank, pump, flue.
    floor.round(-9.6, -5.4, 0.6)
    floor.round(-8.0, -5.4, 0.6)
    floor.block(-5.6, -5.6, 1.4, 1.8)
    floor.block(-10.5, -2.6, 0.4, 1.6)
    floor.round(-7.2, -2.6, 0.25)
    # Store: shelves on both long walls.
    floor.block(-10.5, 3.0, 0.5, 3.4)
    floor.block(-8.6, 2.6, 0.6, 2.8)
    # Hall: columns, crates, a ping-pong table.
    for x in (-3.0, 0.2, 3.4):
        for y in (0.8, 3.9):
            floor.block(x, y, 0.4, 0.4)
    floor.legs(1.8, 2.4, 2.7, 1.5, 12)
    for x, y, turn in ((-4.5, 5.2, 0), (-3.7, 5.3, 20), (-4.4, 0.2, -15), (4.9, 4.9, 30)):
        floor.block(x, y, 0.6, 0.4, turn)
    # Bicycles lean in a row.
    for number in range(8):
        floor.block(-0.6 + 0.55 * number, -6.1, 0.05, 1.1, 14)
    floor.block(4.9, -3.4, 0.6, 1.0)
    # Laundry: machines, ironing table, drain.
    for number in range(5):
        floor.block(7.3 + 0.75 * number, -6.45, 0.6, 0.6)
    floor.legs(9.6, -3.2, 1.6, 0.8, 5)
    floor.block(7.1, -1.8, 0.5, 1.2)
    # Stairwell: flight of stairs, lift shaft.
    floor.block(16.2, -4.9, 1.2, 3.6)
    floor.block(14.2, -6.1, 1.5, 1.4)
    # Compartments: what people keep.
    for x, y, width, depth, turn in (
        (-10.3, 10.8, 0.8, 0.7, 0), (-8.9, 10.6, 0.6, 0.9, 10), (-6.5, 10.9, 1.1, 0.5, 0),
        (-7.7, 9.9, 0.5, 0.8, -12), (-4.0, 10.6, 1.0, 1.0, 8), (-2.6, 10.9, 1.0, 0.5, 0),
        (-1.0, 9.5, 0.6, 1.6, 0), (2.6, 10.6, 0.8, 1.0, 0), (0.3, 10.9, 1.2, 0.5, 0),
        (5.9, 10.2, 0.8, 1.8, 0), (4.2, 10.8, 0.9, 0.6, -6),
    ):  # fmt: skip
        floor.block(x, y, width, depth, turn)
    # Workshop: benches, machines, a car on its wheels, timber.
    floor.block(11.0, 10.9, 4.4, 0.7)
    floor.legs(8.4, 5.2, 0.9, 2.4)
    floor.block(9.9, 7.6, 1.1, 0.8, -10)
    floor.block(16.4, 4.6, 0.6, 4.0)
    for x, y in ((11.6, 2.8), (14.2, 2.8), (11.6, 4.4), (14.2, 4.4)):
        floor.block(x, y, 0.6, 0.2)
    floor.block(13.4, 7.6, 2.6, 0.3, -38)
    floor.round(12.0, 9.2, 0.3)


def warehouse() -> Floor:
    """Pallet racks, docks, staging area, packing line and offices; 52 x 32 m."""
    floor = Floor(-8.6, -7.4, 44.6, 26.6)
    floor.room(-8.0, -6.0, 34.85, 26.0)
    floor.room(34.85, -6.0, 44.0, 12.0)
    for dock in range(6):
        floor.room(-5.0 + 6.5 * dock, -6.6, -2.0 + 6.5 * dock, -6.0)
    for room in ((35.0, 12.15, 39.4, 18.0), (39.55, 12.15, 44.0, 18.0), (35.0, 19.75, 38.0, 26.0),
                 (38.15, 19.75, 44.0, 26.0), (35.0, 18.15, 44.0, 19.6)):  # fmt: skip
        floor.room(*room)
    for door in ((34.85, 18.35, 35.0, 19.4), (36.2, 18.0, 37.15, 18.15), (41.0, 18.0, 41.95, 18.15),
                 (36.0, 19.6, 36.95, 19.75), (40.4, 19.6, 41.35, 19.75)):  # fmt: skip
        floor.room(*door)
    floor.walls()
    for aisle in range(6):
        _pallet_rack(floor, 7.0 + 3.3 * aisle, aisle)
    _furnish_warehouse(floor)
    return floor


def _pallet_rack(floor: Floor, y: float, number: int) -> None:
    """Nine bays of 2.7 m, 1.1 m deep; pallets stand in some, the others are open below."""
    for upright in range(10):
        for side in (-0.5, 0.5):
            floor.block(-4.0 + 2.7 * upright, y + side, 0.1, 0.1)
    for bay in range(9):
        for place in range(2):
            if (5 * bay + 3 * place + 7 * number) % 4 < 3:
                x = -4.0 + 2.7 * bay + 0.7 + 1.3 * place
                floor.block(x, y, 0.8, 1.1, (bay * number + place) % 3 * 2 - 2)


def _furnish_warehouse(floor: Floor) -> None:
    for x in (-6.4, 5.8, 18.0, 25.4):
        for y in (-2.0, 4.6, 25.2):
            floor.block(x, y, 0.5, 0.5)
    # Staging area: stacks of pallets before the docks.
    for dock in range(6):
        for row in range(2 + dock % 2):
            x = -4.2 + 6.5 * dock + 0.2 * (row % 2)
            floor.block(x, -4.2 + 1.7 * row, 0.8, 1.2, 3 * (row - 1))
            floor.block(x + 1.5, -4.1 + 1.7 * row, 0.8, 1.2, 2 - 3 * row)
    # Packing line: a roller conveyor on legs, tables, cartons.
    for leg in range(9):
        floor.legs(27.2, 6.6 + 2.0 * leg, 0.7, 0.1)
    for table in range(5):
        floor.legs(30.6, 8.0 + 3.4 * table, 0.9, 2.0)
        floor.block(32.0, 8.3 + 3.4 * table, 0.6, 0.5, 15 * table)
    # Charging stations and lift trucks.
    for truck in range(4):
        floor.block(43.6, -4.0 + 2.6 * truck, 0.6, 0.8)
        floor.block(41.6, -4.0 + 2.6 * truck, 2.0, 1.0, 4 * truck - 6)
    floor.block(37.0, 9.0, 2.2, 2.2)
    floor.block(37.0, 4.6, 1.2, 2.4, 20)
    # Offices: desks, lockers, kitchen.
    for x, y in (
        (36.0, 16.6), (38.2, 16.6), (36.0, 14.2), (38.2, 14.2), (41.0, 14.2), (42.8, 14.2),
    ):  # fmt: skip
        floor.legs(x, y, 1.4, 0.8)
        _office_chair(floor, x, y - 0.7, 11 * x)
    floor.block(37.0, 25.7, 3.6, 0.5)
    floor.block(35.2, 23.0, 0.4, 3.0)
    floor.block(41.0, 25.65, 5.4, 0.6)
    floor.legs(41.2, 22.6, 3.0, 1.2)
    for seat in range(3):
        floor.legs(40.2 + seat, 21.6, 0.42, 0.42, 9 * seat)
        floor.legs(40.2 + seat, 23.6, 0.42, 0.42, -7 * seat)


@dataclass(frozen=True, slots=True)
class Drawing:
    """A map and its entry in the index."""

    draw: Callable[[], Floor]
    why: str
    start: Point


DRAWINGS = {
    "office": Drawing(
        office, "one cluttered room: planned in a moment, every detour can be seen", (-1.85, -2.2)
    ),
    "flat": Drawing(
        flat, "a home as vacuum robots know it: small rooms, doors of 0.85 m, chairs", (2.0, -2.4)
    ),
    "walled_grid": Drawing(
        walled_grid, "open floor, wall pieces in order, like the paper's simulated map", (0.0, 0.0)
    ),
    "basement": Drawing(
        basement, "irregular rooms; passages of 0.8 to 1.0 m have to be driven twice", (0.15, 0.15)
    ),
    "warehouse": Drawing(
        warehouse, "the largest: racks, docks and offices, for run time and memory", (0.0, 0.0)
    ),
}


def draw_all(folder: Path) -> None:
    """Write every map, its YAML and the index into ``folder``."""
    index = {}
    for name, drawing in DRAWINGS.items():
        grid = drawing.draw().grid()
        write_map(grid, folder / f"{name}.yaml")
        known = np.argwhere(grid.cells >= 0)
        height, width = ((known.max(axis=0) - known.min(axis=0) + 1) * RESOLUTION).round(2).tolist()
        index[name] = {
            "why": drawing.why,
            "size_m": [width, height],
            "start": list(drawing.start),
        }
    text = yaml.safe_dump(index, sort_keys=False, default_flow_style=None, width=120)
    (folder / "index.yaml").write_text(f"# Written by draw.py.\n{text}", encoding="utf-8")


if __name__ == "__main__":
    draw_all(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
