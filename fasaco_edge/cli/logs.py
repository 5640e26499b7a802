"""Where log lines go: to standard error, or to the journal where that is what stands behind it."""

from __future__ import annotations

import faulthandler
import logging
import sys
from types import TracebackType
from typing import Any

from fasaco_edge.cli.journal import JournalHandler, is_journal
from fasaco_edge.cli.log_limit import OneOfAKind
from fasaco_edge.errors import FasacoError
from fasaco_edge.text import lines, one_line

LOG = logging.getLogger(__name__)
# Of an error with all that is wrong with a file, or a traceback [characters].
MOST_SAID = 20_000
PLAIN, JOURNAL = "%(levelname)s %(name)s: %(message)s", "%(message)s"


class OneLine(logging.Formatter):
    """Writes an entry as one line, whatever its text holds; a traceback stands below, indented."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's name
        """Return the line."""
        return one_line(super().formatMessage(record))

    def formatException(self, ei: Any) -> str:  # noqa: ANN401, N802 - logging's names
        """Return a traceback that no line of the log can be taken for."""
        return f"    {_indented(super().formatException(ei))}"


def begin_logging(level: str) -> None:
    """Log from ``level`` on."""
    if is_journal():
        target: logging.Handler = JournalHandler()
        target.setFormatter(OneLine(JOURNAL))
        sys.excepthook = _log_uncaught
        # Where a watchdog ends a service that hangs (SIGABRT), the log shows in what.
        faulthandler.enable()
    else:
        target = logging.StreamHandler()
        target.setFormatter(OneLine(PLAIN))
    logging.basicConfig(level=level.upper(), handlers=[OneOfAKind(target)])


def say_why(error: FasacoError) -> None:
    """Say why a command has failed, and what to do."""
    if is_journal():
        text = f"{error} ({error.hint})" if error.hint else str(error)
        LOG.error("%s", text, extra={"event": "failure", "code": error.code})
        return
    # Further lines of a message stand further in than the hint: none can be taken for it.
    print("fasaco-edge:", _indented(str(error)), file=sys.stderr)
    if error.hint:
        print("  hint:", _indented(error.hint), file=sys.stderr)


def _indented(text: str) -> str:
    return lines(text, MOST_SAID).replace("\n", "\n    ")


def _log_uncaught(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    extra = {"event": "crash", "code": kind.__name__}
    LOG.critical("%s: %s", kind.__name__, error, exc_info=(kind, error, traceback), extra=extra)
