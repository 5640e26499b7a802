"""Types of the rows of the table of topics, and how a topic is sent."""

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
    """Quality of service of a publisher.

    Attributes:
        priority: what goes first where a link is busy.
        reliability: whether a link that may lose what it carries sends it again.
        congestion: ``drop``: a receiver too slow loses the sample; ``block``: the sender waits
            for it.
        express: whether it is sent at once, never gathered with others into one packet.
        cache: how many samples are kept for those who join late; 0 for none.
        why: reason of what is unusual about it.
    """

    priority: Priority = "data"
    reliability: Literal["reliable", "best_effort"] = "reliable"
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
    """How many samples of a topic may wait at each receiver of this package.

    NEWEST: a newer sample replaces the one before. EVERY: as many as the receiver's memory holds;
    the recorder keeps all until it is behind, then the newest where it says NEWEST. None: that
    receiver does not subscribe.
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
        direction: as seen by the planner.
        when: what makes a sample.
        speaker: the role that publishes it.
        listeners: roles that may subscribe to it; ``bus.access`` says which include others.
        key: what follows the prefix; "" for the name. A ``*`` is a chunk that a session fills in.
        schemas: message types; none for JSON and tokens.
        json, attachment: JSON Schema of the payload, and of what comes with it; "" for none.
        qos: how it is published; None for tokens.
        rate_hz: how often at least; 0 where that is not promised.
        queues: what waits at the receivers.
        is_input: whether a replay feeds it to the mission, so that recordings hold it byte for
            byte; what the recorder alone takes is none.
        limits: what bounds it, in ``protocol/limits.yaml``.
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
        """Which limit of size holds for it, see ``bus.access.Limits``."""
        if self.qos is None:
            return "token"
        if not self.schemas:
            return "json"
        small = POSE_SCHEMAS, TWIST_SCHEMAS, (BATTERY_STATE,)
        return "pose" if self.schemas in small else "large"


@dataclass(frozen=True, slots=True)
class Query:
    """What can be asked of a daemon, as ``@rpc/<name>``.

    Attributes:
        name: name of the query.
        listeners: roles that may ask it.
        schema: message type of the answer; "" for JSON.
        json: JSON Schema of the answer; "" for none.
        payload: JSON Schema of what comes with the question; "" for none.
        parameters: what may follow ``?``.
        answered: ``at once`` with the newest sample; by the ``loop`` once it has decided.
        timeout_s: how long to wait for an answer [s].
        errors: codes of errors beside ``bad_query``.
    """

    name: str
    listeners: tuple[Role, ...]
    schema: str = ""
    json: str = ""
    payload: str = ""
    parameters: tuple[str, ...] = ()
    answered: Literal["at once", "loop"] = "at once"
    timeout_s: float = 1.0
    errors: tuple[str, ...] = ()
    speaker: Role = "robot"

    @property
    def suffix(self) -> str:
        """What its keys end with."""
        return f"@rpc/{self.name}"

    @property
    def size_class(self) -> SizeClass:
        """Which limit of size holds for its answer."""
        return "large" if self.schema else "json"


class RosRow(NamedTuple):
    """A ROS 2 topic.

    Attributes:
        name: its key under ``ros2.topics`` of the configuration.
        topic: name it has in the daemon and in recordings.
        direction: as seen by the planner.
        schemas: message types it may have.
        latched: transient local.
        depth: how many samples are kept.
    """

    name: str
    topic: str
    direction: Literal["in", "out"]
    schemas: tuple[str, ...]
    latched: bool
    depth: int
