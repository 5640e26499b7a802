"""Queries, their replies, and the list of liveliness tokens.

Tokens are queried and not subscribed to: a Zenoh subscriber (1.10) keeps each key that it has ever
received, and after a flood also tokens that no longer exist. While a token subscriber exists, a
query may return nothing.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zenoh

from fasaco_edge.bus.arrival import schema_of
from fasaco_edge.bus.publisher import encoding_of

# Largest number of tokens kept, in case of a flood.
MOST_TOKENS = 16_384
# Timeout of replies from routers [s]; later replies are ignored. A query that has not ended after
# twice that time is sent again [s].
ANSWER_S = 2.0
LOST_S = 2 * ANSWER_S
# Zenoh's own error for a queryable that did not reply in time.
TIMEOUT = b"Timeout"


def ask_for_tokens(
    session: zenoh.Session, key: str, most: int, end: Callable[[list[str], bool], None]
) -> bool:
    """Query the tokens that match a key; return False if the session is closed.

    ``end`` is called on a Zenoh thread within ``ANSWER_S``, with the keys of up to ``most`` tokens,
    and whether all replies were valid.
    """
    found, wrong = dict[str, None](), list[zenoh.Reply]()

    def take(reply: zenoh.Reply) -> None:
        if reply.ok is None:
            wrong.append(reply)
        elif len(found) < most:
            found[str(reply.ok.key_expr)] = None

    answered: Any = zenoh.handlers.Callback
    handler = answered(take, lambda: end(list(found), not wrong), indirect=False)
    try:
        session.liveliness().get(key, handler, timeout=ANSWER_S)
    except zenoh.ZError:
        return False
    return True


class TokenList:
    """The tokens that match a key.

    Attributes:
        version: counter of replies that changed the list, or were complete; 0 before the first.
    """

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self.version = 0
        self._session = session
        self._key = key
        self._lock = threading.Lock()
        self._there = frozenset[str]()
        self._asked_at = float("-inf")
        self._is_asking = False

    def there(self) -> frozenset[str]:
        """Return the keys of the tokens that existed at the last reply."""
        return self._there

    def ask(self, period_s: float) -> None:
        """Query the tokens if ``period_s`` [s] have passed; the reply updates the list."""
        now = time.monotonic()
        with self._lock:
            if now - self._asked_at < (LOST_S if self._is_asking else period_s):
                return
            self._is_asking, self._asked_at = True, now
        if not ask_for_tokens(self._session, self._key, MOST_TOKENS, self._take):
            with self._lock:
                self._is_asking = False

    def _take(self, found: list[str], is_whole: bool) -> None:
        with self._lock:
            self._is_asking = False
            # After an incomplete reply, further tokens may exist: known ones are kept. The first
            # reply is used even if it is incomplete, as a frozen peer may never complete it.
            there = frozenset(found)
            if not is_whole and len(there | self._there) <= MOST_TOKENS:
                there |= self._there
            if is_whole or not self.version or there != self._there:
                self._there = there
                self.version += 1


@dataclass(frozen=True, slots=True)
class QueryReply:
    """A reply to a query: a payload with its schema ("" for JSON), or an error."""

    payload: bytes
    schema: str = ""
    attachment: bytes = b""
    is_error: bool = False


@dataclass(frozen=True, slots=True)
class Shared:
    """A message that is published and kept for queries, without a copy for each use.

    A path of half a million poses takes 40 MB; each put of bytes would copy it.
    """

    payload: zenoh.ZBytes
    schema: str = ""
    attachment: bytes = b""

    @classmethod
    def of(cls, payload: bytes, schema: str = "", attachment: bytes = b"") -> Shared:
        """Return the message; this copies its payload once."""
        return cls(zenoh.ZBytes(payload), schema, attachment)


@dataclass(frozen=True, slots=True)
class Request:
    """Content of a query.

    Attributes:
        key: the key expression of the query; it may have wildcards.
        parameters: names of the parameters after ``?``, without Zenoh's own, which begin with
            ``_``.
        payload: payload of the query, or b"".
        attachment: attachment of the query, or b"".
    """

    key: str
    parameters: tuple[str, ...] = ()
    payload: bytes = b""
    attachment: bytes = b""


class Question:
    """A query that waits for its reply; it must be answered once, on any thread.

    Attributes:
        key: key of the queryable.
        request: its content.
    """

    def __init__(self, query: zenoh.Query, key: str) -> None:
        self.key = key
        self.request = request_of(query)
        self._query = query

    def answer(self, reply: QueryReply, key: str = "") -> None:
        """Reply on the queryable's key, or on ``key``; ignored if the other side is gone."""
        with contextlib.suppress(zenoh.ZError):
            send(self._query, key or self.key, reply)
        query: Any = self._query  # drop() has no annotation
        query.drop()


def matches(key: str, other: str) -> bool:
    """Return whether two key expressions intersect."""
    return bool(zenoh.KeyExpr(key).intersects(zenoh.KeyExpr(other)))


def request_of(query: zenoh.Query) -> Request:
    """Return the content of a query."""
    listed: Any = query.parameters  # the stubs declare no mapping
    own = tuple(str(name) for name, _ in listed if not str(name).startswith("_"))
    payload = query.payload.to_bytes() if query.payload is not None else b""
    beside = query.attachment.to_bytes() if query.attachment is not None else b""
    return Request(str(query.key_expr), own, payload, beside)


def size_of(query: zenoh.Query) -> int:
    """Return the size of a query [bytes]."""
    beside = sum(len(part) for part in (query.payload, query.attachment) if part is not None)
    return len(str(query.selector)) + beside


def send(query: zenoh.Query, key: str, reply: QueryReply | Shared) -> None:
    """Reply to a query on ``key``; Zenoh gives the reply the QoS of the query."""
    encoding = encoding_of(reply.schema)
    if isinstance(reply, QueryReply) and reply.is_error:
        query.reply_err(reply.payload, encoding=encoding)
        return
    attachment = reply.attachment or None
    query.reply(key, reply.payload, encoding=encoding, attachment=attachment)


def reply_of(reply: zenoh.Reply) -> QueryReply:
    """Return a reply received by Zenoh."""
    if reply.ok is not None:
        sample = reply.ok
        attachment = sample.attachment.to_bytes() if sample.attachment is not None else b""
        return QueryReply(sample.payload.to_bytes(), schema_of(sample.encoding), attachment)
    assert reply.err is not None
    return QueryReply(reply.err.payload.to_bytes(), schema_of(reply.err.encoding), is_error=True)
