"""Subscriptions of an observer of a fleet: some topics of each robot, and their maps in turn.

Maps are requested one at a time, so that a network carries no more than one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.session import Bus
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topic_types import Topic
from fasaco_edge.wire.topics import FLEET, MAP

# Time for a robot's map before the next robot's turn.
MAP_TURN_NS = 2_000_000_000

Post = Callable[[str, str, Sample], None]


class FleetSubscriptions:
    """Subscriptions to the robots of a fleet.

    Args:
        bus: the session.
        keys: of any robot on it.
        topics: subscribed to for each robot that has joined.
        post: called with robot, topic and sample, on a thread of Zenoh's.
    """

    def __init__(self, bus: Bus, keys: Keys, topics: Sequence[Topic], post: Post) -> None:
        self._bus, self._keys, self._topics, self._post = bus, keys, topics, post
        self._subscriptions: dict[str, list[Subscription]] = {}
        # The robot whose turn it is, the end of its turn, its subscription until the map arrives.
        self._turn, self._turn_until_ns = "", 0
        self._map: Subscription | None = None

    @property
    def robots(self) -> set[str]:
        """Names of the robots subscribed to."""
        return set(self._subscriptions)

    def listen(self) -> None:
        """Subscribe to the fleet messages of all robots."""

        def post(sample: Sample) -> None:
            self._post(self._keys.robot_of(sample.key), FLEET.name, sample)

        self._bus.subscribe(self._keys.of_all(FLEET), post)

    def hear(self, robot: str) -> None:
        """Subscribe to a robot that has joined."""
        self._subscriptions[robot] = [self._listen(robot, topic) for topic in self._topics]

    def leave(self, robot: str) -> None:
        """Unsubscribe from a robot."""
        for subscription in self._subscriptions.pop(robot, ()):
            self._bus.unsubscribe(subscription)
        self.end_map_turn(robot)

    def ask_for_maps(self, robots: Sequence[str], now_ns: int) -> None:
        """Ask robots for their maps, one after another; call it often.

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
