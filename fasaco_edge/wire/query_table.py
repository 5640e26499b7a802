"""Table of queries: one row for each query to a daemon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fasaco_edge.wire import schemas
from fasaco_edge.wire.topic_types import Role, SizeClass


@dataclass(frozen=True, slots=True)
class Query:
    """A query to a daemon, ``@rpc/<name>``.

    Attributes:
        name: name of the query.
        listeners: roles that may send it.
        schema: message type of the reply; "" for JSON.
        json: JSON Schema of the reply; "" for none.
        payload: JSON Schema of the query's payload; "" for none.
        answered: ``at once``: the reply is the newest sample; ``loop``: the daemon's loop replies
            once it has decided.
        timeout_s: timeout of the reply [s].
        errors: codes of its errors, besides ``bad_query``.
    """

    name: str
    listeners: tuple[Role, ...]
    schema: str = ""
    json: str = ""
    payload: str = ""
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
        """The size limit of its reply."""
        return "large" if self.schema else "json"


QUERIES = (
    Query("path", ("viewer",), schema=schemas.PATH, errors=("not_yet",)),
    Query("status", ("viewer",), json="status.json"),
    Query("coverage", ("viewer",), schema=schemas.OCCUPANCY_GRID, errors=("not_yet",)),
    Query("pheromone", ("viewer",), schema=schemas.PHEROMONE_GRID, errors=("not_yet",)),
    Query("rooms", ("viewer",), json="rooms.json", errors=("not_yet",)),
    Query("config", ("viewer",), json="config.json"),
    Query("version", ("viewer",), json="version.json"),
    # These queries are commands.
    Query(
        "mission",
        ("operator",),
        json="reply.json",
        payload="mission.json",
        answered="loop",
        timeout_s=5.0,
        errors=("bad_order", "not_now", "would_forget", "malformed_message"),
    ),
    Query(
        "replan",
        ("operator",),
        json="replan.json",
        answered="loop",
        timeout_s=5.0,
        errors=("not_now",),
    ),
)
RPC_NAMES = tuple(query.name for query in QUERIES)
