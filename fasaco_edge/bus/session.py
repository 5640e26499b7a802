"""Session on the Zenoh bus: publishers, subscribers, queryables, queries.

Latched topics have advanced publishers with a cache of one sample, so that a late joiner gets the
newest path at once (ROS calls this transient local). Callbacks run on Zenoh's threads, and only
pass the sample on.
"""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import zenoh

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.latched import Asker, LatchedSubscription, Subscription
from fasaco_edge.bus.publisher import JSON, Publisher
from fasaco_edge.bus.queries import (
    TIMEOUT,
    QueryReply,
    Question,
    Request,
    Shared,
    TokenList,
    reply_of,
    request_of,
    send,
    size_of,
)
from fasaco_edge.bus.settings import BusSettings, session_config, unavailable
from fasaco_edge.bus.stand_in import StandIn
from fasaco_edge.errors import BusUnavailable
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topic_types import VOLATILE, Qos, Topic
from fasaco_edge.wire.topics import IN_ORDER

LOG = logging.getLogger(__name__)
Answerer = Callable[[Request], QueryReply | Shared | None]

# Timeout for closing a session [s]: if a peer no longer reads, Zenoh would wait ten seconds.
CLOSE_S = 1.2
# Retry period while nothing listens at the endpoint [s].
RETRY_S = 1.0


@dataclass(slots=True)
class _Served:
    """A queryable: replies to queries on a key."""

    key: str
    receive: Callable[[zenoh.Query], None]
    complete: bool
    declared: Any


class Bus:
    """A session with everything declared on it; close it on every exit."""

    def __init__(
        self, session: zenoh.Session, listens: bool = False, stand_in: StandIn | None = None
    ) -> None:
        self._session = session
        self._stand_in = stand_in
        self._listens = listens
        self._declared: list[Any] = []
        self._served: list[_Served] = []
        # Zenoh objects that callers hold, too. ``close`` releases them: the interpreter's last
        # garbage collection may deadlock with Zenoh's threads.
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
        """Return the sessions that this session is connected to, like "a router" or "3 peers"."""
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
        in_order = topic.name in IN_ORDER
        return self.subscribe(keys.of(topic), callback, topic.is_latched, in_order=in_order)

    def subscribe(
        self,
        key: str,
        callback: Callable[[Sample], None],
        latched: bool = False,
        history: int = 1,
        *,
        in_order: bool = False,
    ) -> Subscription:
        """Call ``callback`` with each sample on ``key``, on a Zenoh thread.

        A latched subscription first receives the newest ``history`` samples of each latched
        publisher, also of publishers that appear later.

        By default each subscription has a thread of its own: samples of two subscriptions may be
        reordered. Subscriptions with ``in_order`` together receive samples in the order of sending,
        on the thread that reads the link; the callback must not call Zenoh, and must return soon.
        """

        def receive(sample: zenoh.Sample) -> None:
            callback(Sample.of(sample))

        subscription: Subscription
        if latched:
            subscription = LatchedSubscription(
                self._session, key, receive, history, self._asker, in_order=in_order
            )
        else:
            take = zenoh.handlers.Callback(receive, indirect=not in_order)
            subscription = Subscription(self._session.declare_subscriber(key, take))
        self._lent.append(subscription)
        return subscription

    def unsubscribe(self, subscription: Subscription) -> None:
        """End a subscription; samples already sent may still arrive."""
        self._asker.remove(subscription)
        self._lent.remove(subscription)
        subscription.end()
        subscription.release()

    def serve(self, key: str, answer: Answerer, complete: bool = True) -> None:
        """Reply to queries on ``key``, on a Zenoh thread; no reply if ``answer`` returns None.

        ``complete``: whether this queryable's reply is enough, without others.
        """

        def receive(query: zenoh.Query) -> None:
            reply = answer(request_of(query))
            if reply is not None:
                send(query, key, reply)

        self._serve(key, receive, complete=complete)

    def take_questions(
        self, key: str, receive: Callable[[Question], None], most_bytes: int, too_long: QueryReply
    ) -> None:
        """Call ``receive`` with each query on ``key``, on a Zenoh thread, to be answered later.

        A query larger than ``most_bytes`` gets the reply ``too_long`` at once, as queries stay in
        memory until they are answered.
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
        """Set whether other queryables come first: then this one gets only queries sent to all."""
        for served in self._served:
            if served.complete:
                served.declared.undeclare()
                served.declared = self._session.declare_queryable(
                    served.key, served.receive, complete=not yes
                )

    def get(self, selector: str, timeout_s: float = 2.0, payload: bytes = b"") -> list[QueryReply]:
        """Query ``selector``, a key, with JSON or b"" as its payload.

        Returns all replies that arrive within ``timeout_s`` [s].
        """
        encoding = JSON if payload else None
        replies = self._session.get(
            selector, timeout=timeout_s, payload=payload or None, encoding=encoding
        )
        answers = map(reply_of, replies)
        return [reply for reply in answers if not (reply.is_error and reply.payload == TIMEOUT)]

    def ask(
        self,
        key: str,
        payload: bytes,
        beside: bytes,
        timeout_s: float,
        end: Callable[[list[QueryReply]], None],
    ) -> None:
        """Query all queryables on ``key``, as clients of ROS 2 services do.

        ``end`` is called with the replies, on a Zenoh thread, when all have arrived, or there is no
        queryable, or after ``timeout_s`` [s]; in the last case an error is among them.
        """
        replies = list[QueryReply]()
        answered: Any = zenoh.handlers.Callback
        handler = answered(
            lambda reply: replies.append(reply_of(reply)), lambda: end(replies), indirect=False
        )
        try:
            self._session.get(
                key,
                handler,
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=timeout_s,
                payload=payload,
                attachment=beside or None,
            )
        except zenoh.ZError:  # the session has ended
            end(replies)

    def token(self, key: str) -> object:
        """Declare a liveliness token and return it; it vanishes with this session."""
        token = self._session.liveliness().declare_token(key)
        self._declared.append(token)
        return token

    def withdraw(self, token: object) -> None:
        """Undeclare a token."""
        declared: Any = token
        self._declared.remove(declared)
        declared.undeclare()

    def token_list(self, key: str) -> TokenList:
        """Return the list of the liveliness tokens that match ``key``."""
        return TokenList(self._session, key)

    def is_linked(self, session: str) -> bool:
        """Return whether another session, by its id, is connected to this one directly."""
        return any(session == str(each.zid) for each in self._session.info.transports())

    def is_relay(self, session: str) -> bool:
        """Return whether an id is of this session, or of a router that it is connected to.

        Both put their ids on samples without a timestamp, whose publisher is unknown.
        """
        return session == self.id or session in map(str, self._session.info.routers_zid())

    def keep_in_touch(self, now: float) -> bool:
        """Return whether samples can arrive. To be polled; ``now`` is monotonic [s].

        If the process that listens on the shared port has ended, take the port over.
        """
        info = self._session.info
        # Other sessions can connect to a listener at any time.
        in_touch = self._listens or bool(info.routers_zid() or info.peers_zid())
        if self._stand_in is not None:
            self._stand_in.poll(now, is_alone=not in_touch)
        return in_touch

    def alive(self, key: str, timeout_s: float = 1.0) -> list[str]:
        """Return the keys of the liveliness tokens that match ``key`` now."""
        replies = self._session.liveliness().get(key, timeout=timeout_s)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok]

    def watch_tokens(self, key: str, callback: Callable[[str, bool], None]) -> None:
        """Call ``callback`` on a Zenoh thread, with the key of each liveliness token that matches
        ``key``, and whether it exists: True also for earlier tokens, False when it disappears."""

        def receive(sample: zenoh.Sample) -> None:
            callback(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        watched = self._session.liveliness().declare_subscriber(key, receive, history=True)
        self._declared.append(watched)

    def close(self) -> None:
        """End the session within ``CLOSE_S``; without this call, a process may hang at exit."""
        self._asker.close()
        self._declared.clear()
        self._served.clear()
        for lent in self._lent:
            lent.release()
        self._lent.clear()
        ending = threading.Thread(target=self._end, name="close", daemon=True)
        ending.start()
        ending.join(CLOSE_S)

    def _end(self) -> None:
        session: Any = self._session  # close() has no annotation
        with contextlib.suppress(zenoh.ZError):  # it took too long
            session.close()
        if self._stand_in is not None:
            self._stand_in.close()


def open_bus(settings: BusSettings) -> Bus:
    """Open a session.

    Raises:
        BusUnavailable: nothing listens at the endpoints, or an address is wrong.
    """
    try:
        return Bus(zenoh.open(session_config(settings)), bool(settings.listen))
    except zenoh.ZError as error:
        # A secured session connects only to endpoints configured in ``connect``.
        taken = settings.listen and "Address already in use" in str(error)
        if not taken or settings.secured:
            raise unavailable(error, settings.connect) from error
    # Another process listens there: connect to it as a client.
    joined = replace(settings, mode="client", connect=settings.connect + settings.listen, listen=())
    try:
        session = zenoh.open(session_config(joined))
    except zenoh.ZError as error:
        raise unavailable(error, joined.connect) from error
    return Bus(session, stand_in=StandIn(session_config(settings)))


def join(
    settings: BusSettings, stop: threading.Event, waits: Callable[[bool], None] = lambda _: None
) -> Bus | None:
    """Open a session once a process listens at the endpoint; None if ``stop`` is set before.

    ``waits`` is called before each retry; its argument is whether this is the first retry.
    """
    is_first = True
    while not stop.is_set():
        try:
            return open_bus(settings)
        except BusUnavailable as error:
            if is_first:
                there = ", ".join(settings.connect)
                why = str(error).removesuffix(f" to {there}")
                LOG.warning("waiting for the bus at %s: %s", there, why, extra={"event": "bus"})
            waits(is_first)
            is_first = False
            stop.wait(RETRY_S)
    return None
