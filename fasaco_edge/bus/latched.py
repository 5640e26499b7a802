"""Subscriber of a latched key: gets the kept samples on joining, and a lost last one afterwards.

Zenoh's advanced subscriber (1.10) does that, too, but once a second, for as long as the session
lives, it queries every publisher that there ever was, even for subscribers that were undeclared.
This one queries the publishers that exist, which it knows by their liveliness tokens: each at most
once a second, and a bounded number of them. So open queries and memory are bounded, whatever
publishers come and go.

For the same reason it queries the tokens and does not subscribe to them: each key that a subscriber
has ever received stays in the memory of its session, and of the router before it.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zenoh

from fasaco_edge.bus.queries import ask_for_tokens

# Period of queries to a publisher for a lost last sample [s].
ASK_PERIOD_S = 1.0
# So long an answer waits that leaves a gap [s]: it overtakes what is under way, as its priority is
# higher, and samples wait for a thread of their own. Where several count, since the last of those.
UNDER_WAY_S = 0.5
# Timeout of an answer [s]: a large map on a slow link takes long. No query is repeated meanwhile.
ANSWER_S = 10.0
# Most tokens that are looked at.
MOST_TOKENS = 1024
# Most publishers of a key that are queried; what others publish is received all the same.
MOST_PUBLISHERS = 16
# Most publishers whose last sample is remembered.
MOST_REMEMBERED = 64
# Most bytes of samples that wait for those before them: a publisher that does not answer must not
# fill the memory.
HELD_BYTES = 8_000_000
_SEQUENCE_NUMBERS = 1 << 32

Receive = Callable[[zenoh.Sample], None]


class Subscription:
    """A subscriber that receives no earlier samples."""

    def __init__(self, subscriber: object) -> None:
        self._subscriber = subscriber

    def ask(self) -> None:
        """Query the samples kept for late joiners: none here."""

    def end(self) -> None:
        """Receive no more; it only has to be released then."""
        subscriber: Any = self._subscriber  # undeclare() has no annotation
        subscriber.undeclare()

    def release(self) -> None:
        """Release the objects of Zenoh: a subscriber with a callback receives all the same."""
        del self._subscriber


@dataclass(slots=True)
class _Publisher:
    """A publisher that exists.

    Attributes:
        key: key of its cache.
        ask_at: time of the next query, by the monotonic clock [s].
        is_asked: whether an answer may still come.
    """

    key: str
    ask_at: float
    is_asked: bool = False


class LatchedSubscription(Subscription):
    """A subscriber that receives the last ``depth`` samples of each publisher, also of later ones.

    Samples of one publisher come in order, none twice, unless ``ask`` queries them again.
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
        self._receive = receive
        self._depth = depth
        self._asker = asker
        self._key = zenoh.KeyExpr(key)
        self._caches = f"{key}/@adv/**"
        # Reentrant: a cache of the same session answers on the thread that asks.
        self._lock = threading.RLock()
        self._publishers: dict[str, _Publisher] = {}
        # By publisher, the sequence number or timestamp of its last sample: its mark.
        self._last_mark = OrderedDict[str, int]()
        # When that was published, by the publisher's clock; 0 where it does not tell.
        self._stamps = OrderedDict[str, int]()
        # The same of publishers without a token. Used only to drop cached replies that were
        # received already: a reset of such a clock would go unnoticed.
        self._unconfirmed = OrderedDict[str, int]()
        # Of an answer that overtook what is under way: until when it waits [s], publisher, mark.
        self._ahead: tuple[float, str, int, zenoh.Sample] | None = None
        # Where several samples count, they wait for those before them, which were asked for.
        self._held: list[tuple[str, int, zenoh.Sample]] = []
        self._held_bytes = 0
        # Until when those of them wait that an answer leaves a gap before [s]; None without any.
        self._gap_until: float | None = None
        self._open = 0
        # Whether all are to be asked, and whether for what was heard already, too.
        self._wants_all, self._wants_again = True, False
        self._tokens = f"{key}/@adv/pub/**"
        self._query_tokens_at = 0.0
        self._awaits_tokens = False
        take = zenoh.handlers.Callback(self._on_sample, indirect=not in_order)
        super().__init__(session.declare_subscriber(key, take))
        asker.add(self)

    def ask(self) -> None:
        """Ask every publisher for its last samples, those heard already among them."""
        with self._lock:
            self._wants_all = self._wants_again = True
        self._asker.wake()

    def ask_who_is_due(self, now: float) -> float:
        """Ask, on the asker's thread; return when there is more to ask [s, monotonic]."""
        questions: list[tuple[str, _Publisher | None]] = []
        self._query_tokens(now)
        with self._lock:
            if self._ahead is not None and now >= self._ahead[0]:
                self._deliver_ahead()
            if self._gap_until is not None and now >= self._gap_until:
                self._deliver_held(over_gaps=True)
            asks_all, again = self._wants_all, self._wants_again
            if asks_all:
                self._wants_all = self._wants_again = False
                questions.append((f"{self._caches}?_max={self._depth}", None))
            for name, publisher in self._publishers.items():
                if asks_all:
                    # It is asked with all the others.
                    publisher.ask_at = now + ASK_PERIOD_S
                elif now >= publisher.ask_at and not publisher.is_asked:
                    publisher.ask_at, publisher.is_asked = now + ASK_PERIOD_S, True
                    # One key for all where it can be: of each Zenoh remembers something.
                    key = self._caches if len(self._publishers) == 1 else publisher.key
                    questions.append((f"{key}?{self._missing(name)}", publisher))
            self._open += len(questions)
            waiting = [p.ask_at for p in self._publishers.values() if not p.is_asked]
            ahead = [self._ahead[0]] if self._ahead is not None else []
            gaps = [self._gap_until] if self._gap_until is not None else []
            next_at = min((self._query_tokens_at, *waiting, *ahead, *gaps))
        for selector, asked in questions:
            self._put(selector, asked, again=again)
        return next_at

    def _missing(self, name: str) -> str:
        """Return what to ask a publisher for: what came after the last that was heard of it."""
        last = self._last_mark.get(name)
        if last is None or name.endswith("/uhlc"):
            return f"_max={self._depth}"
        return f"_sn={(last + 1) % _SEQUENCE_NUMBERS}.."

    def _put(self, selector: str, publisher: _Publisher | None, *, again: bool) -> None:
        def take(reply: zenoh.Reply) -> None:
            if reply.ok is not None and self._key.intersects(reply.ok.key_expr):
                self._take(reply.ok, again=again)

        def end() -> None:
            with self._lock:
                self._open -= 1
                if publisher is not None:
                    publisher.is_asked = False
                if not self._open:
                    self._deliver_held()

        with contextlib.suppress(zenoh.ZError):  # a session that ends asks nobody
            self._session.get(
                selector,
                zenoh.handlers.Callback(take, end, indirect=False),
                timeout=ANSWER_S,
                consolidation=zenoh.ConsolidationMode.NONE,
                accept_replies=zenoh.ReplyKeyExpr.ANY,
            )

    def _query_tokens(self, now: float) -> None:
        """Ask for the tokens of the publishers that are there."""
        with self._lock:
            if now < self._query_tokens_at or self._awaits_tokens:
                return
            self._query_tokens_at, self._awaits_tokens = now + ASK_PERIOD_S, True
        if not ask_for_tokens(self._session, self._tokens, MOST_TOKENS, self._on_tokens):
            self._awaits_tokens = False

    def _on_tokens(self, tokens: list[str], is_whole: bool) -> None:
        """Add the publishers of ``tokens``; where these are all, forget the others."""
        found = {"/".join(key.rpartition("/@adv/pub/")[2].split("/")[:2]): key for key in tokens}
        with self._lock:
            self._awaits_tokens = False
            for name in [name for name in self._publishers if is_whole and name not in found]:
                # One that comes back under its name may count from 0 again.
                del self._publishers[name]
                self._last_mark.pop(name, None)
            came = [name for name in found if name not in self._publishers]
            # Those that were there before answer the first question, and are not asked twice.
            waits_s = ASK_PERIOD_S if self._wants_all or self._open else 0.0
            for name in came[: MOST_PUBLISHERS - len(self._publishers)]:
                self._publishers[name] = _Publisher(found[name], time.monotonic() + waits_s)
                if name in self._unconfirmed:
                    _remember(self._last_mark, name, self._unconfirmed.pop(name))
        if came:
            self._asker.wake()

    def _on_sample(self, sample: zenoh.Sample) -> None:
        """Take what is published, on a Zenoh thread."""
        name, mark = _origin(sample)
        with self._lock:
            waits = self._depth > 1 and bool(self._open or self._wants_all)
            is_listed = sample.source_info or name in self._last_mark or name in self._publishers
            if not name or not (is_listed or waits):
                # Of a publisher that keeps nothing, or of one that is not yet found.
                if name:
                    _remember(self._unconfirmed, name, mark)
                self._receive(sample)
                return
            last = self._last_mark.get(name)
            if last and not mark and _ticks(sample) >= self._stamps.get(name, 0):
                # It was restarted under the same name: what an answer has overtaken is older.
                del self._last_mark[name]
                last = None
            is_gap = name in self._publishers and _leaves_gap(name, mark, last)
            if waits or (self._depth > 1 and is_gap):
                self._hold(name, mark, sample)
            elif _is_newer(mark, last):
                self._deliver(name, mark, sample)
                if self._gap_until is not None:
                    self._gap_until = time.monotonic() + UNDER_WAY_S

    def _take(self, sample: zenoh.Sample, *, again: bool) -> None:
        """Take an answer; ``again``: also one that was heard already, if nothing came after it."""
        name, mark = _origin(sample)
        with self._lock:
            last = self._last_mark.get(name, self._unconfirmed.get(name))
            if self._depth > 1:
                self._hold(name, mark, sample)
            elif not again and _leaves_gap(name, mark, last):
                self._let_wait(name, mark, sample)
            elif _is_newer(mark, last) or (again and mark == last):
                self._deliver(name, mark, sample)

    def _let_wait(self, name: str, mark: int, sample: zenoh.Sample) -> None:
        """Keep an answer back until what is before it has come, or has had the time to."""
        self._deliver_ahead()
        self._ahead = time.monotonic() + UNDER_WAY_S, name, mark, sample
        if len(sample.payload) > HELD_BYTES:
            self._deliver_ahead()
        self._asker.wake()

    def _deliver_ahead(self) -> None:
        ahead, self._ahead = self._ahead, None
        if ahead is not None and _is_newer(ahead[2], self._last_mark.get(ahead[1])):
            self._deliver(*ahead[1:])

    def _hold(self, name: str, mark: int, sample: zenoh.Sample) -> None:
        self._held.append((name, mark, sample))
        self._held_bytes += len(sample.payload)
        is_full = len(self._held) > MOST_PUBLISHERS * self._depth
        if is_full or self._held_bytes > HELD_BYTES:
            self._deliver_held(over_gaps=True)
        elif not self._open and self._gap_until is None and name in self._publishers:
            self._publishers[name].ask_at = 0.0
            self._asker.wake()

    def _deliver_held(self, *, over_gaps: bool = False) -> None:
        """Deliver what waits, but for what an answer leaves a gap before: a cache may hold less.

        That waits until the samples in the gap have come, or have had the time to (``over_gaps``).
        """
        held, self._held = sorted(self._held, key=lambda one: one[:2]), []
        self._held_bytes = 0
        for name, mark, sample in held:
            last = self._last_mark.get(name, self._unconfirmed.get(name))
            if not over_gaps and _leaves_gap(name, mark, last):
                self._held.append((name, mark, sample))
                self._held_bytes += len(sample.payload)
            elif _is_newer(mark, last):
                self._deliver(name, mark, sample)
        if not self._held:
            self._gap_until = None
        elif self._gap_until is None:
            self._gap_until = time.monotonic() + UNDER_WAY_S
            self._asker.wake()

    def _deliver(self, name: str, mark: int, sample: zenoh.Sample) -> None:
        self._unconfirmed.pop(name, None)
        _remember(self._last_mark, name, mark)
        _remember(self._stamps, name, _ticks(sample))
        self._receive(sample)


class Asker:
    """The thread a session's latched subscriptions ask on: Zenoh's own must not call Zenoh."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._subscriptions: list[LatchedSubscription] = []
        self._is_woken = False
        self._is_ending = False
        self._thread: threading.Thread | None = None

    def add(self, subscription: LatchedSubscription) -> None:
        """Let a subscription ask; the first starts the thread."""
        with self._changed:
            self._subscriptions.append(subscription)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="late-joiner", daemon=True)
                self._thread.start()
        self.wake()

    def remove(self, subscription: Subscription) -> None:
        """Let a subscription ask no more; one that never did is left out."""
        with self._changed:
            self._subscriptions = [one for one in self._subscriptions if one is not subscription]

    def wake(self) -> None:
        """Look at once who is to be asked; safe from any thread."""
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
                    # A moment more gathers what is due then: one wake-up for all.
                    self._changed.wait(None if waits_s == float("inf") else max(waits_s, 0.05))
                if self._is_ending:
                    return
                self._is_woken = False
                subscriptions = list(self._subscriptions)
            now = time.monotonic()
            next_at = min((one.ask_who_is_due(now) for one in subscriptions), default=float("inf"))


def _remember(marks: OrderedDict[str, int], name: str, mark: int) -> None:
    """Note the last mark of a publisher; those noted the longest ago are forgotten."""
    marks[name] = mark
    marks.move_to_end(name)
    if len(marks) > MOST_REMEMBERED:
        marks.popitem(last=False)


def _origin(sample: zenoh.Sample) -> tuple[str, int]:
    """Return who published a sample, as in its token, and its sequence number or timestamp."""
    info, stamp = sample.source_info, sample.timestamp
    if info is not None:
        return f"{info.source_id.zid}/{info.source_id.eid}", int(info.source_sn)
    if stamp is not None:
        return f"{str(stamp).partition('/')[2]}/uhlc", _ticks(sample)
    return "", 0


def _ticks(sample: zenoh.Sample) -> int:
    """Return when a sample was published, by the clock of its session; 0 where it does not tell."""
    return int(str(sample.timestamp).partition("/")[0]) if sample.timestamp is not None else 0


def _is_newer(mark: int, last: int | None) -> bool:
    """Tell whether a sample comes after the last one; sequence numbers wrap at 2^32."""
    if last is None or last >= _SEQUENCE_NUMBERS:
        return last is None or mark > last
    return 0 < (mark - last) % _SEQUENCE_NUMBERS < _SEQUENCE_NUMBERS // 2


def _leaves_gap(name: str, mark: int, last: int | None) -> bool:
    """Tell whether samples before this one are missing."""
    return last is not None and not name.endswith("/uhlc") and _is_newer(mark, last + 1)
