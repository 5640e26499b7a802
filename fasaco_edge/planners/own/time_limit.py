"""Time limit of a user's planner, which cannot be asked to end."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

# Time of a planner of the user's own if none is requested [s].
OWN_BUDGET_S = 60.0
# Code that catches everything is interrupted again after this time [s].
AGAIN_S = 0.1


class TookTooLongError(BaseException):
    """The time is over; no ``Exception``, which the code may catch."""


@contextmanager
def no_longer_than(most_s: float | None) -> Iterator[None]:
    """Interrupt the block after this time [s]; None for no limit.

    In other threads than the main one there is no limit, as signals reach the main thread alone;
    nor where the program has a timer of its own. A call into a library ends first.

    Raises:
        TookTooLongError: the time was over.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if most_s is None or not is_main or signal.getitimer(signal.ITIMER_REAL) != (0.0, 0.0):
        yield
        return

    is_open = True

    def interrupt(_: int, frame: FrameType | None) -> None:
        if is_open:
            raise TookTooLongError

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, most_s, AGAIN_S)
    try:
        try:
            yield
        finally:
            is_open = False
    finally:
        # Again, as the line above may be what was interrupted.
        is_open = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
