"""The swept floor is published again unchanged, for listeners that come while others listen."""

from __future__ import annotations

from types import SimpleNamespace

from fasaco_edge.daemon.loop.outbox import FLOOR_PERIOD_S, REPEAT_S, FloorPublisher
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.coverage.swept_floor import SweptFloor


def test_an_unchanged_floor_is_published_again_after_a_while():
    floor, sent = SweptFloor(0.3), []
    floor.record(Pose2D(1.0, 1.0))
    mission = SimpleNamespace(
        floor=floor,
        grid=SimpleNamespace(frame="map", stamp_ns=1),
        rotation=SimpleNamespace(geometry=lambda geometry: geometry),
    )
    outbox = SimpleNamespace(shows_floor=True, floor=sent.append)
    publisher = FloorPublisher(outbox)
    # The mission is done: a recorder listens, and the floor no longer changes.
    counts = []
    for now in (0.0, FLOOR_PERIOD_S, REPEAT_S - 0.1, REPEAT_S, REPEAT_S + 0.1, 2 * REPEAT_S):
        publisher.publish(mission, now)
        counts.append(len(sent))
    assert counts == [1, 1, 1, 2, 2, 3]
    floor.record(Pose2D(1.4, 1.0))
    publisher.publish(mission, 2 * REPEAT_S + FLOOR_PERIOD_S)
    assert len(sent) == 4
