"""Queues between Zenoh's threads and an observer of a fleet, separate for each robot.

A robot that sends too much fills its own queues only; its newest messages are kept. Maps are
requested from one robot at a time, to limit the load on the network.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.session import Bus
from fasaco_edge.fleet.mission.frames import MOST_OTHERS
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topic_types import Topic
from fasaco_edge.wire.topics import FLEET, MAP, POSE

# Largest number of waiting samples by topic; 1 for other topics. Fleet messages repeat within a
# second; the cells that a robot drove through are found from all its poses.
DEPTHS = {FLEET.name: 4, POSE.name: 256}
# Least number of shares that the capacity is divided into.
LEAST_SHARING = 4


@dataclass(frozen=True, slots=True)
class RobotSample:
    """A sample of a robot."""

    robot: str
    arrival: Arrival


@dataclass(slots=True)
class Traffic:
    """Counts of a robot's fleet messages, of their bytes, and of samples that were too large."""

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
        capacity_bytes: capacity of all robots together.
        stamp: returns a sample with its time of arrival.
    """

    def __init__(self, capacity_bytes: int, stamp: Callable[[str, Sample], Arrival]) -> None:
        self._capacity = capacity_bytes
        self._stamp = stamp
        self._changed = threading.Condition()
        self._robots: dict[str, _Queues] = {}
        self._is_news = False

    def post(self, robot: str, topic: str, sample: Sample) -> None:
        """Add a sample, from any thread, without waiting for the reader."""
        with self._changed:
            queues = self._robots.get(robot)
            if queues is None:
                if len(self._robots) >= MOST_OTHERS:
                    return
                queues = self._robots[robot] = _Queues()
            if topic == FLEET.name:
                queues.traffic.messages += 1
                queues.traffic.bytes += sample.size
            self._add(queues, self._stamp(topic, sample))
            self._is_news = True
            self._changed.notify()

    def take(self, timeout_s: float) -> list[RobotSample]:
        """Return all waiting samples, robot by robot; wait up to ``timeout_s`` [s] for one."""
        with self._changed:
            if not self._is_news:
                self._changed.wait(timeout_s)
            taken = []
            for robot, queues in self._robots.items():
                arrivals = [one for waiting in queues.waiting.values() for one in waiting]
                arrivals.sort(key=lambda arrival: arrival.at_ns)
                taken += [RobotSample(robot, arrival) for arrival in arrivals]
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
        """Drop the queues of a robot that is not in the fleet."""
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


# Time for a robot's map to arrive before the next robot is asked [ns].
MAP_TURN_NS = 2_000_000_000

Post = Callable[[str, str, Sample], None]


class FleetSubscriptions:
    """Subscriptions to the robots of a fleet.

    Args:
        bus: the session.
        keys: keys of any robot on the bus.
        topics: subscribed to for each robot that has joined.
        post: called with robot, topic and sample, on a thread of Zenoh's.
    """

    def __init__(self, bus: Bus, keys: Keys, topics: Sequence[Topic], post: Post) -> None:
        self._bus, self._keys, self._topics, self._post = bus, keys, topics, post
        # Names of the robots subscribed to.
        self.robots: set[str] = set()
        # The robot whose map is requested, the end of its turn, its subscription to the map.
        self._turn, self._turn_until_ns = "", 0
        self._map: Subscription | None = None

    def listen(self) -> None:
        """Subscribe to the fleet messages of all robots."""

        def post(sample: Sample) -> None:
            self._post(self._keys.robot_of(sample.key), FLEET.name, sample)

        self._bus.subscribe(self._keys.of_all(FLEET), post)

    def subscribe(self, robot: str) -> None:
        """Subscribe to a robot that has joined."""
        self.robots.add(robot)
        for topic in self._topics:
            self._listen(robot, topic)

    def ask_for_maps(self, robots: Sequence[str], now_ns: int) -> None:
        """Ask robots for their maps, one after another; to be called often.

        Args:
            robots: their names.
            now_ns: time [ns].
        """
        if not robots or now_ns < self._turn_until_ns:
            return
        self.end_map_turn(self._turn)
        after = (robots.index(self._turn) + 1) % len(robots) if self._turn in robots else 0
        self._turn, self._turn_until_ns = robots[after], now_ns + MAP_TURN_NS
        self._map = self._listen(self._turn, MAP)

    def end_map_turn(self, robot: str) -> None:
        """Unsubscribe from a robot's maps until its next turn."""
        if self._map is not None and self._turn == robot:
            self._bus.unsubscribe(self._map)
            self._map = None

    def _listen(self, robot: str, topic: Topic) -> Subscription:
        keys = Keys(robot, self._keys.base)
        return self._bus.listen(keys, topic, partial(self._post, robot, topic.name))
