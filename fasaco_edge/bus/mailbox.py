"""Mailbox and slot between Zenoh's threads and a loop: a post costs O(1) and never blocks.

A newer item replaces the older of its kind, except where each item counts: a map update changes
the map before it, each pose adds to what the tool has passed over. Those are queued in order.
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
        """Replace whatever was there."""
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
    """Least time between two takes of a kind, so that a flood of it costs no more than that.

    Attributes:
        kind: what is held back, the newest kept; a queued kind.
        seconds: from one take of it to the next, at least [s].
        followers: kinds that depend on it, and wait where it waits.
    """

    kind: str
    seconds: float
    followers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Queue:
    """Bounds of the queue of a kind; a full queue drops its oldest, never its newest.

    Attributes:
        length: items at most.
        size: of all together at most [bytes]; one alone may be larger.
        at_once: items that one take hands out at most; the others wait for the next.
        after: a queued kind that this one must not overtake: an item waits for those of that kind
            that were posted before it.
    """

    length: int
    size: float = math.inf
    at_once: float = math.inf
    after: str = ""


class Mailbox(Generic[Item]):
    """Collects items of several kinds until the loop takes them all.

    Of a kind only the newest is kept, unless it has a queue in ``queued``; ``size_of`` returns
    the size of an item [bytes]. ``on_lost`` is called with each item that a full queue drops, on
    the thread that has posted too many.
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
        # How many of a kind have left their queue, and for which of another kind each item waits.
        self._gone = dict.fromkeys(queued, 0)
        self._waits = {kind: deque[int]() for kind, bounds in queued.items() if bounds.after}
        self._spacing = spacing
        self._free_at = float("-inf")

    def post(self, kind: str, item: Item) -> None:
        """Leave an item; safe from any thread."""
        for lost in self._post(kind, item):
            self._on_lost(lost)

    def _post(self, kind: str, item: Item) -> list[Item]:
        """Leave an item; return those that its queue drops."""
        dropped: list[Item] = []
        with self._changed:
            if kind not in self._queued:
                self._newest[kind] = item
                self._changed.notify()
                return dropped
            queue = self._queued[kind]
            # The first item that is held back wakes a waiting reader; the others need not.
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
        """Return what there is as (kind, item); wait up to ``timeout_s`` [s] for it.

        Newest-only kinds come first. What is spaced stays until its time has come, and what is
        more than a queue hands out at once until the next take.
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
            # What waits for another kind comes after it.
            for kind in sorted(ready, key=self._waits.__contains__):
                most = min(len(self._queued[kind]), self._bounds[kind].at_once)
                while most > 0 and not self._has_to_wait(kind):
                    items.append((kind, self._pop(kind)))
                    most -= 1
            if self._spacing is not None and self._spacing.kind in ready:
                self._free_at = now + self._spacing.seconds
            return items

    def hold(self) -> None:
        """Keep what is spaced, and what depends on it, until ``let_go``."""
        with self._changed:
            self._free_at = math.inf

    def let_go(self) -> None:
        """Hand out again what ``hold`` has kept."""
        with self._changed:
            self._free_at = -math.inf
            self._changed.notify()

    def take_lost(self, kind: str) -> int:
        """Return how many items of a queued kind were lost since the last call."""
        with self._changed:
            lost, self._lost[kind] = self._lost[kind], 0
            return lost

    def _pop(self, kind: str) -> Item:
        """Return the oldest item of a queued kind, which leaves its queue."""
        item = self._queued[kind].popleft()
        self._sizes[kind] -= self._size_of(item)
        self._gone[kind] += 1
        if kind in self._waits:
            self._waits[kind].popleft()
        return item

    def _has_to_wait(self, kind: str) -> bool:
        """Tell whether the oldest item of a kind must not overtake another that is still there."""
        return kind in self._waits and self._waits[kind][0] > self._gone[self._bounds[kind].after]

    def _held(self, now: float) -> tuple[str, ...]:
        """Return the kinds that have to wait."""
        spacing = self._spacing
        if spacing is None or now >= self._free_at:
            return ()
        # Alone, what depends on it is free between two of it.
        if not self._queued[spacing.kind] and self._free_at < math.inf:
            return ()
        return (spacing.kind, *spacing.followers)
