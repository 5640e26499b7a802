"""The turn log before the mission begins, for however long that is."""

from __future__ import annotations

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.loop.inbox import Batch, Received
from fasaco_edge.daemon.loop.turn_log import TurnLog, TurnNote
from fasaco_edge.mission.core.events import Decision


class Deaf:
    """A publisher that nobody hears yet."""

    def __init__(self):
        self.sent = []

    def has_listeners(self):
        return bool(self.sent)

    def put(self, payload):
        self.sent.append(payload)


def test_of_a_long_wait_for_a_map_the_newest_pose_and_charge_are_kept():
    log = TurnLog(Deaf(), DaemonConfig(), None)
    for number in range(5_000):
        now = 0.1 * number
        kinds = ["pose"] if number % 10 else ["battery"]
        samples = [Received(kind, Sample(kind, b"%50d" % number), now) for kind in kinds]
        log.note(TurnNote(now, Batch(samples=samples), (), Decision()), None)
    assert log._is_open
    assert [cycle.samples[0].topic for cycle in log._turns] == ["battery", "pose"]
    assert len(log._times) == 2
