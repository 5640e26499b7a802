"""Publisher of a ROS 2 topic."""

from __future__ import annotations

import time

import zenoh

from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.wire.ros_keys import attachment


class RosPublisher:
    """Publishes one topic; with ``gid``, what rmw_zenoh demands goes with each sample."""

    def __init__(self, publisher: Publisher, gid: bytes = b"") -> None:
        self._publisher = publisher
        self._gid = gid
        self._count = 0

    def forget(self) -> None:
        """Drop the sample kept for late joiners."""
        self._publisher.forget()

    def put(self, payload: bytes | zenoh.ZBytes) -> None:
        """Send a message."""
        self._count += 1
        beside = attachment(self._count, time.time_ns(), self._gid) if self._gid else b""
        self._publisher.put(payload, beside)
