"""Feed of the samples of one robot from the bus, which it joins as soon as possible."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from functools import partial
from typing import Self

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.mailbox import Mailbox, Queue
from fasaco_edge.bus.queries import QueryReply
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.client.robot_state import Token
from fasaco_edge.errors import BusUnavailable
from fasaco_edge.wire.keys import VERSION, Keys
from fasaco_edge.wire.limits import MAX_JSON_BYTES, MAX_MESSAGE_BYTES
from fasaco_edge.wire.topic_types import NEWEST, Topic
from fasaco_edge.wire.topics import FLEET, FLOOR, PHEROMONE, TOPICS, UNSWEPT

RETRY_S = 0.5
# Longest wait at the end for a host that does not answer [s].
END_S = 0.5


class BusJoining(ABC):
    """Joins the bus in a thread, and listens on it; a context manager.

    Attributes:
        trouble: why the bus is not joined yet; "" once it is joined.
    """

    def __init__(self, settings: BusSettings) -> None:
        self.trouble = ""
        self._settings = settings
        self._ended = threading.Event()
        self._bus: Bus | None = None
        self._lock = threading.Lock()
        # In a thread: a host that does not answer would block the caller.
        self._joining = threading.Thread(target=self._join, name="join-bus", daemon=True)

    def __enter__(self) -> Self:
        self._joining.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        # The interpreter would abort if it ended while a thread returns from Zenoh.
        self._joining.join(END_S)
        with self._lock:
            if self._bus is not None:
                self._bus.close()

    @abstractmethod
    def _listen(self, bus: Bus) -> None:
        """Declare the subscriptions; called on the joining thread, with the lock held."""

    def _join(self) -> None:
        while not self._ended.is_set():
            try:
                bus = open_bus(self._settings)
            except BusUnavailable as error:
                places = ", ".join(self._settings.connect)
                self.trouble = f"{places}: {str(error).removesuffix(f' to {places}')}"
                self._ended.wait(RETRY_S)
                continue
            with self._lock:
                if self._ended.is_set():
                    bus.close()
                    return
                self._bus = bus
                self._listen(bus)
                self.trouble = ""
            return


WATCHED = [topic for topic in TOPICS if topic.queues.watch is not None]
# Topics that the daemon publishes only while a subscriber exists.
ON_REQUEST = (PHEROMONE, FLOOR, UNSWEPT)
SUBSCRIBED = [topic for topic in WATCHED if topic not in ON_REQUEST]
# Queue length of messages of a fleet's other robots.
FLEET_WAITING = 64
QUEUED = {"token": Queue(256), FLEET.name: Queue(FLEET_WAITING, MAX_JSON_BYTES)} | {
    topic.name: Queue(topic.queues.watch, MAX_MESSAGE_BYTES)
    for topic in WATCHED
    if topic.queues.watch is not None and topic.queues.watch > NEWEST
}


def _size_of(item: object) -> int:
    return item.size if isinstance(item, Sample) else 0


class Feed(BusJoining):
    """The samples of one robot, and the names of all robots; a context manager.

    ``with_fleet``: also the fleet messages of all robots.
    """

    def __init__(self, settings: BusSettings, keys: Keys, *, with_fleet: bool = False) -> None:
        super().__init__(settings)
        self._keys = keys
        self._mailbox: Mailbox[object] = Mailbox(QUEUED, size_of=_size_of)
        self._with_fleet = with_fleet
        self._wanted: set[Topic] = set()
        self._requested: dict[Topic, Subscription] = {}

    def take(self, timeout_s: float) -> list[tuple[str, object]]:
        """Return arrivals as (topic, Sample or Token); wait up to ``timeout_s`` [s] for one."""
        return self._mailbox.take(timeout_s)

    def want(self, topic: Topic, wants: bool) -> None:
        """Subscribe to a topic of ``ON_REQUEST``, or unsubscribe."""
        with self._lock:
            (self._wanted.add if wants else self._wanted.discard)(topic)
            if self._bus is not None:
                self._request(self._bus)

    def ask(self, query: str, payload: bytes, timeout_s: float) -> list[QueryReply]:
        """Query the robot's daemon; return all replies.

        Args:
            query: name of the query.
            payload: its JSON payload.
            timeout_s: timeout of the replies [s].

        Raises:
            BusUnavailable: the bus is not joined yet.
        """
        with self._lock:
            bus = self._bus
        if bus is None:
            raise BusUnavailable(self.trouble or "not joined yet")
        return bus.get(self._keys.rpc(query), timeout_s, payload)

    def _request(self, bus: Bus) -> None:
        for topic in self._wanted - self._requested.keys():
            self._requested[topic] = self._subscribe(bus, topic)
        for topic in self._requested.keys() - self._wanted:
            bus.unsubscribe(self._requested.pop(topic))

    def _listen(self, bus: Bus) -> None:
        prefix = f"{self._keys.base}/{VERSION}"
        bus.watch_tokens(f"{prefix}/*/alive", self._note_token)
        for topic in SUBSCRIBED:
            self._subscribe(bus, topic)
        if self._with_fleet:
            bus.subscribe(self._keys.of_all(FLEET), partial(self._post, FLEET.name))
        self._request(bus)

    def _subscribe(self, bus: Bus, topic: Topic) -> Subscription:
        return bus.listen(self._keys, topic, partial(self._post, topic.name))

    def _note_token(self, key: str, here: bool) -> None:
        self._mailbox.post("token", Token(key.split("/")[-2], here))

    def _post(self, topic: str, sample: Sample) -> None:
        self._mailbox.post(topic, sample)
