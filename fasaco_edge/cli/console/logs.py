"""Logging to standard error, which may be the systemd journal.

Lines are rate-limited: one of each kind in ten seconds, with the number of suppressed lines. In the
journal each line begins with its priority, see sd-daemon(3).
"""

from __future__ import annotations

import faulthandler
import logging
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from fasaco_edge.errors import DocumentError, FasacoError
from fasaco_edge.text import lines, one_line

PERIOD_S = 10.0


@dataclass(slots=True)
class _Kind:
    until: float
    left_out: int = 0
    last: logging.LogRecord | None = None


class RateLimiter(logging.Handler):
    """Passes one line of each kind in ten seconds to another handler.

    The kind of a line is its event, code and state (``extra``) if it has an event, else its text.
    After the ten seconds, the next line of the kind has the number of suppressed lines. If a line
    of another kind comes first, the last suppressed line is passed on, with that number.
    """

    def __init__(
        self, target: logging.Handler, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__()
        self._target = target
        self._clock = clock
        self._kinds: dict[object, _Kind] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Pass a line on, or count it."""
        now = self._clock()
        kind = _kind_of(record)
        known = self._kinds.get(kind)
        if known is not None and now < known.until:
            known.left_out += 1
            known.last = record
            return
        self._kinds[kind] = _Kind(now + PERIOD_S)
        if known is not None:
            _add_count(record, known.left_out)
        self._target.handle(record)
        self._report_others(now)

    def close(self) -> None:
        """Report suppressed lines, and close the target."""
        self._report_others(float("inf"))
        self._target.close()
        super().close()

    def _report_others(self, now: float) -> None:
        for kind, known in list(self._kinds.items()):
            if now < known.until:
                continue
            del self._kinds[kind]
            if known.last is not None:
                # The line that is passed on begins another ten seconds.
                self._kinds[kind] = _Kind(now + PERIOD_S)
                _add_count(known.last, known.left_out - 1)
                self._target.handle(known.last)


def _kind_of(record: logging.LogRecord) -> object:
    event = getattr(record, "event", None)
    if event is None:
        return record.getMessage()
    return event, getattr(record, "code", None), getattr(record, "state", None)


def _add_count(record: logging.LogRecord, left_out: int) -> None:
    if left_out:
        record.msg, record.args = f"{record.getMessage()} (and {left_out} more like it)", ()


LOG = logging.getLogger(__name__)
# Longest message, such as all faults of a file, or a traceback [characters].
MOST_CHARACTERS = 20_000
# Log level and syslog(3) priority: critical, error, warning, info, debug.
PRIORITIES = ((50, 2), (40, 3), (30, 4), (20, 6), (0, 7))


def is_journal() -> bool:
    """Return whether standard error is the journal."""
    try:
        there = os.fstat(sys.stderr.fileno())
    except (OSError, ValueError):
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{there.st_dev}:{there.st_ino}"


class OneLine(logging.Formatter):
    """Formats an entry as one line; an indented traceback may follow."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's name
        """Return the line."""
        return one_line(super().formatMessage(record))

    def formatException(self, ei: Any) -> str:  # noqa: ANN401, N802 - logging's names
        """Return an indented traceback, so that no line looks like an entry."""
        return f"    {_indented(super().formatException(ei))}"


class JournalLine(OneLine):
    """Formats an entry with the priority before each line."""

    def format(self, record: logging.LogRecord) -> str:
        """Return an entry, with its traceback."""
        priority = next(number for level, number in PRIORITIES if record.levelno >= level)
        return "\n".join(f"<{priority}>{line}" for line in super().format(record).splitlines())


def begin_logging(level: str) -> None:
    """Set up logging of entries of ``level`` and above."""
    target = logging.StreamHandler()
    if is_journal():
        target.setFormatter(JournalLine("%(message)s"))
        sys.excepthook = _log_uncaught
        # Logs a traceback when the watchdog ends a hanging service by SIGABRT.
        faulthandler.enable()
    else:
        target.setFormatter(OneLine("%(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=level.upper(), handlers=[RateLimiter(target)])


def report_error(error: FasacoError) -> None:
    """Print or log why a command fails, for a document all its faults, with the hints."""
    rest = error.rest if isinstance(error, DocumentError) else ()
    if is_journal():
        for fault in (error, *rest):
            text = f"{fault} ({fault.hint})" if fault.hint else str(fault)
            LOG.error("%s", text, extra={"event": "failure", "code": fault.code})
        return
    # Further lines of a message are indented more than the hint, so that none looks like a hint.
    print("fasaco-edge:", _indented("\n".join(map(str, (error, *rest)))), file=sys.stderr)
    for hint in filter(None, dict.fromkeys(fault.hint for fault in (error, *rest))):
        print("  hint:", _indented(hint), file=sys.stderr)


def _indented(text: str) -> str:
    return lines(text, MOST_CHARACTERS).replace("\n", "\n    ")


def _log_uncaught(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    extra = {"event": "crash", "code": kind.__name__}
    LOG.critical("%s: %s", kind.__name__, error, exc_info=(kind, error, traceback), extra=extra)
