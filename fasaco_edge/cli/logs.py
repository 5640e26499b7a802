"""Where log lines go: to standard error, or to the journal where that is what stands behind it."""

from __future__ import annotations

import faulthandler
import logging
import sys
from types import TracebackType

from fasaco_edge.cli.journal import JournalHandler, is_journal
from fasaco_edge.cli.log_limit import OneOfAKind
from fasaco_edge.errors import FasacoError

LOG = logging.getLogger(__name__)


def begin_logging(level: str) -> None:
    """Log from ``level`` on."""
    if is_journal():
        target: logging.Handler = JournalHandler()
        sys.excepthook = _log_uncaught
        # Where a watchdog ends a service that hangs (SIGABRT), the log shows in what.
        faulthandler.enable()
    else:
        target = logging.StreamHandler()
        target.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=level.upper(), handlers=[OneOfAKind(target)])


def say_why(error: FasacoError) -> None:
    """Say why a command has failed, and what to do."""
    if is_journal():
        text = f"{error} ({error.hint})" if error.hint else str(error)
        LOG.error("%s", text, extra={"event": "failure", "code": error.code})
        return
    print(f"fasaco-edge: {error}", file=sys.stderr)
    if error.hint:
        print(f"  hint: {error.hint}", file=sys.stderr)


def _log_uncaught(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    extra = {"event": "crash", "code": kind.__name__}
    LOG.critical("%s: %s", kind.__name__, error, exc_info=(kind, error, traceback), extra=extra)
