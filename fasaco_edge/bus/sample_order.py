"""Delivery order of the samples of a latched key: in order for each publisher, none twice.

Samples arrive as they are published, and as replies to queries. A reply may overtake published
samples: it has a higher priority, and samples are delivered by another thread. Samples that a reply
has overtaken are dropped as older. If ``depth`` is above 1, samples wait until the replies are
complete. After a lost sample they wait for the next reply, which may contain it.

The cache of each publisher is queried at most once a second, and not while a reply is pending. Up
to MOST_PUBLISHERS of a key are queried.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import zenoh

# Period of queries to a publisher for a lost last sample [s].
ASK_PERIOD_S = 1.0
# Largest number of publishers of a key that are queried; samples of the others are still received.
MOST_PUBLISHERS = 16
# Largest number of publishers whose last sample is remembered.
MOST_REMEMBERED = 64
# Largest size of the samples that wait for replies, in case a publisher does not reply.
HELD_BYTES = 8_000_000
_SEQUENCE_NUMBERS = 1 << 32


@dataclass(slots=True)
class AskedPublisher:
    """A publisher whose cache is queried.

    Attributes:
        name: its name in its liveliness token.
        key: key of its cache.
        ask_at: time of the next query, by the monotonic clock [s].
        is_asked: whether a reply is pending.
    """

    name: str
    key: str
    ask_at: float
    is_asked: bool = False


class AskedPublishers:
    """The existing publishers that are queried, ``open_queries`` now; the caller holds the lock."""

    def __init__(self) -> None:
        self._publishers: dict[str, AskedPublisher] = {}
        self.open_queries = 0
        # Whether to query all publishers, and whether also for samples received already.
        self._wants_all, self._wants_again = True, False

    def __contains__(self, name: str) -> bool:
        return name in self._publishers

    def __len__(self) -> int:
        return len(self._publishers)

    @property
    def is_asking(self) -> bool:
        """Whether a query is pending, or all publishers will be queried next."""
        return bool(self.open_queries or self._wants_all)

    def ask_all(self) -> None:
        """Query all publishers at the next poll, also for samples received already."""
        self._wants_all = self._wants_again = True

    def take_all(self, now: float) -> tuple[bool, bool]:
        """Return whether to query all publishers, and whether also for samples received already."""
        asks_all, again = self._wants_all, self._wants_again
        if asks_all:
            self._wants_all = self._wants_again = False
            self.open_queries += 1
            for publisher in self._publishers.values():
                publisher.ask_at = now + ASK_PERIOD_S
        return asks_all, again

    def take_due(self, now: float) -> list[AskedPublisher]:
        """Return the publishers to query now, each by its own query."""
        due = [one for one in self._publishers.values() if now >= one.ask_at and not one.is_asked]
        for publisher in due:
            publisher.ask_at, publisher.is_asked = now + ASK_PERIOD_S, True
        self.open_queries += len(due)
        return due

    def end_query(self, publisher: AskedPublisher | None) -> None:
        """Note that the query to a publisher, or to all (None), has ended."""
        self.open_queries -= 1
        if publisher is not None:
            publisher.is_asked = False

    @property
    def next_at(self) -> float:
        """Time of the next query [s, monotonic]."""
        waiting = (one.ask_at for one in self._publishers.values() if not one.is_asked)
        return min(waiting, default=float("inf"))

    def forget_others(self, names: Iterable[str]) -> list[str]:
        """Forget all publishers but ``names``; return the names forgotten."""
        gone = [name for name in self._publishers if name not in names]
        for name in gone:
            del self._publishers[name]
        return gone

    def add(self, keys: Mapping[str, str], now: float) -> list[str]:
        """Add new publishers by name, each with the key of its cache, while there is room.

        Returns their names; ``now`` is monotonic [s].
        """
        came = [name for name in keys if name not in self._publishers]
        # A pending query reaches new publishers, too, so they are not queried again at once.
        waits_s = ASK_PERIOD_S if self.is_asking else 0.0
        for name in (added := came[: MOST_PUBLISHERS - len(self._publishers)]):
            self._publishers[name] = AskedPublisher(name, keys[name], now + waits_s)
        return added


class SampleOrder:
    """Puts the last ``depth`` samples of each publisher in order; the caller holds the lock.

    ``publishers`` are queried; ``receive`` is called with each sample, in order.
    """

    def __init__(
        self, depth: int, publishers: AskedPublishers, receive: Callable[[zenoh.Sample], None]
    ) -> None:
        self._depth, self._publishers, self._receive = depth, publishers, receive
        # For each publisher its mark: the sequence number or timestamp of its last sample.
        self._last_mark = OrderedDict[str, int]()
        # When that sample was published, by the publisher's clock; 0 if unknown.
        self._stamps = OrderedDict[str, int]()
        # The marks of publishers without a token. They are used to drop replies, not published
        # samples: a publisher may have restarted with an earlier clock, which only a token shows.
        self._unconfirmed = OrderedDict[str, int]()
        # Samples that wait for replies.
        self._held: list[tuple[str, int, zenoh.Sample]] = []
        self._held_bytes = 0

    def missing(self, name: str) -> str:
        """Return the query for the samples after the last received sample of a publisher."""
        last = self._last_mark.get(name)
        if last is None or name.endswith("/uhlc"):
            return f"_max={self._depth}"
        return f"_sn={(last + 1) % _SEQUENCE_NUMBERS}.."

    def forget(self, name: str) -> None:
        """Forget a publisher that is gone: under the same name it may return and count from 0."""
        self._last_mark.pop(name, None)

    def confirm(self, name: str) -> None:
        """Note that a publisher has a token: the mark of its last sample counts from now on."""
        if name in self._unconfirmed:
            _remember(self._last_mark, name, self._unconfirmed.pop(name))

    def take_published(self, sample: zenoh.Sample) -> None:
        """Take a published sample."""
        name, mark = _origin(sample)
        last = self._last_mark.get(name)
        is_gap = name in self._publishers and _leaves_gap(name, mark, last)
        waits = self._depth > 1 and (self._publishers.is_asking or is_gap)
        is_listed = sample.source_info or name in self._last_mark or name in self._publishers
        if not name or not (is_listed or waits):
            # The publisher has no cache, or has not been found yet.
            if name:
                _remember(self._unconfirmed, name, mark)
            self._receive(sample)
            return
        if last and not mark and _ticks(sample) >= self._stamps.get(name, 0):
            # Number 0 and a newer stamp: the publisher was restarted under the same name.
            del self._last_mark[name]
            last = None
        if waits:
            self._hold(name, mark, sample)
        elif _is_newer(mark, last):
            self._deliver(name, mark, sample)

    def take_answer(self, sample: zenoh.Sample, *, again: bool) -> None:
        """Take a reply; with ``again``, deliver the last sample even if it was received already."""
        name, mark = _origin(sample)
        last = self._last_mark.get(name, self._unconfirmed.get(name))
        if self._depth > 1:
            self._hold(name, mark, sample)
        elif _is_newer(mark, last) or (again and mark == last):
            self._deliver(name, mark, sample)

    def deliver_held(self) -> None:
        """Deliver waiting samples, once all replies have arrived."""
        held, self._held = sorted(self._held, key=lambda one: one[:2]), []
        self._held_bytes = 0
        for name, mark, sample in held:
            if _is_newer(mark, self._last_mark.get(name, self._unconfirmed.get(name))):
                self._deliver(name, mark, sample)

    def _hold(self, name: str, mark: int, sample: zenoh.Sample) -> None:
        self._held.append((name, mark, sample))
        self._held_bytes += len(sample.payload)
        is_full = len(self._held) > MOST_PUBLISHERS * self._depth
        if is_full or self._held_bytes > HELD_BYTES:
            self.deliver_held()

    def _deliver(self, name: str, mark: int, sample: zenoh.Sample) -> None:
        self._unconfirmed.pop(name, None)
        _remember(self._last_mark, name, mark)
        _remember(self._stamps, name, _ticks(sample))
        self._receive(sample)


def _remember(marks: OrderedDict[str, int], name: str, mark: int) -> None:
    """Note the last mark of a publisher; drop the oldest if there are too many."""
    marks[name] = mark
    marks.move_to_end(name)
    if len(marks) > MOST_REMEMBERED:
        marks.popitem(last=False)


def _origin(sample: zenoh.Sample) -> tuple[str, int]:
    """Return the publisher of a sample, as in its token, and its sequence number or timestamp."""
    info, stamp = sample.source_info, sample.timestamp
    if info is not None:
        return f"{info.source_id.zid}/{info.source_id.eid}", int(info.source_sn)
    if stamp is not None:
        return f"{str(stamp).partition('/')[2]}/uhlc", _ticks(sample)
    return "", 0


def _ticks(sample: zenoh.Sample) -> int:
    """Return when a sample was published, by the clock of its session; 0 if unknown."""
    return int(str(sample.timestamp).partition("/")[0]) if sample.timestamp is not None else 0


def _is_newer(mark: int, last: int | None) -> bool:
    """Return whether a sample comes after the last one; sequence numbers wrap at 2^32."""
    if last is None or last >= _SEQUENCE_NUMBERS:
        return last is None or mark > last
    return 0 < (mark - last) % _SEQUENCE_NUMBERS < _SEQUENCE_NUMBERS // 2


def _leaves_gap(name: str, mark: int, last: int | None) -> bool:
    return last is not None and not name.endswith("/uhlc") and _is_newer(mark, last + 1)
