"""Under a storm of faults: one line of each kind in ten seconds, and how many were left out."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

PERIOD_S = 10.0


@dataclass(slots=True)
class _Kind:
    until: float
    left_out: int = 0
    last: logging.LogRecord | None = None


class OneOfAKind(logging.Handler):
    """Hands lines on to another handler, but of each kind only one in ten seconds.

    The kind is the event and its code, where a line has them (``extra``), else the whole text.
    What was left out is told by the next line of the kind; where none comes, by a line of its
    own, once another line is due.
    """

    def __init__(
        self, target: logging.Handler, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__()
        self._target = target
        self._clock = clock
        self._kinds: dict[object, _Kind] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Take a line."""
        now = self._clock()
        kind = _kind_of(record)
        known = self._kinds.get(kind)
        if known is not None and now < known.until:
            known.left_out += 1
            known.last = record
            return
        self._kinds[kind] = _Kind(now + PERIOD_S)
        if known is not None:
            _tell(record, known.left_out)
        self._target.handle(record)
        self._tell_others(now)

    def close(self) -> None:
        """Tell what was left out to the end."""
        self._tell_others(float("inf"))
        self._target.close()
        super().close()

    def _tell_others(self, now: float) -> None:
        for kind, known in list(self._kinds.items()):
            if now < known.until:
                continue
            del self._kinds[kind]
            if known.last is not None:
                # Of the same kind as well, so that its ten seconds begin again.
                self._kinds[kind] = _Kind(now + PERIOD_S)
                _tell(known.last, known.left_out - 1)
                self._target.handle(known.last)


def _kind_of(record: logging.LogRecord) -> object:
    event = getattr(record, "event", None)
    if event is None:
        return record.getMessage()
    return event, getattr(record, "code", None), getattr(record, "state", None)


def _tell(record: logging.LogRecord, left_out: int) -> None:
    if left_out:
        record.suppressed = left_out
        record.msg, record.args = f"{record.getMessage()} (and {left_out} more like it)", ()
