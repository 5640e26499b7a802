"""Robots of a fleet wait in queues of their own: none takes the room of another."""

from __future__ import annotations

import pytest

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.fleet.mission.frames import MOST_OTHERS
from fasaco_edge.fleet.observer.queues import DEPTHS, FleetInbox

CAPACITY = 4_000


class Box(FleetInbox):
    def __init__(self) -> None:
        self.count = 0
        super().__init__(CAPACITY, self._stamped)

    def _stamped(self, topic: str, sample: Sample) -> Arrival:
        self.count += 1
        return Arrival(topic, sample, self.count, self.count)

    def put(self, robot: str, topic: str, payload: bytes) -> None:
        self.post(robot, topic, Sample(f"fasaco/@v1/{robot}/{topic}", payload))

    def taken(self) -> list[tuple[str, str, bytes]]:
        return [
            (heard.robot, heard.arrival.topic, heard.arrival.sample.payload)
            for heard in self.take(0.0)
        ]


def test_a_flooding_robot_displaces_only_its_own_samples():
    box = Box()
    box.put("r2", "fleet", b"quiet")
    for number in range(10_000):
        box.put("r1", "fleet", b"%d" % number)
        box.put("r1", "status", b"%d" % number)
    box.put("r2", "pose", b"here")
    taken = box.taken()
    kept = [payload for robot, topic, payload in taken if (robot, topic) == ("r1", "fleet")]
    assert kept == [b"%d" % number for number in range(10_000 - DEPTHS["fleet"], 10_000)]
    assert [entry for entry in taken if entry[:2] == ("r1", "status")] == [
        ("r1", "status", b"9999")
    ]
    assert [entry for entry in taken if entry[0] == "r2"] == [
        ("r2", "fleet", b"quiet"),
        ("r2", "pose", b"here"),
    ]
    traffic = box.traffic("r1")
    assert (traffic.messages, traffic.bytes) == (10_000, sum(len(str(n)) for n in range(10_000)))
    assert traffic.too_large == 0
    assert box.traffic("r1").messages == 0


@pytest.mark.parametrize("size", [CAPACITY // 4 + 1, CAPACITY])
def test_a_sample_larger_than_its_share_is_dropped(size):
    box = Box()
    box.put("r1", "map", bytes(size))
    box.put("r1", "fleet", b"small")
    assert box.taken() == [("r1", "fleet", b"small")]
    assert box.traffic("r1").too_large == 1


def test_no_more_names_are_kept_than_there_is_room_for():
    box = Box()
    for number in range(MOST_OTHERS + 5):
        box.put(f"r{number}", "fleet", b"")
    assert len(box.taken()) == MOST_OTHERS
    box.forget("r3")
    box.put("late", "fleet", b"")
    assert box.taken() == [("late", "fleet", b"")]
