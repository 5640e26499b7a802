"""Fleets that tell what a test wants, for the live view."""

from __future__ import annotations

from typing import Any

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.fleet.observer.queues import RobotSample
from fasaco_edge.fleet.watch.view import FleetView
from fasaco_edge.wire.documents.fleet import FleetPart
from fasaco_edge.wire.documents.json_text import encode_json
from tests.fleet.told import member
from tests.watch.grids import NOW

# Two robots that have divided a hall of 20 x 30 cells; the second one's part is on the right.
PARTS = tuple(FleetPart(name, *cell, 0.0, 1.2) for name, cell in (("a", (9, 0)), ("b", (9, 29))))
AHEAD = ((1.3, 1.0), (1.6, 1.0), (1.6, 2.5))


def tell(view: FleetView, robot: str, topic: str, payload: bytes, now: float = NOW) -> None:
    sample = Sample(f"fasaco/@v1/{robot}/{topic}", payload)
    at_ns = int(1e9 * now)
    view.take(RobotSample(robot, Arrival(topic, sample, at_ns, at_ns)))


def say(view: FleetView, robot: str, now: float = NOW, **members: Any) -> None:
    tell(view, robot, "fleet", encode_json(member(**members)), now)


def two_in_a_hall() -> FleetView:
    view = FleetView("house")
    lane = [(2, col) for col in range(4)]
    ours = {"division": 7, "by": "b", "parts": PARTS}
    say(view, "a", cells=lane, ahead=AHEAD, **ours)
    say(view, "b", cells=[(17, 28), (17, 27), (2, 3)], x=8.3, y=5.2, waits_for="a", **ours)
    view.tick(NOW)
    return view
