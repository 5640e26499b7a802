"""Logging: to standard error, or to the systemd journal where standard error leads there.

Lines are rate-limited: one of a kind in ten seconds, with the number of suppressed lines. The
journal gets a datagram a line, with priority and fields
(https://systemd.io/JOURNAL_NATIVE_PROTOCOL/).
"""

from __future__ import annotations

import faulthandler
import logging
import os
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from fasaco_edge.errors import FasacoError
from fasaco_edge.text import lines, one_line

PERIOD_S = 10.0


@dataclass(slots=True)
class _Kind:
    until: float
    left_out: int = 0
    last: logging.LogRecord | None = None


class OneOfAKind(logging.Handler):
    """Rate limiter: passes on one line of each kind in ten seconds to another handler.

    The kind is the event and its code, if a line has them (``extra``), else the whole text.
    The next line of a kind has the number of suppressed ones; if none follows, a separate line
    has it, once another line is due.
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
                # The separate line is of the same kind, so the ten seconds begin again.
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
        record.suppressed = left_out
        record.msg, record.args = f"{record.getMessage()} (and {left_out} more like it)", ()


SOCKET = "/run/systemd/journal/socket"
IDENTIFIER = "fasaco-edge"
# A datagram has to fit into the socket's buffer; a longer value is cut.
MOST_BYTES = 32_768
# How long a journal that hangs may delay the loop [s].
PATIENCE_S = 0.05
# syslog(3): critical, error, warning, info, debug.
PRIORITIES = ((50, 2), (40, 3), (30, 4), (20, 6), (0, 7))
# What a line may have besides its text, see logging's ``extra``.
EXTRA = ("event", "code", "state", "suppressed")


def is_journal(environ: Mapping[str, str] = os.environ) -> bool:
    """Return whether standard error leads to the journal, and was not redirected."""
    try:
        there = os.fstat(sys.stderr.fileno())
    except (OSError, ValueError):
        return False
    return environ.get("JOURNAL_STREAM") == f"{there.st_dev}:{there.st_ino}"


class JournalHandler(logging.Handler):
    """Sends each line to the journal; without a journal, to standard error."""

    def __init__(self, address: str = SOCKET) -> None:
        super().__init__()
        self._address = address
        # The import takes half a megabyte, which a process without a journal does not need.
        import socket

        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        self._socket.settimeout(PATIENCE_S)

    def emit(self, record: logging.LogRecord) -> None:
        """Send a line."""
        fields = fields_of(record, self.format(record))
        try:
            self._socket.sendto(encode_entry(fields), self._address)
        except TimeoutError:
            pass  # standard error leads to the same journal
        except OSError:
            print(f"<{fields['PRIORITY']}>{fields['MESSAGE']}", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        super().close()


def fields_of(record: logging.LogRecord, message: str) -> dict[str, str]:
    """Return a line's fields; an event has a fixed id, made of its name."""
    priority = next(number for level, number in PRIORITIES if record.levelno >= level)
    fields = {
        "MESSAGE": message,
        "PRIORITY": str(priority),
        "SYSLOG_IDENTIFIER": IDENTIFIER,
        "CODE_FILE": record.pathname,
        "CODE_LINE": str(record.lineno),
        "CODE_FUNC": record.funcName or "",
        "FASACO_LOGGER": record.name,
    }
    for name in EXTRA:
        if (value := getattr(record, name, None)) is not None:
            fields[f"FASACO_{name.upper()}"] = one_line(str(value))
    if event := fields.get("FASACO_EVENT"):
        fields["MESSAGE_ID"] = message_id(event)
    return fields


def message_id(event: str) -> str:
    """Return the 128-bit id of an event, 32 hex digits."""
    import hashlib  # maps four megabytes, for the journal alone

    return hashlib.sha256(f"{IDENTIFIER}/{event}".encode()).hexdigest()[:32]


def encode_entry(fields: Mapping[str, str]) -> bytes:
    """Return an entry as the socket takes it.

    A value of one line follows "="; one of several lines its length, uint64 little endian.
    """
    parts = []
    for name, value in fields.items():
        raw = value.encode(errors="replace")[:MOST_BYTES]
        if b"\n" in raw:
            parts.append(name.encode() + b"\n" + len(raw).to_bytes(8, "little") + raw + b"\n")
        else:
            parts.append(name.encode() + b"=" + raw + b"\n")
    return b"".join(parts)


LOG = logging.getLogger(__name__)
# Longest text of a line: an error that lists all faults of a file, or a traceback [characters].
MOST_CHARACTERS = 20_000
PLAIN, JOURNAL = "%(levelname)s %(name)s: %(message)s", "%(message)s"


class OneLine(logging.Formatter):
    """Writes an entry as one line, for any text; a traceback follows, indented."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's name
        """Return the line."""
        return one_line(super().formatMessage(record))

    def formatException(self, ei: Any) -> str:  # noqa: ANN401, N802 - logging's names
        """Return a traceback none of whose lines looks like an entry of the log."""
        return f"    {_indented(super().formatException(ei))}"


def begin_logging(level: str) -> None:
    """Log from ``level`` on."""
    if is_journal():
        target: logging.Handler = JournalHandler()
        target.setFormatter(OneLine(JOURNAL))
        sys.excepthook = _log_uncaught
        # If the watchdog ends a service that hangs (SIGABRT), the log shows the place.
        faulthandler.enable()
    else:
        target = logging.StreamHandler()
        target.setFormatter(OneLine(PLAIN))
    logging.basicConfig(level=level.upper(), handlers=[OneOfAKind(target)])


def say_why(error: FasacoError) -> None:
    """Print or log the reason of a command's failure, with its hint."""
    if is_journal():
        text = f"{error} ({error.hint})" if error.hint else str(error)
        LOG.error("%s", text, extra={"event": "failure", "code": error.code})
        return
    # Further lines of a message are indented more than the hint, so that none looks like one.
    print("fasaco-edge:", _indented(str(error)), file=sys.stderr)
    if error.hint:
        print("  hint:", _indented(error.hint), file=sys.stderr)


def _indented(text: str) -> str:
    return lines(text, MOST_CHARACTERS).replace("\n", "\n    ")


def _log_uncaught(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    extra = {"event": "crash", "code": kind.__name__}
    LOG.critical("%s: %s", kind.__name__, error, exc_info=(kind, error, traceback), extra=extra)
