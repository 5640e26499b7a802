"""Ctrl-C as a request: what is at work ends in order, with what it has.

End with the process that started this one, even if it was killed.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def ctrl_c_asks(ask: Callable[[], None]) -> Iterator[None]:
    """Let the first Ctrl-C ask; a second one ends the process as ever."""
    before = signal.getsignal(signal.SIGINT)

    def answer(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, before)
        ask()

    signal.signal(signal.SIGINT, answer)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


LOOK_EVERY_S = 0.5


def end_with_parent(parent: int) -> None:
    """Send this process SIGTERM once its parent, process ``parent``, is gone."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK_EVERY_S)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()
