"""Waiting for what comes in its own time, and work that goes on meanwhile."""

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
    why: Callable[[], object] = lambda: "it never came to that",
) -> Found:
    """Wait until something holds; return it. ``why`` is asked what to say if it never does."""
    ends = time.monotonic() + timeout_s
    while not (found := holds()):
        assert time.monotonic() < ends, why()
        time.sleep(0.02)
    return found


@contextmanager
def meanwhile(work: Callable[[], object], every_s: float) -> Iterator[None]:
    """Do some work again and again, on a thread of its own."""
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
