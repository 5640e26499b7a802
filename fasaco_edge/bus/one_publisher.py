"""Rule of one publisher: of several publishers of an input, the first one received counts.

Another one takes over once the first has been silent for a stated time (``Topic.one_publisher_s``),
or its session has ended. So a map, pose or mask does not alternate between publishers, and a
restarted program is accepted again.

A publisher is known by the Zenoh id of its session, see ``arrival.Sample.sender``. A sample of
unknown origin always counts.

Each publisher of a latched key is queried for its cache. A publisher is queried at most once a
second, and never while its reply is pending; at most MOST_PUBLISHERS of a key are queried.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

# A second publisher is reported for at least this long after its last sample [s].
SHOWN_S = 10.0


class Sessions(Protocol):
    """The bus's view of other sessions, by their Zenoh ids."""

    def is_linked(self, session: str) -> bool:
        """Return whether it is connected to this one directly."""
        ...

    def only_passes_on(self, session: str) -> bool:
        """Return whether it is this session or its router: both mark samples without an id."""
        ...


class OnePublisher:
    """The publisher of one input that counts; used from one thread, or under the caller's lock.

    Args:
        name: what it publishes, in the plural: "maps".
        silent_s: how long it may be silent before another one counts [s].
        sessions: of the bus.
    """

    def __init__(self, name: str, silent_s: float, sessions: Sessions) -> None:
        self._name, self._silent_s, self._sessions = name, silent_s, sessions
        # The publisher that counts, the time of its last sample [s], and whether it was linked
        # directly.
        self._first, self._heard_at, self._was_linked = "", float("-inf"), False
        # The publisher refused last, when, and whether its newest sample is still missing.
        self._other, self._refused_at, self._misses = "", float("-inf"), False

    def takes(self, sender: str, now: float) -> bool:
        """Return whether a sample counts.

        Args:
            sender: id of its session; "" for unknown.
            now: by the monotonic clock [s].
        """
        if sender != self._first:
            if not sender or self._sessions.only_passes_on(sender):
                return True
            if self._first and not self._is_over(now):
                self._other, self._refused_at, self._misses = sender, now, True
                return False
            self._count(sender)
        self._heard_at, self._misses = now, False
        return True

    def takes_over(self, now: float) -> bool:
        """Return True once when a refused publisher takes over: its newest sample is missing.

        A silent publisher that is still linked keeps its role until another one publishes.
        """
        if not self._misses or not self._is_over(now):
            return False
        if self._was_linked and self._sessions.is_linked(self._first):
            return False
        self._count(self._other)
        self._heard_at, self._misses = now, False
        return True

    def refuses(self, sender: str) -> bool:
        """Return whether a publisher is the one that was refused last."""
        return bool(sender) and sender == self._other

    def conflict(self, now: float) -> str:
        """Return the conflict of two publishers in words; "" for none."""
        if not self._other or now - self._refused_at > max(self._silent_s, SHOWN_S):
            return ""
        return (
            f"{self._name} come from two publishers: session {self._first} counts, "
            f"session {self._other} does not"
        )

    def _count(self, sender: str) -> None:
        if sender == self._other:
            self._other = ""
        self._first, self._was_linked = sender, self._sessions.is_linked(sender)

    def _is_over(self, now: float) -> bool:
        is_gone = self._was_linked and not self._sessions.is_linked(self._first)
        return is_gone or now - self._heard_at > self._silent_s


# Period of queries to a publisher for a lost last sample [s].
ASK_PERIOD_S = 1.0
# Limit on the publishers of a key that are queried; samples of the others are still received.
MOST_PUBLISHERS = 16


@dataclass(slots=True)
class AskedPublisher:
    """A publisher that exists.

    Attributes:
        name: as in its liveliness token.
        key: key of its cache.
        ask_at: time of the next query, by the monotonic clock [s].
        is_asked: whether a reply is pending.
    """

    name: str
    key: str
    ask_at: float
    is_asked: bool = False


class AskedPublishers:
    """The existing publishers that are queried; the caller holds the lock."""

    def __init__(self) -> None:
        self._publishers: dict[str, AskedPublisher] = {}
        self._open = 0
        # Whether to query all, and whether also for samples that were received already.
        self._wants_all, self._wants_again = True, False

    def __contains__(self, name: str) -> bool:
        return name in self._publishers

    def __len__(self) -> int:
        return len(self._publishers)

    @property
    def open_queries(self) -> int:
        """Number of pending queries."""
        return self._open

    @property
    def is_asking(self) -> bool:
        """Whether a query is pending, or all publishers are to be queried."""
        return bool(self._open or self._wants_all)

    def ask_all(self) -> None:
        """Query all at the next poll, also for samples that were received already."""
        self._wants_all = self._wants_again = True

    def ask_soon(self, name: str) -> None:
        """Query a publisher at the next poll."""
        self._publishers[name].ask_at = 0.0

    def take_all(self, now: float) -> tuple[bool, bool]:
        """Return whether to query all now, and whether also for samples received already."""
        asks_all, again = self._wants_all, self._wants_again
        if asks_all:
            self._wants_all = self._wants_again = False
            self._open += 1
            for publisher in self._publishers.values():
                publisher.ask_at = now + ASK_PERIOD_S
        return asks_all, again

    def take_due(self, now: float) -> list[AskedPublisher]:
        """Return the publishers to query now, each with a query of its own."""
        due = [one for one in self._publishers.values() if now >= one.ask_at and not one.is_asked]
        for publisher in due:
            publisher.ask_at, publisher.is_asked = now + ASK_PERIOD_S, True
        self._open += len(due)
        return due

    def end_query(self, publisher: AskedPublisher | None) -> None:
        """Note that a query has ended; None: the query to all publishers."""
        self._open -= 1
        if publisher is not None:
            publisher.is_asked = False

    @property
    def next_at(self) -> float:
        """Time of the next query [s, monotonic]."""
        waiting = (one.ask_at for one in self._publishers.values() if not one.is_asked)
        return min(waiting, default=float("inf"))

    def forget_others(self, names: Iterable[str]) -> list[str]:
        """Forget all but these; return the names forgotten."""
        gone = [name for name in self._publishers if name not in names]
        for name in gone:
            del self._publishers[name]
        return gone

    def add(self, keys: Mapping[str, str], now: float) -> list[str]:
        """Add new publishers while there is room; return their names.

        Args:
            keys: by name, the key of its cache.
            now: by the monotonic clock [s].
        """
        came = [name for name in keys if name not in self._publishers]
        # Earlier publishers reply to the first query, and are not queried twice.
        waits_s = ASK_PERIOD_S if self.is_asking else 0.0
        for name in (added := came[: MOST_PUBLISHERS - len(self._publishers)]):
            self._publishers[name] = AskedPublisher(name, keys[name], now + waits_s)
        return added
