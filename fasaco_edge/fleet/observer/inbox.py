"""The queues between Zenoh's threads and an observer of a fleet: a set for each robot.

A robot that floods fills its own queues only, and its newest messages are kept.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.fleet.mission.frames import MOST_HEARD
from fasaco_edge.wire.topics import FLEET, POSE

# Largest number of waiting samples of a topic; 1 for topics not named. A fleet's message is sent
# again within a second; several poses show which cells a robot drove through.
DEPTHS = {FLEET.name: 4, POSE.name: 256}
# Least number of robots that the space is divided by.
LEAST_SHARING = 4


@dataclass(frozen=True, slots=True)
class Heard:
    """A sample of a robot."""

    robot: str
    arrival: Arrival


@dataclass(slots=True)
class Traffic:
    """Messages of a robot to its fleet, their bytes, and samples of all topics left out."""

    messages: int = 0
    bytes: int = 0
    too_large: int = 0


@dataclass(slots=True)
class _Queues:
    waiting: dict[str, deque[Arrival]] = field(default_factory=dict)
    bytes: int = 0
    traffic: Traffic = field(default_factory=Traffic)


class FleetInbox:
    """Samples of robots, each within a share of ``capacity_bytes``.

    Args:
        capacity_bytes: of all robots.
        stamp: returns a sample with its time of arrival.
    """

    def __init__(self, capacity_bytes: int, stamp: Callable[[str, Sample], Arrival]) -> None:
        self._capacity = capacity_bytes
        self._stamp = stamp
        self._changed = threading.Condition()
        self._robots: dict[str, _Queues] = {}
        self._is_news = False

    def post(self, robot: str, topic: str, sample: Sample) -> None:
        """Add a sample; safe from any thread, never waits for the writer."""
        with self._changed:
            queues = self._robots.get(robot)
            if queues is None:
                if len(self._robots) >= MOST_HEARD:
                    return
                queues = self._robots[robot] = _Queues()
            if topic == FLEET.name:
                queues.traffic.messages += 1
                queues.traffic.bytes += sample.size
            self._add(queues, self._stamp(topic, sample))
            self._is_news = True
            self._changed.notify()

    def take(self, timeout_s: float) -> list[Heard]:
        """Return all waiting samples, robot by robot; wait up to ``timeout_s`` [s] for one."""
        with self._changed:
            if not self._is_news:
                self._changed.wait(timeout_s)
            taken = []
            for robot, queues in self._robots.items():
                arrivals = [one for waiting in queues.waiting.values() for one in waiting]
                arrivals.sort(key=lambda arrival: arrival.at_ns)
                taken += [Heard(robot, arrival) for arrival in arrivals]
                queues.waiting.clear()
                queues.bytes = 0
            self._is_news = False
            return taken

    def traffic(self, robot: str) -> Traffic:
        """Return a robot's counts since the last call."""
        with self._changed:
            queues = self._robots.get(robot)
            if queues is None:
                return Traffic()
            found, queues.traffic = queues.traffic, Traffic()
            return found

    def forget(self, robot: str) -> None:
        """Drop a robot's queues: those of another fleet need none."""
        with self._changed:
            self._robots.pop(robot, None)

    def _add(self, queues: _Queues, arrival: Arrival) -> None:
        share = self._capacity // max(len(self._robots), LEAST_SHARING)
        size = arrival.sample.size
        waiting = queues.waiting.setdefault(arrival.topic, deque())
        while waiting and (
            len(waiting) >= DEPTHS.get(arrival.topic, 1) or queues.bytes + size > share
        ):
            queues.bytes -= waiting.popleft().sample.size
        if queues.bytes + size > share:
            queues.traffic.too_large += 1
            return
        waiting.append(arrival)
        queues.bytes += size
