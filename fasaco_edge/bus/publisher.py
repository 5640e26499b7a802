"""Publishers of native keys and ROS 2 topics, with encoding and QoS."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import zenoh
import zenoh.ext

from fasaco_edge.wire.ros_keys import attachment as rmw_attachment
from fasaco_edge.wire.topic_types import Qos

CDR = zenoh.Encoding.APPLICATION_CDR
JSON = zenoh.Encoding.APPLICATION_JSON


def encoding_of(schema: str) -> zenoh.Encoding:
    """Return the encoding of a CDR type, or of JSON for ""."""
    return CDR.with_schema(schema) if schema else JSON


class Publisher:
    """Publishes samples on one key, of the CDR type ``schema`` or, for "", JSON.

    In Zenoh the sender decides whether a sample is dropped on congestion.

    Attributes:
        gid: identifies a ROS 2 publisher in rmw_zenoh's attachment of each sample; b"" for none.
    """

    def __init__(self, session: zenoh.Session, key: str, schema: str, qos: Qos) -> None:
        options: dict[str, Any] = {
            "encoding": encoding_of(schema),
            "reliability": zenoh.Reliability.RELIABLE,
            "congestion_control": getattr(zenoh.CongestionControl, qos.congestion.upper()),
            "priority": getattr(zenoh.Priority, qos.priority.upper()),
            "express": qos.express,
        }
        self.gid = b""
        self._count = 0
        # Only a plain publisher reports whether its key has subscribers, an advanced one does not.
        self._plain = session.declare_publisher(key, **options)
        self._latched = partial(_latched, session, key, options, qos.cache) if qos.latched else None
        self._publisher: Any = self._latched() if self._latched else self._plain

    def forget(self) -> None:
        """Drop the samples cached for late joiners."""
        if self._latched is not None:
            # The publisher is released, not undeclared: undeclare() of an advanced publisher
            # (zenoh-python 1.10) waits for Zenoh's locks while it holds the interpreter lock, and
            # deadlocks with a callback that holds Zenoh's locks and waits for the interpreter lock.
            self._publisher = None
            self._publisher = self._latched()

    def put(self, payload: bytes | zenoh.ZBytes, attachment: bytes = b"") -> None:
        """Send a sample."""
        if self.gid:
            self._count += 1
            attachment = rmw_attachment(self._count, time.time_ns(), self.gid)
        self._publisher.put(payload, attachment=attachment or None)

    def release(self) -> None:
        """Release the objects of Zenoh."""
        del self._plain, self._publisher, self._latched

    def has_listeners(self) -> bool:
        """Return whether any subscriber matches the key."""
        status: Any = self._plain.matching_status  # a bool by the stubs, an object in fact
        return bool(status.matching)


def _latched(session: zenoh.Session, key: str, options: dict[str, Any], samples: int) -> object:
    return zenoh.ext.declare_advanced_publisher(
        session,
        key,
        **options,
        cache=zenoh.ext.CacheConfig(max_samples=samples),
        # Sequence numbers let a subscriber query a sample that it missed. No heartbeats: zenoh-ext
        # 1.10 cannot read heartbeats of a key with an "@" chunk.
        sample_miss_detection=zenoh.ext.MissDetectionConfig(
            heartbeat=None, sporadic_heartbeat=None
        ),
        publisher_detection=True,
    )
