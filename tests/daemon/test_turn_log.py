"""The turn log before the mission begins, for however long that is."""

from __future__ import annotations

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.loop.inbox import CycleInput, Received
from fasaco_edge.daemon.loop.turn_log import TurnLog
from fasaco_edge.mission.events import Decision
from fasaco_edge.samples import SampleDecoder
from fasaco_edge.wire.documents.turns import decode_turns


class Publisher:
    def __init__(self):
        self.is_heard, self.sent = False, []

    def has_listeners(self):
        return self.is_heard

    def put(self, payload):
        self.sent.append(payload)


def test_a_long_wait_for_a_map_keeps_the_newest_pose_and_charge():
    log = TurnLog(publisher := Publisher(), DaemonConfig(), None)

    def note(number):
        kind = "pose" if number % 10 else "battery"
        received = Received(kind, Sample(kind, b"%50d" % number), 0.1 * number)
        log.note(received.at, CycleInput(samples=[received]), (), Decision(), None)

    for number in range(5_000):
        note(number)
    assert publisher.sent == []
    publisher.is_heard = True
    note(5_001)
    (payload,) = publisher.sent
    batch = decode_turns(payload)
    assert batch.first == 1
    assert batch.beginning is not None
    assert batch.times == [0.1 * number for number in (4_990, 4_999, 5_001)]
    assert [turn.number for turn in batch.turns] == [1, 2, 3]
    assert not any(turn.is_begun for turn in batch.turns)
    arrivals = [numbered.arrival for numbered in SampleDecoder().samples(batch.told)]
    told = [(arrival.topic, int(arrival.sample.payload)) for arrival in arrivals]
    assert told == [("battery", 4_990), ("pose", 4_999), ("pose", 5_001)]
    assert [turn.samples[0].topic for turn in batch.turns] == [topic for topic, _ in told]
