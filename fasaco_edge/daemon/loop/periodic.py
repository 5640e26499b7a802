"""Periodic messages: what changes as the robot drives, each published when it is due."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.queries import QueryReply
from fasaco_edge.daemon.loop.mission_reports import room_progress, unswept
from fasaco_edge.daemon.loop.outbox import Outbox
from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.grid.occupancy import OccupancyGrid, coarser
from fasaco_edge.grid.rotation import rotated_geometry
from fasaco_edge.mission.orders.passes import passes_document
from fasaco_edge.mission.rooms.room_book import Room, RoomBook
from fasaco_edge.mission.rooms.room_raster import RoomRaster
from fasaco_edge.planners.living_trail import TrailSnapshot, branching, directions, strongest_into
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.path_documents import TrailAttachment
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms
from fasaco_edge.wire.messages.maps import coverage_values, direction_values, encode_occupancy_grid
from fasaco_edge.wire.messages.pheromone import encode_pheromone
from fasaco_edge.wire.topics import COVERAGE, DIRECTIONS, FLOOR, PHEROMONE, ROOMS, UNSWEPT

if TYPE_CHECKING:
    from fasaco_edge.daemon.fleet_wing import PeriodicMessage
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.work.progress import RoomProgress

# Least period of the coverage [s].
COVERAGE_PERIOD_S = 0.5
# Least period of the swept floor [s], and limit on its squares; a large floor gets larger squares.
FLOOR_PERIOD_S = 2.0
MOST_SQUARES = 1_000_000
# Largest rate of the unswept floor [pixels/s]: 8 million pixels take the loop 25 ms, and are sent
# every 8 s.
PIXELS_PER_S = 1_000_000
# Period at which an unchanged message is repeated [s], as a publisher does not notice further
# listeners.
REPEAT_S = 10.0
# Least period of the trail [s], and cells per second of a large trail, which takes the loop some
# milliseconds per 100,000 cells.
TRAIL_PERIOD_S = 0.5
CELLS_PER_S = 200_000
# Least period of changed rooms, and of swept shares alone while the robot drives [s].
ROOMS_PERIOD_S, SWEPT_PERIOD_S = 1.0, 5.0


class Due:
    """Decides when a message is due: on change of a key or as a repetition, with a least period.

    Attributes:
        next_at: earliest time of the next message [s, monotonic].
    """

    def __init__(self) -> None:
        self.next_at = self._at = float("-inf")
        self._key: tuple[object, ...] = ()

    def is_due(self, key: tuple[object, ...], now: float, *, repeats: bool) -> bool:
        """Return whether the message is due now; ``repeats``: also as a repetition."""
        is_new = key != self._key or (repeats and now - self._at >= REPEAT_S)
        return is_new and now >= self.next_at

    def note(self, key: tuple[object, ...], now: float, period_s: float) -> None:
        """Note a publication at ``now``; the next is due ``period_s`` [s] later at the earliest."""
        self._key, self._at, self.next_at = key, now, now + period_s

    def forget(self) -> None:
        """Publish the next message even if the key has not changed."""
        self._key = ()


class CoveragePublisher:
    """Publishes the coverage grid on change, at most twice a second."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox, self._due = outbox, Due()

    def publish(self, mission: Mission, now: float) -> None:
        # An order may reset the coverage, and add keep-out cells.
        key = (mission.covered.version, mission.map.map_revision, mission.order_state)
        lattice, grid = mission.lattice, mission.grid
        if lattice is None or grid is None or not self._due.is_due(key, now, repeats=False):
            return
        self._due.note(key, now, COVERAGE_PERIOD_S)
        geometry = mission.rotation.cells(lattice.window, lattice.cell_m)
        values = coverage_values(lattice.states, mission.covered.visits(lattice.window))
        shown = OccupancyGrid(geometry, values, grid.frame, grid.stamp_ns)
        self._outbox.send(COVERAGE, encode_occupancy_grid(shown))


class FloorPublisher:
    """Publishes the swept floor if it has subscribers: on change, at most every two seconds."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox, self._due = outbox, Due()

    def publish(self, mission: Mission, now: float) -> None:
        if not self._outbox.has_listeners(FLOOR):
            self._due.forget()  # the next listener has not received it
            return
        floor, grid = mission.covered.floor, mission.grid
        key = (floor, floor.changes)
        if grid is None or not self._due.is_due(key, now, repeats=True):
            return
        self._due.note(key, now, FLOOR_PERIOD_S)
        shown = floor.snapshot().as_grid(MOST_SQUARES, grid.frame, grid.stamp_ns)
        if shown is not None:
            shown = replace(shown, geometry=mission.rotation.geometry(shown.geometry))
            self._outbox.put(FLOOR, encode_occupancy_grid(shown))


class UnsweptPublisher:
    """Publishes why floor is unswept, on each change, while there are subscribers."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox, self._due = outbox, Due()

    def publish(self, mission: Mission, now: float) -> None:
        if not self._outbox.has_listeners(UNSWEPT):
            self._due.forget()  # the next listener has not received it
            return
        if now < self._due.next_at:
            return
        key = (mission.map.map_revision, mission.line.left.areas)
        if self._due.is_due(key, now, repeats=True) and (shown := unswept(mission)) is not None:
            self._due.note(key, now, max(FLOOR_PERIOD_S, shown.cells.size / PIXELS_PER_S))
            self._outbox.put(UNSWEPT, encode_occupancy_grid(coarser(shown, MOST_SQUARES)))


class TrailPublisher:
    """Publishes the living trail and its directions on change, at most twice a second.

    It is published while it has subscribers, and kept for queries.
    """

    def __init__(self, outbox: Outbox) -> None:
        self._outbox, self._due = outbox, Due()

    def publish(self, mission: Mission, now: float) -> None:
        is_wanted = any(map(self._outbox.has_listeners, (PHEROMONE, DIRECTIONS)))
        trail, lattice, grid = mission.trail, mission.lattice, mission.grid
        key = (trail, trail.changes, is_wanted)
        if grid is None or lattice is None or not self._due.is_due(key, now, repeats=is_wanted):
            return
        held = trail.snapshot()
        cells = held.window.rows * held.window.cols
        if not cells:
            return
        self._due.note(key, now, max(TRAIL_PERIOD_S, cells / CELLS_PER_S))
        shown = ShownTrail(
            held,
            trail.ants,
            lattice.cell_m,
            grid.frame,
            mission.route.revision,
            max(len(mission.route.path.ahead) - 1, 0),
            time.time_ns(),
            mission.rotation.deg,
        )
        self._outbox.keep(PHEROMONE.name, shown.reply)
        if is_wanted:
            self._outbox.put(PHEROMONE, *shown.field())
            self._outbox.put(DIRECTIONS, shown.directions())


@dataclass(frozen=True, slots=True, eq=False)
class ShownTrail:
    """The living trail at a moment; encoded on any thread.

    Attributes:
        held: the trail.
        ants: number of ants that have walked on it so far.
        cell_m: edge of a cell [m].
        frame: frame of the map.
        revision: revision of the path in force.
        steps: number of steps of the path still to drive.
        stamp_ns: time of the trail [ns].
        lattice_deg: angle of the cells to the map frame [deg].
    """

    held: TrailSnapshot
    ants: int
    cell_m: float
    frame: str
    revision: int
    steps: int
    stamp_ns: int
    lattice_deg: float = 0.0

    def field(self) -> tuple[bytes, bytes]:
        """Return the field as payload and attachment."""
        tau = self.held.tau
        field = strongest_into(tau)
        about = TrailAttachment(
            revision=self.revision,
            cells=int(np.count_nonzero(field)),
            branching=round(branching(tau), 4),
        )
        seen = ColonySnapshot(self.held.window, self.cell_m, field, 0, 0, self.ants, self.steps)
        payload = encode_pheromone(seen, self.frame, self.stamp_ns, self.lattice_deg)
        return payload, encode_json(about)

    def reply(self) -> QueryReply:
        """Return the field as the reply to a query."""
        payload, attachment = self.field()
        return QueryReply(payload, PHEROMONE.schema, attachment)

    def directions(self) -> bytes:
        """Return its directions as a payload."""
        plain = GridGeometry.of_cells(self.held.window, self.cell_m)
        geometry = rotated_geometry(plain, self.lattice_deg)
        values = direction_values(*directions(self.held.tau))
        return encode_occupancy_grid(OccupancyGrid(geometry, values, self.frame, self.stamp_ns))


OF_MISSION: dict[str, Callable[[Outbox], PeriodicMessage]] = {
    "coverage": CoveragePublisher,
    "floor": FloorPublisher,
    "unswept": UnsweptPublisher,
    "pheromone": TrailPublisher,
}
"""The publishers of a mission's messages, by their names in log lines about failures."""


# Limit on the squares of floor that are counted: it bounds the time that counting takes.
MOST_ROOM_SQUARES = 250_000


class RoomShares:
    """Counts the squares of floor by room; the rooms of all squares are cached."""

    def __init__(self) -> None:
        self._read_of: tuple[RoomRaster, GridGeometry] | None = None
        self._rooms = np.zeros((0, 0), np.uint16)

    def of(self, mission: Mission) -> dict[int, float]:
        """Return the swept share of the floor in reach in each room, by the room's number.

        The share is of the whole room, whatever the order asks for there. Rooms without such floor
        are left out; so are all rooms if only cells are counted, and in a fleet, as the floor that
        others sweep is unknown.
        """
        sheet, floor = mission.rooms.sheet, mission.line.floor_in_reach(MOST_ROOM_SQUARES)
        if sheet is None or floor is None or mission.company.has_members:
            return {}
        squares, within, swept = floor
        rooms = self._on(sheet.raster, mission.rotation.geometry(squares))
        count = np.bincount(rooms[within]).tolist()
        done = np.bincount(rooms[swept], minlength=len(count)).tolist()
        return {room: done[room] / count[room] for room in range(1, len(count)) if count[room]}

    def _on(self, raster: RoomRaster, squares: GridGeometry) -> NDArray[np.uint16]:
        """Return the room of each square, uint16 (rows, cols), 0 for none."""
        known = self._read_of
        if known is None or known[0] is not raster or known[1] != squares:
            rows, cols = np.mgrid[0.5 : squares.rows, 0.5 : squares.cols]
            x, y = squares.to_map(cols.ravel(), rows.ravel())
            self._read_of = raster, squares
            self._rooms = raster.at(np.column_stack((x, y))).reshape(squares.rows, squares.cols)
        return self._rooms


class RoomsPublisher:
    """Publishes the rooms of a book on change, and as they are swept; also without a mission."""

    def __init__(self, outbox: Outbox, book: RoomBook) -> None:
        self._outbox, self._book = outbox, book
        self._published_at = float("-inf")
        self._version = -1
        self._progress: object = None
        self._order: object = None
        self._shares = RoomShares()

    def publish(self, mission: Mission | None, now: float) -> None:
        book, progress_id = self._book, None if mission is None else _progress_of(mission)
        # Another order may have forgotten the coverage of the previous order.
        order = None if mission is None else mission.order_state.order
        is_new = book.version != self._version or order is not self._order
        if not is_new and (progress_id == self._progress or not book.rooms):
            return
        # At the end of an order shares are published sooner, as listeners may leave then.
        is_over = mission is not None and mission.state.is_at_rest
        if now - self._published_at < (ROOMS_PERIOD_S if is_new or is_over else SWEPT_PERIOD_S):
            return
        self._published_at, self._version, self._progress = now, book.version, progress_id
        self._order = order
        progress = {} if mission is None else room_progress(mission)
        shares = {} if mission is None else self._shares.of(mission)
        rooms = tuple(
            _report(room, progress.get(room.id), shares.get(room.id)) for room in book.rooms
        )
        self._outbox.send(ROOMS, encode_json(Rooms(book.frame, book.version, rooms)))


def _progress_of(mission: Mission) -> tuple[object, int, int, bool]:
    """Return a key that changes with shares and times to go."""
    route = mission.route
    floor = mission.covered.floor.changes
    return mission.covered.version, floor, route.revision, len(route.path.ahead) > 1


def _report(room: Room, progress: RoomProgress | None, share: float | None) -> RoomReport:
    """Return the report of a room; ``share``: swept share of its floor, None if unknown."""
    settings = room.settings
    if share is None and progress is not None:
        share = progress.share
    passes = None if settings.passes is None else passes_document(settings.passes, settings.kinds)
    return RoomReport(
        id=room.id,
        name=room.name,
        outline=room.outline,
        area_m2=room.area_m2,
        neighbours=room.neighbours,
        encloses=room.encloses,
        swept=None if share is None else round(share, 4),
        to_go_s=None if progress is None else progress.to_go_s,
        passes=tuple(passes) if isinstance(passes, list) else passes,  # type: ignore[arg-type]
        skip=settings.skip,
        priority=settings.priority,
    )
