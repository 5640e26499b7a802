"""The outbox: a publisher for each topic that the daemon sends, and replies to queries.

Periodic messages are made in ``daemon.loop.periodic``.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from fasaco_edge.bus.queries import Request, Shared
from fasaco_edge.bus.session import Bus
from fasaco_edge.daemon.counters import log_fault
from fasaco_edge.daemon.loop.answers import AnyReply, answering, check
from fasaco_edge.daemon.ros_bridge import RosBridge
from fasaco_edge.errors import FasacoError, NotPublished, NotYet
from fasaco_edge.mission.events import Answer, CommandReceived
from fasaco_edge.mission.orders.commands import command_document
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.path_documents import PathAttachment, Rectangle
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.paths import encode_path
from fasaco_edge.wire.query_table import RPC_NAMES
from fasaco_edge.wire.topic_types import Topic

if TYPE_CHECKING:
    from fasaco_edge.mission.core.path_exit import PublishedPath


LOG = logging.getLogger(__name__)

# Rate limit of log lines for repeated failures [s].
LOG_PERIOD_S = 10.0
# Limit on the failures that wait to be counted.
MOST_FAULTS = 100
# The topics sent here; the turn log and the fleet have publishers of their own.
SENT_TOPICS = tuple(
    topic
    for topic in topics.TOPICS
    if topic.direction == "out" and topic not in (topics.TURNS, topics.FLEET)
)


class Outbox:
    """The publishers of a daemon.

    A query by a topic's name or key gets the last sample of the topic.

    Attributes:
        guard: publishes all messages.
    """

    def __init__(self, bus: Bus, keys: Keys, ros: RosBridge | None = None) -> None:
        self.guard = PublishGuard()
        self._id = bus.id
        self._ros = ros
        self._publishers = {topic.name: bus.advertise(keys, topic) for topic in SENT_TOPICS}
        self._ros_publishers = {} if ros is None else ros.publishers
        self._kept: dict[str, Callable[[], AnyReply]] = {}
        for topic in SENT_TOPICS:
            if topic.name in RPC_NAMES:
                answer = answering(partial(self._answer, topic.name))
                for key in (keys.rpc(topic.name), keys.of(topic)):
                    bus.serve(key, answer)

    def has_listeners(self, topic: Topic) -> bool:
        """Return whether a topic has subscribers."""
        return self._publishers[topic.name].has_listeners()

    def put(self, topic: Topic, payload: bytes, attachment: bytes = b"") -> None:
        """Send a message that is not kept; the caller catches failures."""
        self._publishers[topic.name].put(payload, attachment)

    def send(self, topic: Topic, payload: bytes, attachment: bytes = b"") -> None:
        """Send a message, also to ROS 2, and keep it for queries; the caller catches failures."""
        message = Shared.of(payload, topic.schema, attachment)
        self.keep(topic.name, lambda: message)
        self._publishers[topic.name].put(message.payload, attachment)
        if (publisher := self._ros_publishers.get(topic.name)) is not None:
            publisher.put(message.payload)

    def keep(self, name: str, reply: Callable[[], AnyReply]) -> None:
        """Set the function that makes the reply to queries of a name, on a Zenoh thread."""
        self._kept[name] = reply

    def _answer(self, name: str, request: Request) -> AnyReply:
        check(request)
        kept = self._kept.get(name)
        if kept is None:
            what = "are no rooms" if name == topics.ROOMS.name else f"is no {name}"
            raise NotYet(f"there {what} yet")
        return kept()

    def forget(self) -> None:
        """Drop samples cached for late joiners: another daemon publishes them."""
        for topic in SENT_TOPICS:
            if topic is not topics.STATUS:
                self._publishers[topic.name].forget()
        for publisher in self._ros_publishers.values():
            publisher.forget()

    def path(self, path: PublishedPath) -> bool:
        """Publish a path, by default with headings along it; return whether that succeeded."""
        return self.guard.attempt("path", lambda: self._put_path(path))

    def _put_path(self, path: PublishedPath) -> None:
        yaw = headings(path.xy) if path.yaw is None else path.yaw.copy()
        if len(yaw) and path.end_yaw is not None:
            yaw[-1] = path.end_yaw
        attachment = encode_json(structs.replace(path_attachment(path), daemon=self._id))
        payload = encode_path(path.xy, yaw, path.frame, path.map_stamp_ns)
        self.send(topics.PATH, payload, attachment)

    def status(self, status: Status) -> None:
        """Publish the status, under ROS 2 as diagnostics."""
        self.guard.attempt("status", lambda: self._put_status(status))

    def _put_status(self, status: Status) -> None:
        self.send(topics.STATUS, encode_json(status))
        if self._ros is not None:
            self._ros.diagnose(status)

    def commands(self, commands: Sequence[CommandReceived], answers: Sequence[Answer]) -> None:
        """Publish the accepted commands, for clients that did not see the query."""
        refused = {answer.number for answer in answers if answer.error is not None}
        for asked in commands:
            if asked.number not in refused:
                self.guard.attempt("command", partial(self._put_command, asked))

    def _put_command(self, asked: CommandReceived) -> None:
        self.put(topics.COMMAND, encode_json(command_document(asked.asked)))


def headings(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heading from each point of a path to the next, float64 (n,) [rad]."""
    if len(xy) < 2:
        return np.zeros(len(xy))
    ahead = np.diff(xy, axis=0)
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    return np.append(yaw, yaw[-1])


def path_attachment(path: PublishedPath) -> PathAttachment:
    changed = path.changed and Rectangle(*(round(edge, 3) for edge in path.changed))
    return structs.replace(
        PathAttachment.of(path.plan),
        revision=path.revision,
        map_stamp_ns=path.map_stamp_ns,
        map_revision=path.map_revision,
        reason=path.reason,
        steps=path.steps,
        plan_ms=round(1e3 * path.plan_s, 3),
        changed=changed,
        speed_m_s=path.speed_m_s,
    )


class PublishGuard:
    """Publishes the loop's messages: a failure affects that message alone.

    All failures are counted; one per topic in ``LOG_PERIOD_S`` is logged.
    """

    def __init__(self) -> None:
        self._faults: list[FasacoError] = []
        self._logged_at: dict[str, float] = {}

    def attempt(self, topic: str, publish: Callable[[], None]) -> bool:
        """Make and send a message; return whether that succeeded."""
        try:
            publish()
        except Exception as error:
            why = (
                str(error) if isinstance(error, FasacoError) else f"{type(error).__name__}: {error}"
            )
            fault = NotPublished(f"{topic} was not published: {why}")
            now = time.monotonic()
            if now - self._logged_at.get(topic, float("-inf")) >= LOG_PERIOD_S:
                self._logged_at[topic] = now
                log_fault(LOG, fault)
                if not isinstance(error, FasacoError):
                    LOG.exception("%s", topic)
            if len(self._faults) < MOST_FAULTS:
                self._faults.append(fault)
            return False
        return True

    def take_faults(self) -> list[FasacoError]:
        """Return the failures since the last call; they are logged already."""
        faults, self._faults = self._faults, []
        return faults
