"""Feed of the samples of a fleet's robots from the bus."""

from __future__ import annotations

from collections.abc import Collection

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.bus.session import Bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.client.feed import Joining
from fasaco_edge.client.phrases import steady_now
from fasaco_edge.fleet.observer.inbox import FleetInbox, FleetSubscriptions, Received
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topics import STATUS

# Largest size of all waiting samples [bytes]; a robot gets at most a quarter of it.
CAPACITY_BYTES = 128_000_000


class FleetFeed(Joining):
    """The samples of the robots of a fleet; a context manager.

    The reader gets the fleet messages of all robots, and selects by ``attend`` the robots whose
    statuses it wants.
    """

    def __init__(self, settings: BusSettings, keys: Keys) -> None:
        super().__init__(settings)
        self._keys = keys
        self._inbox = FleetInbox(CAPACITY_BYTES, _stamped)
        self._subscriptions: FleetSubscriptions | None = None

    def take(self, timeout_s: float) -> list[Received]:
        """Return what has arrived, robot by robot; wait up to ``timeout_s`` [s] for a sample."""
        return self._inbox.take(timeout_s)

    def attend(self, robots: Collection[str]) -> None:
        """Subscribe to the robots of these names; call it often."""
        subscriptions = self._subscriptions
        if subscriptions is None:
            return
        for robot in set(robots) - subscriptions.robots:
            subscriptions.subscribe(robot)

    def forget(self, robot: str) -> None:
        """Drop the queues of a robot of another fleet."""
        self._inbox.forget(robot)

    def _listen(self, bus: Bus) -> None:
        subscriptions = FleetSubscriptions(bus, self._keys, (STATUS,), self._inbox.post)
        subscriptions.listen()
        self._subscriptions = subscriptions


def _stamped(topic: str, sample: Sample) -> Arrival:
    at_ns = int(1e9 * steady_now())
    return Arrival(topic, sample, at_ns, at_ns)
