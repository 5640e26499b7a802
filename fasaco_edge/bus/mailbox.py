"""Mailbox and slot between Zenoh's threads and a loop: a post takes O(1) and never blocks.

A newer item replaces the older item of its kind. If every item of a kind counts, the kind has a
queue: a map update changes the map before it, each pose adds to the swept floor.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

Item = TypeVar("Item")


class LatestSlot(Generic[Item]):
    """Holds the newest value; a reader waits for it."""

    def __init__(self) -> None:
        self._filled = threading.Condition()
        self._value: Item | None = None

    def put(self, value: Item) -> None:
        """Replace the value."""
        with self._filled:
            self._value = value
            self._filled.notify()

    def take(self, timeout_s: float) -> Item | None:
        """Return the value and empty the slot; None after ``timeout_s`` [s] without one."""
        with self._filled:
            if self._value is None:
                self._filled.wait(timeout_s)
            value, self._value = self._value, None
            return value


@dataclass(frozen=True, slots=True)
class Spacing:
    """Rate limit of a kind: least time between two takes, to bound the cost of a flood.

    Attributes:
        kind: the queued kind that is held back.
        seconds: least time from one take of it to the next [s].
        followers: kinds that depend on it, and wait while it waits.
    """

    kind: str
    seconds: float
    followers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Queue:
    """Bounds of the queue of a kind; a full queue drops its oldest item.

    Attributes:
        length: largest number of items.
        size: largest size of all items together [bytes]; a single item may be larger.
        at_once: largest number of items that one take returns; the others wait for the next take.
        after: a queued kind that this one must not overtake: an item waits for the items of that
            kind that were posted before it.
    """

    length: int
    size: float = math.inf
    at_once: float = math.inf
    after: str = ""


class Mailbox(Generic[Item]):
    """Collects items of several kinds until the loop takes them all.

    Only the newest item of a kind is kept, unless it has a queue in ``queued``; ``size_of``
    returns the size of an item [bytes]. ``on_lost`` is called with each item that a full queue
    drops, on the posting thread.
    """

    def __init__(
        self,
        queued: Mapping[str, Queue],
        spacing: Spacing | None = None,
        size_of: Callable[[Item], int] = lambda _: 0,
        on_lost: Callable[[Item], None] = lambda _: None,
    ) -> None:
        self._changed = threading.Condition()
        self._newest: dict[str, Item] = {}
        self._queued = {kind: deque[Item]() for kind in queued}
        self._bounds = dict(queued)
        self._sizes = dict.fromkeys(queued, 0)
        self._size_of = size_of
        self._on_lost = on_lost
        self._lost = dict.fromkeys(queued, 0)
        # Number of items of each kind that have left their queue; for each waiting item of a kind
        # with ``after``, the number of items of that other kind posted before it.
        self._gone = dict.fromkeys(queued, 0)
        self._waits = {kind: deque[int]() for kind, bounds in queued.items() if bounds.after}
        self._spacing = spacing
        self._free_at = float("-inf")

    def post(self, kind: str, item: Item) -> None:
        """Add an item; safe from any thread."""
        for lost in self._post(kind, item):
            self._on_lost(lost)

    def _post(self, kind: str, item: Item) -> list[Item]:
        """Add an item; return the items that its queue drops."""
        dropped: list[Item] = []
        with self._changed:
            if kind not in self._queued:
                self._newest[kind] = item
                self._changed.notify()
                return dropped
            queue = self._queued[kind]
            # Of items that are held back, only the first wakes a waiting reader.
            if not queue or kind not in self._held(time.monotonic()):
                self._changed.notify()
            queue.append(item)
            self._sizes[kind] += self._size_of(item)
            bounds = self._bounds[kind]
            if bounds.after:
                posted = self._gone[bounds.after] + len(self._queued[bounds.after])
                self._waits[kind].append(posted)
            while len(queue) > bounds.length or (
                len(queue) > 1 and self._sizes[kind] > bounds.size
            ):
                dropped.append(self._pop(kind))
                self._lost[kind] += 1
        return dropped

    def take(self, timeout_s: float) -> list[tuple[str, Item]]:
        """Return the available items as (kind, item); wait up to ``timeout_s`` [s] for one.

        Kinds without a queue come first. Rate-limited kinds stay until they are due; items beyond
        ``at_once`` of a queue stay until the next take.
        """
        deadline = time.monotonic() + timeout_s
        with self._changed:
            while True:
                now = time.monotonic()
                held = self._held(now)
                ready = [kind for kind in self._queued if self._queued[kind] and kind not in held]
                if self._newest or ready or now >= deadline:
                    break
                self._changed.wait((min(deadline, self._free_at) if held else deadline) - now)
            items = list(self._newest.items())
            self._newest = {}
            # Kinds that wait for another kind come after it.
            for kind in sorted(ready, key=self._waits.__contains__):
                most = min(len(self._queued[kind]), self._bounds[kind].at_once)
                while most > 0 and not self._has_to_wait(kind):
                    items.append((kind, self._pop(kind)))
                    most -= 1
            if self._spacing is not None and self._spacing.kind in ready:
                self._free_at = now + self._spacing.seconds
            return items

    def hold(self) -> None:
        """Keep rate-limited kinds and their followers until ``release``."""
        with self._changed:
            self._free_at = math.inf

    def release(self) -> None:
        """Let ``take`` return the kinds kept by ``hold`` again."""
        with self._changed:
            self._free_at = -math.inf
            self._changed.notify()

    def take_lost(self, kind: str) -> int:
        """Return the number of items of a queued kind dropped since the last call."""
        with self._changed:
            lost, self._lost[kind] = self._lost[kind], 0
            return lost

    def _pop(self, kind: str) -> Item:
        item = self._queued[kind].popleft()
        self._sizes[kind] -= self._size_of(item)
        self._gone[kind] += 1
        if kind in self._waits:
            self._waits[kind].popleft()
        return item

    def _has_to_wait(self, kind: str) -> bool:
        return kind in self._waits and self._waits[kind][0] > self._gone[self._bounds[kind].after]

    def _held(self, now: float) -> tuple[str, ...]:
        spacing = self._spacing
        if spacing is None or now >= self._free_at:
            return ()
        # Without a waiting item of the kind, its followers need not wait.
        if not self._queued[spacing.kind] and self._free_at < math.inf:
            return ()
        return (spacing.kind, *spacing.followers)
