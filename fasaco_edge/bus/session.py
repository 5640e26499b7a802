"""One session on the Zenoh bus: publish, subscribe, serve, ask.

Choices that hold for every process, and why:

* no multicast scouting and no shared memory: what is reachable is what was
  configured, and the idle session stays small;
* puts drop on congestion: a frozen subscriber must never hold a planner;
* latched keys are advanced publishers with a cache of one sample, so a late
  joiner has the newest path at once (ROS calls this transient local);
* callbacks run on Zenoh's threads and only hand the sample on.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import zenoh
import zenoh.ext

from fasaco_edge.errors import BusUnavailable

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
MAX_MESSAGE_BYTES = 64 * 1024 * 1024
CDR = zenoh.Encoding.APPLICATION_CDR
JSON = zenoh.Encoding.APPLICATION_JSON


@dataclass(frozen=True, slots=True)
class BusSettings:
    """How to join the bus.

    Attributes:
        mode: "peer", "client" or "router".
        connect: endpoints to connect to.
        listen: endpoints to listen on. Where another process listens there
            already, the session joins that one instead.
    """

    mode: str = "client"
    connect: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    listen: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Sample:
    """A message as it came off the bus; ``schema`` is empty where none was sent."""

    key: str
    payload: bytes
    schema: str = ""
    attachment: bytes = b""


@dataclass(frozen=True, slots=True)
class Reply:
    """An answer to a query: a payload with its schema ("" for JSON), or an error."""

    payload: bytes
    schema: str = ""
    attachment: bytes = b""
    is_error: bool = False


class Question:
    """A query that somebody waits for an answer to; to be answered once, on any thread.

    Attributes:
        payload: what came with it, b"" for nothing.
    """

    def __init__(self, query: zenoh.Query, key: str) -> None:
        payload = query.payload
        self.payload = payload.to_bytes() if payload is not None else b""
        self._query = query
        self._key = key

    def answer(self, reply: Reply) -> None:
        """Answer; who asked may be gone by now."""
        with contextlib.suppress(zenoh.ZError):
            _send(self._query, self._key, reply)
        query: Any = self._query  # drop() has no annotation
        query.drop()


class Publisher:
    """Puts samples on one key; never blocks."""

    def __init__(self, session: zenoh.Session, key: str, schema: str, latched: bool) -> None:
        encoding = _encoding(schema)
        drop = zenoh.CongestionControl.DROP
        # An advanced publisher cannot say who listens, a plain one beside it can.
        self._plain = session.declare_publisher(key, encoding=encoding, congestion_control=drop)
        self._publisher: Any = self._plain
        if latched:
            self._publisher = zenoh.ext.declare_advanced_publisher(
                session,
                key,
                encoding=encoding,
                congestion_control=drop,
                cache=zenoh.ext.CacheConfig(max_samples=1),
                sample_miss_detection=zenoh.ext.MissDetectionConfig(
                    heartbeat=None, sporadic_heartbeat=0.5
                ),
                publisher_detection=True,
            )

    def put(self, payload: bytes, attachment: bytes = b"") -> None:
        """Send ``payload``; a subscriber too slow to take it loses it."""
        self._publisher.put(payload, attachment=attachment or None)

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


class Bus:
    """A session, with everything declared on it; close it on every way out."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._declared: list[Any] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def id(self) -> str:
        """Id of the session, which no other has."""
        return str(self._session.zid())

    def publisher(self, key: str, schema: str = "", latched: bool = False) -> Publisher:
        """Declare a publisher; ``schema`` names a CDR type, "" means JSON."""
        return Publisher(self._session, key, schema, latched)

    def subscribe(
        self,
        key: str,
        callback: Callable[[Sample], None],
        latched: bool = False,
        history: int = 1,
    ) -> Subscription:
        """Call ``callback`` with each sample on ``key``, on a Zenoh thread.

        A latched subscription receives the newest sample of latched publishers
        first, or of those of each as many as ``history``, also of those that come later.
        """

        def receive(sample: zenoh.Sample) -> None:
            callback(_sample(sample))

        def declare() -> object:
            if not latched:
                return self._session.declare_subscriber(key, receive)
            return zenoh.ext.declare_advanced_subscriber(
                self._session,
                key,
                receive,
                history=zenoh.ext.HistoryConfig(max_samples=history, detect_late_publishers=True),
                recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
                subscriber_detection=True,
            )

        subscription = Subscription(declare)
        self._declared.append(subscription)
        return subscription

    def serve(self, key: str, answer: Callable[[dict[str, str]], Reply]) -> None:
        """Answer queries on ``key``; ``answer`` gets the parameters, on a Zenoh thread."""

        def receive(query: zenoh.Query) -> None:
            _send(query, key, answer(_parameters(query)))

        self._declared.append(self._session.declare_queryable(key, receive, complete=True))

    def take_questions(self, key: str, receive: Callable[[Question], None]) -> None:
        """Call ``receive`` with each query on ``key``, on a Zenoh thread; to be answered later."""

        def take(query: zenoh.Query) -> None:
            receive(Question(query, key))

        self._declared.append(self._session.declare_queryable(key, take, complete=True))

    def get(self, selector: str, timeout_s: float = 2.0, payload: bytes = b"") -> list[Reply]:
        """Ask ``selector`` (a key, parameters behind ``?``) and return all answers.

        Args:
            selector: what to ask.
            timeout_s: how long to wait for answers [s].
            payload: JSON that goes with the question, b"" for none.
        """
        encoding = JSON if payload else None
        replies = self._session.get(
            selector, timeout=timeout_s, payload=payload or None, encoding=encoding
        )
        return [_reply(reply) for reply in replies]

    def token(self, key: str) -> None:
        """Declare a liveliness token; it vanishes with this session."""
        self._declared.append(self._session.liveliness().declare_token(key))

    def alive(self, key: str, timeout_s: float = 1.0) -> list[str]:
        """Return the keys of the liveliness tokens that match ``key`` now."""
        replies = self._session.liveliness().get(key, timeout=timeout_s)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok]

    def watch_tokens(self, key: str, callback: Callable[[str, bool], None]) -> None:
        """Call ``callback`` with the key of each liveliness token that matches ``key``, on a
        Zenoh thread: True when it appears or is there already, False when it is gone."""

        def receive(sample: zenoh.Sample) -> None:
            callback(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._declared.append(
            self._session.liveliness().declare_subscriber(key, receive, history=True)
        )

    def close(self) -> None:
        """End the session; a process that does not close it may hang at exit."""
        self._declared.clear()
        session: Any = self._session  # close() has no annotation
        session.close()


def open_bus(settings: BusSettings) -> Bus:
    """Open a session.

    Raises:
        BusUnavailable: nothing listens at the endpoints, or an address is wrong.
    """
    try:
        return Bus(zenoh.open(_config(settings.mode, settings.connect, settings.listen)))
    except zenoh.ZError as error:
        if not settings.listen or "Address already in use" not in str(error):
            raise BusUnavailable(_first_line(error)) from error
    # Someone listens there: join them, as one more client.
    try:
        return Bus(zenoh.open(_config("client", settings.connect + settings.listen, ())))
    except zenoh.ZError as error:
        raise BusUnavailable(_first_line(error)) from error


def _config(mode: str, connect: Sequence[str], listen: Sequence[str]) -> zenoh.Config:
    return zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": mode,
                "connect": {
                    "endpoints": list(connect),
                    # A client without its router fails at once; a peer keeps trying.
                    "timeout_ms": 0 if mode == "client" else -1,
                    "exit_on_failure": mode == "client",
                    "retry": {"period_init_ms": 200, "period_max_ms": 1000},
                },
                "listen": {"endpoints": list(listen)},
                "scouting": {"multicast": {"enabled": False}},
                # Advanced publishers need timestamps for their cache.
                "timestamping": {"enabled": True},
                "transport": {
                    "shared_memory": {"enabled": False},
                    "link": {"rx": {"max_message_size": MAX_MESSAGE_BYTES}},
                },
            }
        )
    )


def _parameters(query: zenoh.Query) -> dict[str, str]:
    parameters: Any = query.parameters  # no mapping by the stubs
    return {str(key): str(value) for key, value in parameters}


def _send(query: zenoh.Query, key: str, reply: Reply) -> None:
    encoding = _encoding(reply.schema)
    if reply.is_error:
        query.reply_err(reply.payload, encoding=encoding)
    else:
        attachment = reply.attachment or None
        query.reply(key, reply.payload, encoding=encoding, attachment=attachment)


def _encoding(schema: str) -> zenoh.Encoding:
    return CDR.with_schema(schema) if schema else JSON


def _schema(encoding: zenoh.Encoding) -> str:
    return str(encoding).partition(";")[2]


def _sample(sample: zenoh.Sample) -> Sample:
    attachment = sample.attachment.to_bytes() if sample.attachment is not None else b""
    return Sample(
        str(sample.key_expr), sample.payload.to_bytes(), _schema(sample.encoding), attachment
    )


def _reply(reply: zenoh.Reply) -> Reply:
    if reply.ok is not None:
        sample = _sample(reply.ok)
        return Reply(sample.payload, sample.schema, sample.attachment)
    assert reply.err is not None
    return Reply(reply.err.payload.to_bytes(), _schema(reply.err.encoding), is_error=True)


def _first_line(error: Exception) -> str:
    return str(error).partition(" at /")[0].strip()
