"""What a session declares on a key: a publisher, with its quality of service, or a subscriber."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import zenoh
import zenoh.ext

from fasaco_edge.bus.encodings import encoding_of
from fasaco_edge.bus.qos import Qos

# So often who listens to a latched key asks its publishers whether it missed the last sample.
ASK_PERIOD: Any = timedelta(seconds=1)  # a float by the stubs


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
        self._publisher: Any = self._plain
        if qos.latched:
            self._publisher = zenoh.ext.declare_advanced_publisher(
                session,
                key,
                **options,
                cache=zenoh.ext.CacheConfig(max_samples=qos.cache),
                # Samples are numbered, so that who misses one can ask for it. Heartbeats tell
                # nobody: zenoh-ext 1.10 cannot read those of a key with an "@" chunk.
                sample_miss_detection=zenoh.ext.MissDetectionConfig(
                    heartbeat=None, sporadic_heartbeat=None
                ),
                publisher_detection=True,
            )

    def put(self, payload: bytes, attachment: bytes = b"") -> None:
        """Send ``payload``."""
        self._publisher.put(payload, attachment=attachment or None)

    def release(self) -> None:
        """Let go of what Zenoh has given."""
        del self._plain, self._publisher

    def has_listeners(self) -> bool:
        """Tell whether any subscriber matches the key."""
        status: Any = self._plain.matching_status  # a bool by the stubs, an object in fact
        return bool(status.matching)


class Subscription:
    """A subscriber that can be declared anew."""

    def __init__(self, declare: Callable[[], object]) -> None:
        self._declare = declare
        self._subscriber: Any = declare()

    def renew(self) -> None:
        """Declare it anew: a latched one receives the newest sample again."""
        self._subscriber.undeclare()
        self._subscriber = self._declare()

    def release(self) -> None:
        """Let go of what Zenoh has given."""
        del self._subscriber, self._declare


def declare_subscriber(
    session: zenoh.Session, key: str, receive: Callable[[zenoh.Sample], None], history: int
) -> object:
    """Declare a subscriber; with ``history`` a latched one, which gets so many samples first."""
    if not history:
        return session.declare_subscriber(key, receive)
    return zenoh.ext.declare_advanced_subscriber(
        session,
        key,
        receive,
        history=zenoh.ext.HistoryConfig(max_samples=history, detect_late_publishers=True),
        recovery=zenoh.ext.RecoveryConfig(periodic_queries=ASK_PERIOD, heartbeat=None),
        subscriber_detection=True,
    )
