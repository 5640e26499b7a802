"""Row types of the table of topics, and quality of service."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from fasaco_edge.wire.schemas import BATTERY_STATE, POSE_SCHEMAS, TWIST_SCHEMAS

Role = Literal["mapper", "viewer", "operator", "recorder", "driver", "robot", "fleet"]
Direction = Literal["in", "out", "out, by the recorder", "out, by the follower", "liveliness token"]
SizeClass = Literal["large", "pose", "json", "token"]
Priority = Literal[
    "real_time",
    "interactive_high",
    "interactive_low",
    "data_high",
    "data",
    "data_low",
    "background",
]

NEWEST = 1
EVERY = 0


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of a publisher; all are reliable.

    Attributes:
        priority: order of sending on a busy link.
        congestion: ``drop``: a slow receiver loses the sample; ``block``: the sender waits
            for it.
        express: whether it is sent at once, never batched with others into one packet.
        cache: number of samples kept for late joiners; 0 for none.
        why: reason for an unusual choice.
    """

    priority: Priority = "data"
    congestion: Literal["drop", "block"] = "drop"
    express: bool = False
    cache: int = 0
    why: str = ""

    @property
    def latched(self) -> bool:
        """Whether late joiners get the newest sample."""
        return self.cache > 0


VOLATILE = Qos()


class Queues(NamedTuple):
    """Queue lengths of a topic at each receiver of this package.

    NEWEST: a newer sample replaces an older one; the recorder drops samples only when it is
    behind. EVERY: limited only by the receiver's memory. None: that receiver does not subscribe.
    """

    daemon: int | None = None
    recorder: int | None = None
    watch: int | None = None


NO_QUEUES = Queues()


@dataclass(frozen=True, slots=True)
class Topic:
    """A key below the prefix of a robot, ``<base>/@v1/<robot>/``.

    Attributes:
        name: name of the row, and of the topic in recordings.
        direction: as seen by the daemon.
        when: the event that makes a sample.
        speaker: the role that publishes it.
        listeners: roles that may subscribe to it; ``bus.access`` says which include others.
        key: the part after the prefix; "" for the name. A ``*`` is a chunk filled in by a session.
        schemas: message types; none for JSON and tokens.
        json, attachment: JSON Schema of payload and attachment; "" for none.
        qos: quality of service; None for tokens.
        rate_hz: lowest rate; 0 for no promise.
        queues: queues at the receivers.
        is_input: whether a replay feeds it to the mission, so that recordings hold it byte for
            byte; topics for the recorder alone are no inputs.
        limits: names of its limits in ``protocol/limits.yaml``.
        one_publisher_s: of several publishers only the first counts, until it is silent for this
            long [s], see ``bus.one_publisher``; 0: all count.
    """

    name: str
    direction: Direction
    when: str
    speaker: Role
    listeners: tuple[Role, ...]
    key: str = ""
    schemas: tuple[str, ...] = ()
    json: str = ""
    attachment: str = ""
    qos: Qos | None = None
    rate_hz: float = 0.0
    queues: Queues = NO_QUEUES
    is_input: bool = False
    limits: tuple[str, ...] = ()
    one_publisher_s: float = 0.0

    @property
    def suffix(self) -> str:
        """What its keys end with."""
        return self.key or self.name

    @property
    def schema(self) -> str:
        """The message type its publishers in this package use; "" for JSON."""
        return self.schemas[0] if self.schemas else ""

    @property
    def is_latched(self) -> bool:
        """Whether late joiners get the newest sample."""
        return self.qos is not None and self.qos.latched

    @property
    def size_class(self) -> SizeClass:
        """Its size limit, see ``bus.access.SenderLimits``."""
        if self.qos is None:
            return "token"
        if not self.schemas:
            return "json"
        small = POSE_SCHEMAS, TWIST_SCHEMAS, (BATTERY_STATE,)
        return "pose" if self.schemas in small else "large"
