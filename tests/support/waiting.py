"""Waiting for a condition, and periodic work meanwhile."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

Found = TypeVar("Found")


def until(
    holds: Callable[[], Found],
    timeout_s: float = 150.0,
    why: Callable[[], object] = lambda: "the condition was not met in time",
) -> Found:
    """Return the first true result of ``holds``; fail with ``why()`` after ``timeout_s`` [s]."""
    ends = time.monotonic() + timeout_s
    while not (found := holds()):
        assert time.monotonic() < ends, why()
        time.sleep(0.02)
    return found


@contextmanager
def meanwhile(work: Callable[[], object], every_s: float) -> Iterator[None]:
    """Repeat ``work`` every ``every_s`` [s] on a separate thread during the block."""
    over = threading.Event()

    def go_on() -> None:
        while not over.wait(every_s):
            work()

    thread = threading.Thread(target=go_on)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
