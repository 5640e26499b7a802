"""Log lines as the journal takes them: with a priority, and fields to search for.

One datagram for each, in the native protocol, https://systemd.io/JOURNAL_NATIVE_PROTOCOL/.
"""

from __future__ import annotations

import hashlib
import logging
import os
import socket
import sys
from collections.abc import Mapping

from fasaco_edge.text import one_line

SOCKET = "/run/systemd/journal/socket"
IDENTIFIER = "fasaco-edge"
# A datagram has to fit into the socket's buffer; who says more than that, says less.
MOST_BYTES = 32_768
# A journal that hangs must not hold the loop up [s].
PATIENCE_S = 0.05
# syslog(3): critical, error, warning, info, debug.
PRIORITIES = ((50, 2), (40, 3), (30, 4), (20, 6), (0, 7))
# What a line may have besides its text, see logging's ``extra``.
EXTRA = ("event", "code", "state", "suppressed")


def is_journal(environ: Mapping[str, str] = os.environ) -> bool:
    """Tell whether standard error leads to the journal, and not where somebody has turned it."""
    try:
        there = os.fstat(sys.stderr.fileno())
    except (OSError, ValueError):
        return False
    return environ.get("JOURNAL_STREAM") == f"{there.st_dev}:{there.st_ino}"


class JournalHandler(logging.Handler):
    """Sends each line to the journal; where that is not there, to standard error."""

    def __init__(self, address: str = SOCKET) -> None:
        super().__init__()
        self._address = address
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
    """Return a line's fields. An event has an id that stays the same, from its name."""
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
    return hashlib.sha256(f"{IDENTIFIER}/{event}".encode()).hexdigest()[:32]


def encode_entry(fields: Mapping[str, str]) -> bytes:
    """Return an entry as the socket takes it.

    A value of one line stands behind "="; one of several behind its length, uint64 little endian.
    """
    parts = []
    for name, value in fields.items():
        raw = value.encode(errors="replace")[:MOST_BYTES]
        if b"\n" in raw:
            parts.append(name.encode() + b"\n" + len(raw).to_bytes(8, "little") + raw + b"\n")
        else:
            parts.append(name.encode() + b"=" + raw + b"\n")
    return b"".join(parts)
