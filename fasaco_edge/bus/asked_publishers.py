"""Schedule of queries to the publishers of a latched key.

A publisher is queried at most once a second, and never while its reply is pending; at most
MOST_PUBLISHERS of a key are queried.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

# Period of queries to a publisher for a lost last sample [s].
ASK_PERIOD_S = 1.0
# Most publishers of a key that are queried; samples of the others are still received.
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
