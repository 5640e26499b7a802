"""A publisher on a key, with its quality of service."""

from __future__ import annotations

from functools import partial
from typing import Any

import zenoh
import zenoh.ext

from fasaco_edge.bus.encodings import encoding_of
from fasaco_edge.bus.qos import Qos


class Publisher:
    """Puts samples on one key, with its quality of service."""

    def __init__(self, session: zenoh.Session, key: str, schema: str, qos: Qos) -> None:
        options: dict[str, Any] = {
            "encoding": encoding_of(schema),
            "reliability": getattr(zenoh.Reliability, qos.reliability.upper()),
            "congestion_control": getattr(zenoh.CongestionControl, qos.congestion.upper()),
            "priority": getattr(zenoh.Priority, qos.priority.upper()),
            "express": qos.express,
        }
        # An advanced publisher cannot say who listens, a plain one beside it can.
        self._plain = session.declare_publisher(key, **options)
        self._latched = partial(_latched, session, key, options, qos.cache) if qos.latched else None
        self._publisher: Any = self._latched() if self._latched else self._plain

    def forget(self) -> None:
        """Keep nothing of what was said for those who join late."""
        if self._latched is not None:
            self._publisher.undeclare()
            self._publisher = self._latched()

    def put(self, payload: bytes | zenoh.ZBytes, attachment: bytes = b"") -> None:
        """Send ``payload``."""
        self._publisher.put(payload, attachment=attachment or None)

    def release(self) -> None:
        """Let go of what Zenoh has given."""
        del self._plain, self._publisher, self._latched

    def has_listeners(self) -> bool:
        """Tell whether any subscriber matches the key."""
        status: Any = self._plain.matching_status  # a bool by the stubs, an object in fact
        return bool(status.matching)


def _latched(session: zenoh.Session, key: str, options: dict[str, Any], samples: int) -> object:
    return zenoh.ext.declare_advanced_publisher(
        session,
        key,
        **options,
        cache=zenoh.ext.CacheConfig(max_samples=samples),
        # Samples are numbered, so that who misses one can ask for it. Heartbeats tell
        # nobody: zenoh-ext 1.10 cannot read those of a key with an "@" chunk.
        sample_miss_detection=zenoh.ext.MissDetectionConfig(
            heartbeat=None, sporadic_heartbeat=None
        ),
        publisher_detection=True,
    )
