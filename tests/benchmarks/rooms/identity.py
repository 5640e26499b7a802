"""``benchmarks room-ids``: whether rooms keep their numbers and names while a map grows.

Each floor is mapped from place to place. Pixels beside walls flicker, each map is a little
displaced, and sometimes a loop closure, reported to the mission, moves it by decimetres.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import PCG64
from numpy.typing import NDArray

from fasaco_edge.bench.benchmark import Benchmark, MeasuredGoal, Report, Say
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, OccupancyGrid
from fasaco_edge.grid.rooms import ROOM_M2, find_rooms
from fasaco_edge.mission.coverage.loop_closure import Motion
from fasaco_edge.mission.rooms.room_book import RoomBook
from fasaco_edge.mission.rooms.room_edits import move
from fasaco_edge.mission.rooms.room_watch import update
from tests.benchmarks.harness import add_floors
from tests.benchmarks.rooms.homes import KINDS, RESOLUTION_M, Home, growing, home
from tests.support.poses import composed

# Number of maps from each place.
MAPS_EACH = 3
# Share of pixels beside walls that a map shows inverted; shift of a map [m].
FLICKER, ASIDE_M = 0.1, 0.03
# Share of maps with a loop closure before them, and its motion [m, degrees].
CLOSES, CLOSURE_M, CLOSURE_DEG = 0.05, 0.3, 2.0
GOAL_IDS = 1.2
HEADER = ("floor", "floors", "maps", "rooms", "numbers", "a room", "names moved", "names lost")


@dataclass(frozen=True, slots=True)
class Kept:
    """What became of the rooms of one floor.

    Attributes:
        kind: of the floor.
        maps: number of maps.
        rooms: true rooms that are large enough.
        ids: numbers that were given.
        moved: of the rooms that were named when they appeared, those whose name was of another true
            room on some later map.
        lost: those whose name was gone at the end.
    """

    kind: str
    maps: int
    rooms: int
    ids: int
    moved: int
    lost: int


def follow(floor: Home, number: int, *, is_named: bool) -> tuple[RoomBook, int, set[str]]:
    """Return the rooms after a mission, the number of its maps, and the names that moved."""
    rng, book, maps = np.random.Generator(PCG64((number, 2))), RoomBook(), 0
    frame, moved = Pose2D(0.0, 0.0), set[str]()
    for grid in growing(floor, number):
        for _ in range(MAPS_EACH):
            if maps and rng.random() < CLOSES:
                x, y = rng.uniform(-CLOSURE_M, CLOSURE_M, 2).tolist()
                closure = Pose2D(x, y, math.radians(rng.uniform(-CLOSURE_DEG, CLOSURE_DEG)))
                move(book, Motion(frame, after := composed(closure, frame)))
                frame = after
            maps += 1
            aside = Pose2D(*rng.uniform(-ASIDE_M, ASIDE_M, 2).tolist())
            placed = composed(aside, composed(frame, grid.geometry.origin))
            shown = OccupancyGrid(
                replace(grid.geometry, origin=placed), _flickered(grid.cells, rng)
            )
            update(book, find_rooms(shown), "map")
            if is_named:
                moved |= name_rooms(book, floor, placed)
    return book, maps, moved


def _flickered(cells: NDArray[np.int8], rng: np.random.Generator) -> NDArray[np.int8]:
    """Return a map on which some free pixels beside walls are walls, and some walls are free."""
    flickered, wall = cells.copy(), cells == OCCUPIED
    beside = np.zeros_like(wall)
    for axis, by in ((0, 1), (0, -1), (1, 1), (1, -1)):
        beside |= np.roll(wall, by, axis)
    drawn = rng.random(cells.shape) < FLICKER
    flickered[drawn & beside & (cells == FREE)] = OCCUPIED
    return flickered


def name_rooms(book: RoomBook, floor: Home, placed: Pose2D) -> set[str]:
    """Name rooms after the true ones that they lie in; return the names of those that do not."""
    wrong = set[str]()
    sheet = book.sheet
    if sheet is None:
        return wrong
    geometry = replace(floor.grid.geometry, origin=placed)
    for room in book.rooms:
        window, mask = sheet.raster.squares(room.id)
        rows, cols = np.nonzero(mask)
        x, y = (
            (at.astype(np.float64) + 0.5) * sheet.raster.square_m
            for at in (cols + window.col0, rows + window.row0)
        )
        true = geometry.values_at(floor.rooms, np.stack((x, y), axis=1))
        counts = np.bincount(true[true > 0])
        if not len(counts):
            continue
        name = f"true {int(counts.argmax())}"
        if room.name and room.name != name:
            wrong.add(room.name)
        elif not room.name and book.find(name) is None:
            book.name(room.id, name)
    return wrong


def _measure(args: argparse.Namespace, say: Say) -> Generator[Kept, None, None]:
    least = ROOM_M2 / RESOLUTION_M**2
    for kind in KINDS:
        for number in range(args.seed, args.seed + args.floors):
            floor = home(kind, number)
            say(floor.name)
            true = int((np.bincount(floor.rooms[floor.rooms > 0]) >= least).sum())
            book, maps, _ = follow(floor, number, is_named=False)
            named, _, moved = follow(floor, number, is_named=True)
            lost = _lost(named, floor)
            yield Kept(kind, maps, true, book.next_id - 1, len(moved), lost)


def _lost(book: RoomBook, floor: Home) -> int:
    """Return how many large true rooms no room is named after at the end."""
    sizes = np.bincount(floor.rooms[floor.rooms > 0])
    large = np.flatnonzero(sizes * RESOLUTION_M**2 >= ROOM_M2).tolist()
    return sum(book.find(f"true {room}") is None for room in large)


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_floors(parser, 10)


def _report(args: argparse.Namespace, samples: Sequence[Kept]) -> Report:
    groups = {kind: [one for one in samples if one.kind == kind] for kind in KINDS}
    figures = [
        {
            "kind": kind,
            "floors": len(kept),
            **{
                name: sum(getattr(one, name) for one in kept)
                for name in ("maps", "rooms", "ids", "moved", "lost")
            },
        }
        for kind, kept in groups.items()
    ]
    shares = [
        sum(one.ids for one in kept) / max(sum(one.rooms for one in kept), 1)
        for kept in groups.values()
    ]
    return Report(
        title="numbers and names that rooms kept",
        header=HEADER,
        rows=tuple(
            (
                str(each["kind"]),
                *(str(each[name]) for name in ("floors", "maps", "rooms", "ids")),
                f"{share:.2f}",
                str(each["moved"]),
                str(each["lost"]),
            )
            for each, share in zip(figures, shares, strict=True)
        ),
        figures={"rooms": figures},
        goals=(
            MeasuredGoal("numbers given for each true room", round(max(shares), 3), GOAL_IDS),
            MeasuredGoal("names that moved to another room", sum(one.moved for one in samples), 0),
        ),
        remarks=(
            "rooms: of at least 1.5 m2; names lost: true rooms without a room of their name at the "
            "end, because they were not found, or are part of another room",
        ),
    )


ROOM_IDS = Benchmark(
    name="room-ids",
    summary="whether rooms keep numbers and names while the map grows",
    description="Map generated homes and offices from place to place: pixels beside walls flicker, "
    "each map is displaced by up to 3 cm, and one map in twenty by a loop closure of up to 0.3 m "
    "and 2 degrees. Count the numbers that rooms get, and names that move to another room.",
    add_options=_add_options,
    count=lambda args: len(KINDS) * int(args.floors),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks room-ids
  python -m tests.benchmarks room-ids --seed 500 --floors 20 --json
""",
)
