"""Signal handling: a signal asks a process to end in order, with what it has done so far."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

PARENT_PERIOD_S = 0.5


def call_on(*numbers: int, call: Callable[[], None]) -> Callable[[], None]:
    """Call ``call`` on each of these signals; return what restores the handlers before.

    Only the main thread may handle signals: in any other this changes nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        return lambda: None

    def handler(_number: int, _frame: FrameType | None) -> None:
        call()

    before = {number: signal.signal(number, handler) for number in numbers}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    return restore


@contextmanager
def stop_event(*numbers: int) -> Iterator[threading.Event]:
    """Yield an event that these signals set, SIGTERM and SIGINT by default."""
    stop = threading.Event()
    restore = call_on(*(numbers or (signal.SIGTERM, signal.SIGINT)), call=stop.set)
    try:
        yield stop
    finally:
        restore()


@contextmanager
def ctrl_c_asks(ask: Callable[[], None]) -> Iterator[None]:
    """Call ``ask`` on the first Ctrl-C; a second one has its usual effect."""

    def once() -> None:
        restore()
        ask()

    restore = call_on(signal.SIGINT, call=once)
    try:
        yield
    finally:
        restore()


def end_with_parent(parent: int) -> None:
    """Send this process SIGTERM once its parent, process ``parent``, is gone."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_PERIOD_S)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()
