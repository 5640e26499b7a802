"""Session on the Zenoh bus: publishers, subscribers, queryables, queries.

Choices for every process, and why:

* no multicast scouting and no shared memory: only what is configured can be reached, and the idle
  session stays small;
* each topic has its quality of service, see ``wire.topics``: what a planner publishes is dropped on
  congestion, so that a frozen subscriber never blocks it;
* latched topics have advanced publishers with a cache of one sample, so that a late joiner has the
  newest path at once (ROS calls this transient local);
* callbacks run on Zenoh's threads and only hand the sample on.
"""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import zenoh

from fasaco_edge.bus import DEFAULT_ENDPOINT
from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.latched import Asker, LatchedSubscription, Subscription
from fasaco_edge.bus.publisher import JSON, Publisher
from fasaco_edge.bus.queries import (
    Question,
    Reply,
    Request,
    Roll,
    Shared,
    reply_of,
    request_of,
    send,
    size_of,
)
from fasaco_edge.errors import BusUnavailable
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_MESSAGE_BYTES
from fasaco_edge.wire.topic_types import VOLATILE, Qos, Topic

# Timeout of the handshake of an incoming connection [ms], and how many may be pending.
ACCEPT_TIMEOUT_MS, ACCEPT_PENDING = 3000, 1000
# Longest wait for the end of a session [s]: before a listener that no longer reads, Zenoh tries for
# ten seconds to get rid of what is queued, and fails then.
CLOSE_S = 1.2
# A map or a path is many packets of 64 kB. Where two of them fill the queue, as by default, a
# computer that is busy for 50 ms drops the map; these take a megabyte, and only when there is one.
QUEUED_BATCHES = dict.fromkeys(("interactive_high", "data_high", "data", "data_low"), 16)


@dataclass(frozen=True, slots=True)
class BusSettings:
    """How to join the bus.

    Attributes:
        mode: "peer", "client" or "router".
        connect: endpoints to connect to.
        listen: endpoints to listen on. Where another process listens there
            already, the session joins that one instead, unless it is secured.
        secured: authentication and access rules, a part of Zenoh's configuration, see
            ``bus.access``. It may hold a password, and is never shown.
    """

    mode: str = "client"
    connect: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    listen: tuple[str, ...] = ()
    secured: Mapping[str, Any] = field(default_factory=dict, repr=False)


@dataclass(slots=True)
class _Served:
    """What answers queries on a key."""

    key: str
    receive: Callable[[zenoh.Query], None]
    complete: bool
    declared: Any


class Bus:
    """A session, with everything declared on it; close it on every way out."""

    def __init__(self, session: zenoh.Session, listens: bool = False) -> None:
        self._session = session
        self._listens = listens
        self._declared: list[Any] = []
        self._served: list[_Served] = []
        # Callers hold these, too. No object of Zenoh may be left to the last garbage collection, in
        # which its threads and the interpreter may deadlock.
        self._lent: list[Publisher | Subscription] = []
        self._asker = Asker()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def id(self) -> str:
        """Unique id of the session."""
        return str(self._session.zid())

    def met(self) -> list[str]:
        """Return the sessions that this one is connected to, like "a router" or "3 peers"."""
        info = self._session.info
        met = (("router", info.routers_zid()), ("peer", info.peers_zid()))
        counts = [(kind, len(ids)) for kind, ids in met if ids]
        return [f"a {kind}" if count == 1 else f"{count} {kind}s" for kind, count in counts]

    def publisher(self, key: str, schema: str = "", qos: Qos = VOLATILE) -> Publisher:
        """Declare a publisher; ``schema`` names a CDR type, "" means JSON."""
        publisher = Publisher(self._session, key, schema, qos)
        self._lent.append(publisher)
        return publisher

    def advertise(self, keys: Keys, topic: Topic) -> Publisher:
        """Declare the publisher of a topic of the contract."""
        return self.publisher(keys.of(topic), topic.schema, topic.qos or VOLATILE)

    def listen(self, keys: Keys, topic: Topic, callback: Callable[[Sample], None]) -> Subscription:
        """Subscribe to a topic of the contract, see ``subscribe``."""
        return self.subscribe(keys.of(topic), callback, topic.is_latched)

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
            callback(Sample.of(sample))

        subscription = (
            LatchedSubscription(self._session, key, receive, history, self._asker)
            if latched
            else Subscription(self._session.declare_subscriber(key, receive))
        )
        self._lent.append(subscription)
        return subscription

    def unsubscribe(self, subscription: Subscription) -> None:
        """End a subscription; what is on its way may still come."""
        self._asker.remove(subscription)
        self._lent.remove(subscription)
        subscription.end()
        subscription.release()

    def serve(
        self, key: str, answer: Callable[[Request], Reply | Shared | None], complete: bool = True
    ) -> None:
        """Answer queries on ``key``, on a Zenoh thread; None leaves one to other queryables.

        ``complete``: no other queryable has to be asked.
        """

        def receive(query: zenoh.Query) -> None:
            reply = answer(request_of(query))
            if reply is not None:
                send(query, key, reply)

        self._serve(key, receive, complete=complete)

    def take_questions(
        self, key: str, receive: Callable[[Question], None], most_bytes: int, too_long: Reply
    ) -> None:
        """Call ``receive`` with each query on ``key``, on a Zenoh thread; to be answered later.

        One of more than ``most_bytes`` is answered with ``too_long`` at once, because a query is
        held in memory until then.
        """

        def take(query: zenoh.Query) -> None:
            if size_of(query) > most_bytes:
                send(query, key, too_long)
            else:
                receive(Question(query, key))

        self._serve(key, take, complete=True)

    def _serve(self, key: str, receive: Callable[[zenoh.Query], None], *, complete: bool) -> None:
        declared = self._session.declare_queryable(key, receive, complete=complete)
        self._served.append(_Served(key, receive, complete, declared))

    def let_others_answer(self, yes: bool) -> None:
        """Answer only queries to all, while another session serves the same keys; or any query."""
        for served in self._served:
            if served.complete:
                served.declared.undeclare()
                served.declared = self._session.declare_queryable(
                    served.key, served.receive, complete=not yes
                )

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
        return [reply_of(reply) for reply in replies]

    def token(self, key: str) -> object:
        """Declare a liveliness token and return it; it vanishes with this session."""
        token = self._session.liveliness().declare_token(key)
        self._declared.append(token)
        return token

    def withdraw(self, token: object) -> None:
        """Take a token back."""
        declared: Any = token
        self._declared.remove(declared)
        declared.undeclare()

    def roll(self, key: str) -> Roll:
        """Keep account of the liveliness tokens that match ``key``."""
        return Roll(self._session, key)

    def is_in_touch(self) -> bool:
        """Tell whether samples can arrive: a session is connected, or could be at any time."""
        info = self._session.info
        return self._listens or bool(info.routers_zid() or info.peers_zid())

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
        """End the session, within ``CLOSE_S``; a process that does not may hang at its exit."""
        self._asker.close()
        self._declared.clear()
        self._served.clear()
        for lent in self._lent:
            lent.release()
        self._lent.clear()
        ending = threading.Thread(target=_end, args=(self._session,), name="close", daemon=True)
        ending.start()
        ending.join(CLOSE_S)


def _end(session: zenoh.Session) -> None:
    ending: Any = session  # close() has no annotation
    with contextlib.suppress(zenoh.ZError):  # it took too long
        ending.close()


def open_bus(settings: BusSettings) -> Bus:
    """Open a session.

    Raises:
        BusUnavailable: nothing listens at the endpoints, or an address is wrong.
    """
    try:
        return Bus(zenoh.open(session_config(settings)), bool(settings.listen))
    except zenoh.ZError as error:
        # A secured session connects only to what is configured.
        taken = settings.listen and "Address already in use" in str(error)
        if not taken or settings.secured:
            raise BusUnavailable(_first_line(error)) from error
    # Another process listens there: connect to it as a client.
    connect = settings.connect + settings.listen
    return open_bus(replace(settings, mode="client", connect=connect, listen=()))


def check_settings(settings: BusSettings) -> None:
    """Check the configuration of a session without opening it.

    Raises:
        BusUnavailable: Zenoh does not take it.
    """
    try:
        session_config(settings)
    except zenoh.ZError as error:
        raise BusUnavailable(_first_line(error)) from error


def session_config(settings: BusSettings) -> zenoh.Config:
    """Return Zenoh's configuration of a session: what all have in common, and what secures one.

    Raises:
        zenoh.ZError: it has unknown keys or impossible values.
    """
    is_client = settings.mode == "client"
    own = {
        "mode": settings.mode,
        "connect": {
            "endpoints": list(settings.connect),
            # A client without its router fails at once; a peer keeps trying.
            "timeout_ms": 0 if is_client else -1,
            "exit_on_failure": is_client,
            "retry": {"period_init_ms": 200, "period_max_ms": 1000},
        },
        "listen": {"endpoints": list(settings.listen)},
        "scouting": {"multicast": {"enabled": False}},
        # Advanced publishers need timestamps for their cache.
        "timestamping": {"enabled": True},
        "transport": {
            "shared_memory": {"enabled": False},
            # Connections without a handshake must not keep others out: by default a hundred of
            # them do, for twelve seconds.
            "unicast": {"accept_timeout": ACCEPT_TIMEOUT_MS, "accept_pending": ACCEPT_PENDING},
            "link": {
                "rx": {"max_message_size": MAX_MESSAGE_BYTES},
                "tx": {"queue": {"size": QUEUED_BATCHES}},
            },
        },
    }
    return zenoh.Config.from_json5(json.dumps(_merged(own, settings.secured)))


def _merged(own: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Return both; where both have a mapping, that of both."""
    merged = dict(own)
    for key, value in more.items():
        before = own.get(key)
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            merged[key] = _merged(before, value)
        else:
            merged[key] = value
    return merged


def _first_line(error: Exception) -> str:
    return str(error).partition(" at /")[0].strip()
