"""Subscriber of a latched key: gets the cached samples on joining, and recovers a lost last sample.

Zenoh's advanced subscriber (1.10) does the same, but it queries every publisher that ever existed,
once a second until the session ends, and goes on with that after the subscriber was undeclared.
This subscriber queries a bounded number of publishers that exist, found by their liveliness tokens,
each at most once a second. So open queries and memory stay bounded, whatever the number of
publishers over time. ``sample_order`` schedules the queries, and orders samples and replies.

For the same reason it queries tokens and does not subscribe to them: each key that a subscriber
has ever received stays in the memory of its session and of its router.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

import zenoh

from fasaco_edge.bus.queries import ask_for_tokens
from fasaco_edge.bus.sample_order import ASK_PERIOD_S, AskedPublisher, AskedPublishers, SampleOrder

# Timeout of a reply [s], long enough for a large map on a slow link. Until then the query is not
# repeated.
ANSWER_S = 10.0
# Largest number of tokens read.
MOST_TOKENS = 1024

Receive = Callable[[zenoh.Sample], None]


class Subscription:
    """A subscriber that receives no earlier samples."""

    def __init__(self, subscriber: object) -> None:
        self._subscriber = subscriber

    def ask(self) -> None:
        """Query the samples cached for late joiners: none here."""

    def end(self) -> None:
        """Stop receiving; afterwards only ``release`` is left to do."""
        subscriber: Any = self._subscriber  # undeclare() has no annotation
        subscriber.undeclare()

    def release(self) -> None:
        """Release the Zenoh objects: otherwise a subscriber with a callback goes on receiving."""
        del self._subscriber


class LatchedSubscription(Subscription):
    """A subscriber that first receives the last ``depth`` samples of each publisher.

    That includes publishers that appear later. Samples of one publisher are delivered in order and
    once, unless ``ask`` queries them again.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        receive: Receive,
        depth: int,
        asker: Asker,
        *,
        in_order: bool = False,
    ) -> None:
        self._session = session
        self._depth = depth
        self._asker = asker
        self._key = zenoh.KeyExpr(key)
        self._caches = f"{key}/@adv/**"
        # Reentrant: a cache of the same session replies on the querying thread.
        self._lock = threading.RLock()
        self._publishers = AskedPublishers()
        self._order = SampleOrder(depth, self._publishers, receive)
        self._tokens = f"{key}/@adv/pub/**"
        self._query_tokens_at = 0.0
        self._awaits_tokens = False
        take = zenoh.handlers.Callback(self._on_sample, indirect=not in_order)
        super().__init__(session.declare_subscriber(key, take))
        asker.add(self)

    def ask(self) -> None:
        """Query every publisher for its last samples, even if they were received already."""
        with self._lock:
            self._publishers.ask_all()
        self._asker.wake()

    def send_due(self, now: float) -> float:
        """Send due queries, on the asker's thread; return when the next is due [s, monotonic]."""
        self._query_tokens(now)
        with self._lock:
            questions: list[tuple[str, AskedPublisher | None]] = []
            asks_all, again = self._publishers.take_all(now)
            if asks_all:
                questions.append((f"{self._caches}?_max={self._depth}", None))
            for publisher in self._publishers.take_due(now):
                # A single publisher is queried by the key of all, as Zenoh remembers each key.
                key = self._caches if len(self._publishers) == 1 else publisher.key
                questions.append((f"{key}?{self._order.missing(publisher.name)}", publisher))
            next_at = min(self._query_tokens_at, self._publishers.next_at)
        for selector, asked in questions:
            self._put(selector, asked, again=again)
        return next_at

    def _put(self, selector: str, publisher: AskedPublisher | None, *, again: bool) -> None:
        def take(reply: zenoh.Reply) -> None:
            if reply.ok is not None and self._key.intersects(reply.ok.key_expr):
                self._on_answer(reply.ok, again=again)

        def end() -> None:
            with self._lock:
                self._publishers.end_query(publisher)
                if not self._publishers.open_queries:
                    self._order.deliver_held()

        with contextlib.suppress(zenoh.ZError):  # a session that ends sends no queries
            self._session.get(
                selector,
                zenoh.handlers.Callback(take, end, indirect=False),
                timeout=ANSWER_S,
                consolidation=zenoh.ConsolidationMode.NONE,
                accept_replies=zenoh.ReplyKeyExpr.ANY,
            )

    def _query_tokens(self, now: float) -> None:
        with self._lock:
            if now < self._query_tokens_at or self._awaits_tokens:
                return
            self._query_tokens_at, self._awaits_tokens = now + ASK_PERIOD_S, True
        if not ask_for_tokens(self._session, self._tokens, MOST_TOKENS, self._on_tokens):
            self._awaits_tokens = False

    def _on_tokens(self, tokens: list[str], is_whole: bool) -> None:
        """Add the publishers of ``tokens``; forget others if ``tokens`` is complete."""
        found = {"/".join(key.rpartition("/@adv/pub/")[2].split("/")[:2]): key for key in tokens}
        with self._lock:
            self._awaits_tokens = False
            gone = self._publishers.forget_others(found) if is_whole else []
            for name in gone:
                self._order.forget(name)
            if gone and not self._publishers.open_queries:
                self._order.deliver_held()  # no reply of these publishers will come
            added = self._publishers.add(found, time.monotonic())
            for name in added:
                self._order.confirm(name)
        if added:
            self._asker.wake()

    def _on_sample(self, sample: zenoh.Sample) -> None:
        """Take a published sample, on a Zenoh thread."""
        with self._lock:
            self._order.take_published(sample)

    def _on_answer(self, sample: zenoh.Sample, *, again: bool) -> None:
        """Take a reply, on a Zenoh thread."""
        with self._lock:
            self._order.take_answer(sample, again=again)


class Asker:
    """Thread that sends queries of latched subscriptions: Zenoh's threads must not call Zenoh."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._subscriptions: list[LatchedSubscription] = []
        self._is_woken = False
        self._is_ending = False
        self._thread: threading.Thread | None = None

    def add(self, subscription: LatchedSubscription) -> None:
        """Add a subscription; the first one starts the thread."""
        with self._changed:
            self._subscriptions.append(subscription)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="late-joiner", daemon=True)
                self._thread.start()
        self.wake()

    def remove(self, subscription: Subscription) -> None:
        """Remove a subscription, if it was added."""
        with self._changed:
            self._subscriptions = [one for one in self._subscriptions if one is not subscription]

    def wake(self) -> None:
        """Check at once which queries are due; safe from any thread."""
        with self._changed:
            self._is_woken = True
            self._changed.notify()

    def close(self) -> None:
        """End the thread."""
        with self._changed:
            self._is_ending = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join()
        self._subscriptions.clear()

    def _run(self) -> None:
        next_at = float("inf")
        while True:
            with self._changed:
                if not (self._is_woken or self._is_ending):
                    waits_s = next_at - time.monotonic()
                    # Waits a little, so that queries due at almost the same time are sent together.
                    self._changed.wait(None if waits_s == float("inf") else max(waits_s, 0.05))
                if self._is_ending:
                    return
                self._is_woken = False
                subscriptions = list(self._subscriptions)
            now = time.monotonic()
            next_at = min((one.send_due(now) for one in subscriptions), default=float("inf"))
