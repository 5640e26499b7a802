"""Publishers of the contract that wait where a link is busy, and count.

Most of the contract's drop a sample then, which is their right: on a busy machine one of a burst
of poses is gone before it has left the process, and what comes of the rest cannot be foretold.
"""

from __future__ import annotations

from dataclasses import replace

from fasaco_edge.bus.session import Bus
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topic_types import VOLATILE, Topic


class Sender:
    """Publishes a topic and drops nothing.

    Attributes:
        sent: how many samples it has sent.
    """

    def __init__(self, bus: Bus, topic: Topic) -> None:
        qos = replace(topic.qos or VOLATILE, congestion="block")
        self._publisher = bus.publisher(Keys().of(topic), topic.schema, qos)
        self.sent = 0

    def put(self, payload: bytes, attachment: bytes = b"") -> None:
        """Send ``payload``."""
        self.sent += 1
        self._publisher.put(payload, attachment)
