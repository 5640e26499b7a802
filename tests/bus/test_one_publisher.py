"""The rule of one publisher: who counts, until when, and what is said of the other."""

from __future__ import annotations

from dataclasses import replace

from fasaco_edge.bus.one_publisher import SHOWN_S, OnePublisher, ReturningMaps
from fasaco_edge.wire.messages.maps import decode_occupancy_grid
from tests.support.rooms import WALL, fill, map_bytes, room

SILENT_S = 4.0
ROOM = room(4.0, 3.0)
OPEN, WALLED = (
    decode_occupancy_grid(map_bytes(pixels), ROOM.size)
    for pixels in (ROOM, fill(ROOM, 2.0, 0.6, 2.1, 2.4, WALL))
)


class Sessions:
    def __init__(self, linked=(), passing=()):
        self.linked, self.passing = set(linked), set(passing)

    def is_linked(self, session):
        return session in self.linked

    def is_relay(self, session):
        return session in self.passing


def maps(**sessions):
    return OnePublisher("maps", SILENT_S, Sessions(**sessions))


def test_the_first_counts_while_it_speaks():
    one = maps()
    assert [one.takes("ab"[turn % 2], turn) for turn in range(6)] == [True, False] * 3
    assert one.conflict(6.0) == (
        "maps come from two publishers: session a counts, session b does not"
    )
    assert one.refuses("b")
    assert not one.refuses("a")
    assert one.conflict(5.0 + SHOWN_S + 0.1) == ""


def test_another_counts_once_the_first_is_silent():
    one = maps(linked="a")
    assert one.takes("a", 0.0)
    assert not one.takes("b", SILENT_S)
    assert one.takes("b", SILENT_S + 0.1)
    assert not one.takes("a", SILENT_S + 0.2)


def test_another_publisher_takes_over_when_the_session_ends():
    sessions = Sessions(linked="a")
    one = OnePublisher("maps", SILENT_S, sessions)
    assert one.takes("a", 0.0)
    assert not one.takes("b", 0.1)
    assert not one.takes_over(0.2)
    sessions.linked.clear()
    assert one.takes_over(0.3)
    assert not one.takes_over(0.4)
    assert one.takes("b", 0.5)
    assert one.conflict(0.6) == ""


def test_one_message_is_enough_to_replace_a_silent_publisher():
    """For one behind a router, whose session cannot be observed; a linked one is waited for."""
    one = maps()
    assert one.takes("a", 0.0)
    assert not one.takes("b", 1.0)
    assert not one.takes_over(SILENT_S)
    assert one.takes_over(SILENT_S + 0.1)
    linked = maps(linked="a")
    assert linked.takes("a", 0.0)
    assert not linked.takes("b", 1.0)
    assert not linked.takes_over(SILENT_S + 0.1)


def test_a_sample_of_unknown_origin_counts():
    one = maps(passing="r")
    assert [one.takes(sender, 0.0) for sender in ("a", "", "r", "a", "b")] == [True] * 4 + [False]
    assert "session a counts" in one.conflict(0.0)
    alone = maps(passing="r")
    assert [alone.takes(sender, 0.0) for sender in ("r", "", "r", "a")] == [True] * 4
    assert alone.conflict(0.0) == ""


def test_of_two_maps_that_alternate_one_counts_while_it_arrives():
    maps = ReturningMaps()
    counted = [maps.takes((OPEN, WALLED)[turn % 2], float(turn)) for turn in range(10)]
    assert counted == [True] * 4 + [False, True] * 3
    assert maps.conflict(9.0) == "maps alternate, as from two publishers"
    alone = [maps.takes(OPEN, 10.0 + second) for second in range(11)]
    assert alone == [False] * 10 + [True]


def test_two_maps_of_different_frames_both_count():
    elsewhere = replace(OPEN, frame="upstairs")
    maps = ReturningMaps()
    assert all(maps.takes((OPEN, elsewhere)[turn % 2], float(turn)) for turn in range(10))
