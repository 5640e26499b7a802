"""The ROS 2 bridge: the daemon's samples under the keys of a ROS 2 graph, without ROS.

Incoming samples share the mailbox with samples of native keys; outgoing samples are encoded once
for both. rmw_zenoh and zenoh-bridge-ros2dds differ only in keys, attachments and tokens.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.bus.queries import QueryReply
from fasaco_edge.bus.session import Bus
from fasaco_edge.config.ros import RosConfig
from fasaco_edge.daemon.loop.inbox import poster
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.messages.ros_node import encode_diagnostics
from fasaco_edge.wire.ros_keys import Endpoint, RosNode, RosTopic, gid_of
from fasaco_edge.wire.topic_types import VOLATILE, Topic

# Limit on a request [bytes]; a request of Trigger has five.
MOST_REQUEST_BYTES = 1024


class RosBridge:
    """The subscribers and publishers of the daemon under ROS 2.

    Attributes:
        map: the map's subscription, to query a missing map.
        publishers: publishers by the name of the native topic.
        commands: commands by the key of their service.
    """

    def __init__(
        self, bus: Bus, config: RosConfig, mailbox: Mailbox[object], max_pixels: int
    ) -> None:
        self._bus = bus
        self._config = config
        self._mailbox = mailbox
        self._max_pixels = max_pixels
        self._node = RosNode(config.domain, bus.id, config.namespace, config.node)
        self._endpoints = 0
        if config.kind == "rmw_zenoh":
            bus.token(self._node.token)
        inputs = {name: self._subscribe(name, topic) for name, topic in config.inputs.items()}
        self.map = inputs["map"]
        likes = {topic.name: topic for topic in (topics.PATH, topics.COVERAGE)}
        self.publishers = {
            name: self._publisher(topic, likes.get(name, topics.COMMAND))
            for name, topic in config.outputs.items()
        }
        self.commands = {
            self._serve(service): command for command, service in config.commands.items()
        }

    def _subscribe(self, kind: str, topic: RosTopic) -> Subscription:
        take = poster(self._mailbox, kind, self._max_pixels)
        return self._listen(topic, take, in_order=kind in topics.IN_ORDER)

    def subscribe_mask(self, take: Callable[[Sample], None]) -> Subscription:
        """Subscribe to the keep-out mask; ``take`` is called on a Zenoh thread."""
        return self._listen(self._config.topic("keep_out_mask"), take)

    def _listen(
        self, topic: RosTopic, take: Callable[[Sample], None], *, in_order: bool = False
    ) -> Subscription:
        def post(sample: Sample) -> None:
            take(sample.as_type(topic.schema))  # ROS sends no type with a sample

        key = self._config.input_key(topic)
        subscription = self._bus.subscribe(key, post, topic.latched, topic.depth, in_order=in_order)
        self._announce("MS", topic)
        return subscription

    def diagnose(self, status: Status) -> None:
        """Publish a status as diagnostics."""
        payload = encode_diagnostics(status, self._node.name, time.time_ns())
        self.publishers["diagnostics"].put(payload)

    def _serve(self, service: RosTopic) -> str:
        """Take the requests of a service; return its key expression, which allows any type hash."""
        key = self._config.input_key(service)
        post = partial(self._mailbox.post, "command")
        too_long = QueryReply(b"the request is too long", is_error=True)
        self._bus.take_questions(key, post, MOST_REQUEST_BYTES, too_long)
        self._announce("SS", service)
        return key

    def _publisher(self, topic: RosTopic, like: Topic) -> Publisher:
        """Publish ``topic`` with the quality of service of the native key ``like``."""
        key = self._config.output_key(topic)
        publisher = self._bus.publisher(key, topic.schema, like.qos or VOLATILE)
        if token := self._announce("MP", topic):
            publisher.gid = gid_of(token)
        return publisher

    def _announce(self, kind: Endpoint, topic: RosTopic) -> str:
        """Return the token of a new endpoint; "" with a bridge, which declares its own tokens."""
        if self._config.kind == "bridge":
            return ""
        self._endpoints += 1
        token = self._node.endpoint_token(self._endpoints, kind, topic)
        self._bus.token(token)
        return token
