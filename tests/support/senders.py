"""Publishers of the contract that wait while a link is busy, and count.

Most publishers of the contract then drop samples. On a busy machine they would drop some of a burst
of poses, and the result of a test would be random.
"""

from __future__ import annotations

from dataclasses import replace

from fasaco_edge.bus.session import Bus
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topic_types import VOLATILE, Topic


class Sender:
    """Publishes a topic and drops nothing.

    Attributes:
        sent: number of samples sent.
    """

    def __init__(self, bus: Bus, topic: Topic) -> None:
        qos = replace(topic.qos or VOLATILE, congestion="block")
        self._publisher = bus.publisher(Keys().of(topic), topic.schema, qos)
        self.sent = 0

    def put(self, payload: bytes, attachment: bytes = b"") -> None:
        """Send ``payload``."""
        self.sent += 1
        self._publisher.put(payload, attachment)
