"""Time limit of a user's planner, enforced by a signal."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

# Default time limit of a planner of the user's own [s].
OWN_BUDGET_S = 60.0
# Period at which code that catches every exception is interrupted again [s].
AGAIN_S = 0.1


class TookTooLongError(BaseException):
    """The time is over. This is not an ``Exception``, which the user's code may catch."""


@contextmanager
def no_longer_than(most_s: float | None) -> Iterator[None]:
    """Interrupt the block after this time [s]; None for no limit.

    There is no limit outside the main thread, which alone gets signals, nor if the program has a
    timer of its own. A call into a compiled library is interrupted when it returns.

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
        # Set again: the signal may have interrupted the ``finally`` above.
        is_open = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
