"""Between Zenoh's threads and a loop: a post costs O(1) and never blocks.

What is newer makes the older of its kind worthless, except where each item
counts: a map update patches the map before it, a pose tells what the tool
passed over. Those stay in order.
"""

from __future__ import annotations

import threading
from collections import deque
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


class Mailbox(Generic[Item]):
    """Collects items of several kinds until the loop takes them all.

    Of a kind only the newest is kept, unless it was declared ``queued`` with the
    length of its queue; a full queue loses its oldest.
    """

    def __init__(self, queued: dict[str, int]) -> None:
        self._changed = threading.Condition()
        self._newest: dict[str, Item] = {}
        self._queued = {kind: deque[Item](maxlen=length) for kind, length in queued.items()}
        self._lost = dict.fromkeys(queued, 0)

    def post(self, kind: str, item: Item) -> None:
        """Leave an item; safe from any thread."""
        with self._changed:
            if kind not in self._queued:
                self._newest[kind] = item
            else:
                queue = self._queued[kind]
                self._lost[kind] += len(queue) == queue.maxlen
                queue.append(item)
            self._changed.notify()

    def take(self, timeout_s: float) -> list[tuple[str, Item]]:
        """Return everything there is as (kind, item); wait up to ``timeout_s`` [s] for it.

        Newest-only kinds come first, so that a full map precedes its patches.
        """
        with self._changed:
            if not self._newest and not any(self._queued.values()):
                self._changed.wait(timeout_s)
            items = list(self._newest.items())
            self._newest = {}
            for kind, queue in self._queued.items():
                items.extend((kind, item) for item in queue)
                queue.clear()
            return items

    def take_lost(self, kind: str) -> int:
        """Return how many items of a queued kind were lost since the last call."""
        with self._changed:
            lost, self._lost[kind] = self._lost[kind], 0
            return lost
