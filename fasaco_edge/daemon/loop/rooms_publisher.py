"""The publisher of the rooms: on change, and as they are swept."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fasaco_edge.daemon.loop.outbox import Outbox
from fasaco_edge.mission.map.room_book import Room, RoomBook
from fasaco_edge.mission.orders.passes import passes_document
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.coverage.progress import RoomProgress

# Least period of changed rooms, and of swept shares alone while the robot drives [s].
PERIOD_S, SWEPT_PERIOD_S = 1.0, 5.0


class RoomsPublisher:
    """Publishes the rooms of a book."""

    def __init__(self, outbox: Outbox, book: RoomBook) -> None:
        self._outbox, self._book = outbox, book
        self._published_at = float("-inf")
        self._version = -1
        self._covered: object = None

    def forget(self) -> None:
        """Publish the next rooms even if they have not changed."""
        self._version = -1

    def publish(self, mission: Mission | None, now: float) -> None:
        """Publish the rooms if that is due; the caller catches failures."""
        book, covered = self._book, None if mission is None else mission.covered.version
        is_new = book.version != self._version
        if not is_new and (covered == self._covered or not book.rooms):
            return
        # Shares at the end of an order are not to be missed by who ends with it.
        is_over = mission is not None and mission.state.is_at_rest
        if now - self._published_at < (PERIOD_S if is_new or is_over else SWEPT_PERIOD_S):
            return
        self._published_at, self._version, self._covered = now, book.version, covered
        progress = {} if mission is None else mission.room_progress()
        rooms = tuple(_report(room, progress.get(room.id)) for room in book.rooms)
        self._outbox.rooms(Rooms(book.frame, book.version, rooms))


def _report(room: Room, progress: RoomProgress | None) -> RoomReport:
    settings = room.settings
    passes = None if settings.passes is None else passes_document(settings.passes, settings.kinds)
    return RoomReport(
        id=room.id,
        name=room.name,
        outline=room.outline,
        area_m2=room.area_m2,
        neighbours=room.neighbours,
        encloses=room.encloses,
        swept=None if progress is None else progress.share,
        to_go_s=None if progress is None else progress.to_go_s,
        passes=tuple(passes) if isinstance(passes, list) else passes,  # type: ignore[arg-type]
        skip=settings.skip,
        priority=settings.priority,
    )
