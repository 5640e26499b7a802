"""When rooms are published: on change, seldom as they are swept, and at once when that is over."""

from __future__ import annotations

from typing import Any

from fasaco_edge.daemon.loop.rooms_publisher import PERIOD_S, SWEPT_PERIOD_S, RoomsPublisher
from fasaco_edge.wire.documents.rooms import Rooms
from tests.mission.test_room_orders import BOTH, IN_EAST, room_at, settled, start


class Sent(list[Rooms]):
    """What was published."""

    def rooms(self, rooms: Rooms) -> None:
        """Take rooms."""
        self.append(rooms)


def test_the_last_shares_of_an_order_do_not_wait():
    drive = settled(*BOTH)
    sent: Any = Sent()
    publisher = RoomsPublisher(sent, drive.mission.rooms)
    publisher.publish(drive.mission, now=0.0)
    number = room_at(drive, *IN_EAST).id
    start(drive, f"room {number}")
    drive.plan()
    drive.go()
    # While it drives, shares are not worth a message a second.
    publisher.publish(drive.mission, now=PERIOD_S)
    assert len(sent) == 1
    publisher.publish(drive.mission, now=SWEPT_PERIOD_S)
    assert len(sent) == 2
    drive.finish()
    publisher.publish(drive.mission, now=SWEPT_PERIOD_S + PERIOD_S)
    assert {room.id: room.swept for room in sent[-1].rooms}[number] == 1.0
    publisher.publish(drive.mission, now=3 * SWEPT_PERIOD_S)
    assert len(sent) == 3
