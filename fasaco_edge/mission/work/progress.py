"""Progress of zones and rooms."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Polygon, Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.grid.rotation import rotated_polygon
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.orders.zones import counts_in
from fasaco_edge.mission.rooms.room_book import RoomBook
from fasaco_edge.mission.work.order_state import OrderState, Stage


@dataclass(frozen=True, slots=True)
class ZoneProgress:
    """Progress of a zone.

    Attributes:
        name: name of the zone.
        passes: number of passes ordered.
        newest_pass: number of the newest pass; 0 before the first.
        cells: number of its reachable cells.
        covered: number of these cells that are covered in that pass.
    """

    name: str
    passes: int
    newest_pass: int
    cells: int
    covered: int


def zone_progress(
    order_state: OrderState, ground: ReachableArea | None, ledger: MissionLedger
) -> list[ZoneProgress]:
    """Return the progress of each zone, in sequence; empty for an order for everything."""
    order = order_state.order
    if order is None:
        return []
    polygons = tuple(zone.polygon for zone in order.zones if zone.polygon)
    cells = covered = [0] * len(polygons)
    if ground is not None and polygons:
        lattice, reachable = ground.lattice, ground.reachable
        visited = reachable & (ledger.visits(lattice.window) > 0)
        holes = [zone.holes for zone in order.zones if zone.polygon]
        cells = _counts(polygons, holes, lattice, reachable)
        covered = _counts(polygons, holes, lattice, visited)
    found = []
    # Either all zones have polygons, or the only zone is everything.
    for index, counted in enumerate(zip(cells, covered, strict=True)):
        zone = order.zones[index]
        if order_state.stage is not Stage.COVERING or index < order_state.zone:
            begun = zone.passes
        elif index > order_state.zone:
            begun = 0
        else:
            begun = order_state.pass_number if order_state.begun else order_state.pass_number - 1
        reached, done = counted
        found.append(ZoneProgress(zone.name, zone.passes, begun, reached, done if begun else 0))
    return found


def _counts(
    polygons: tuple[Polygon, ...],
    holes: Sequence[tuple[Polygon, ...]],
    lattice: CoverageLattice,
    cells: NDArray[np.bool_],
) -> list[int]:
    """Return how many cells lie in each polygon, and in none of its holes."""
    flat = tuple(hole for each in holes for hole in each)
    counts = counts_in((*polygons, *flat), lattice.window, lattice.cell_m, cells)
    if not flat:
        return counts
    in_holes = iter(counts[len(polygons) :])
    return [
        count - sum(next(in_holes) for _ in each)
        for count, each in zip(counts, holes, strict=False)
    ]


@dataclass(frozen=True, slots=True)
class RoomProgress:
    """Progress in a room.

    Attributes:
        cells: number of its reachable cells.
        covered: number of these that are covered.
        to_go_s: time of the path ahead within the room [s]; None without a path.
    """

    cells: int
    covered: int
    to_go_s: float | None

    @property
    def share(self) -> float | None:
        """The covered share; None if no cell is reachable."""
        return round(self.covered / self.cells, 4) if self.cells else None


def room_progress(
    book: RoomBook,
    lattice_deg: float,
    ground: ReachableArea | None,
    ledger: MissionLedger,
    to_go_s: dict[int, float],
) -> dict[int, RoomProgress]:
    """Return the progress in each room, by its number.

    Args:
        book: the rooms, in the map frame.
        lattice_deg: angle of the cells' rows to the map's x axis [deg].
        ground: the reachable area.
        ledger: the covered cells.
        to_go_s: time of the path ahead within each room that it crosses [s]; empty without a path.
    """
    placed = [room for room in book.rooms if room.outline]
    if ground is None or not placed:
        return {}

    def on_lattice(polygons: Iterable[Polygon]) -> tuple[Polygon, ...]:
        return tuple(
            rotated_polygon(each, -lattice_deg) if lattice_deg else each for each in polygons
        )

    outlines = on_lattice(room.outline for room in placed)
    holes = [on_lattice(book.holes(room)) for room in placed]
    lattice, reachable = ground.lattice, ground.reachable
    visited = reachable & (ledger.visits(lattice.window) > 0)
    cells, covered = (_counts(outlines, holes, lattice, each) for each in (reachable, visited))
    return {
        room.id: RoomProgress(own, done, to_go_s.get(room.id, 0.0) if to_go_s else None)
        for room, own, done in zip(placed, cells, covered, strict=True)
    }


def seconds_in(
    rooms: NDArray[np.uint16], window: Window, ahead: NDArray[np.int32], ahead_s: float
) -> dict[int, float]:
    """Return the time that a path takes in each room that it crosses [s].

    Args:
        rooms: uint16 (rows, cols), the room of each cell of ``window``, 0 for none.
        window: these cells.
        ahead: int32 (n, 2), the cells of the path.
        ahead_s: time of the whole path [s]; its cells share it evenly.
    """
    if len(ahead) < 2:
        return {}
    steps = np.bincount(window.values_at(rooms, ahead[1:], 0))
    seconds = np.round(steps * (ahead_s / (len(ahead) - 1)), 1).tolist()
    return {room: seconds[room] for room in np.flatnonzero(steps).tolist()}
