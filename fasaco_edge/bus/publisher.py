"""Zenoh encodings: CDR with the name of its type, or JSON.

How samples travel: for each key its quality of service; ``protocol/qos.yaml`` is the same table.

Zenoh lets the sender say what becomes of a sample where a link is busy: who publishes a key gets
this from here, whichever process it is.

A publisher on a key, with its quality of service.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import zenoh
import zenoh.ext

CDR = zenoh.Encoding.APPLICATION_CDR
JSON = zenoh.Encoding.APPLICATION_JSON


def encoding_of(schema: str) -> zenoh.Encoding:
    """Return the encoding of a CDR type; of JSON for ""."""
    return CDR.with_schema(schema) if schema else JSON


def schema_of(encoding: zenoh.Encoding) -> str:
    """Return the type that an encoding names, "" for none."""
    return str(encoding).partition(";")[2]


Priority = Literal[
    "real_time",
    "interactive_high",
    "interactive_low",
    "data_high",
    "data",
    "data_low",
    "background",
]


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of a key.

    Attributes:
        priority: what goes first where a link is busy.
        reliability: whether a link that may lose what it carries sends it again.
        congestion: ``drop``: a receiver too slow loses the sample; ``block``: the sender waits
            for it.
        express: whether it is sent at once, never gathered with others into one packet.
        cache: how many samples are kept for those who join late; 0 for none.
    """

    priority: Priority = "data"
    reliability: Literal["reliable", "best_effort"] = "reliable"
    congestion: Literal["drop", "block"] = "drop"
    express: bool = False
    cache: int = 0

    @property
    def latched(self) -> bool:
        """Whether who joins late gets what was said last."""
        return self.cache > 0


VOLATILE = Qos()

QOS: dict[str, Qos] = {
    "map": Qos("data_high", cache=1),
    "map_update": Qos("data_high", congestion="block"),
    "pose": Qos("interactive_low", express=True),
    "path": Qos("interactive_high", express=True, cache=1),
    "status": Qos("interactive_low", cache=1),
    "command": Qos("interactive_low"),
    "coverage": Qos("data_low", cache=1),
    "recorder": Qos("data", cache=1),
    "turns": Qos("data_low"),
    "pheromone": Qos("background", "best_effort"),
}


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
