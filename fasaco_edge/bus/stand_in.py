"""Stand-in for a listener: this process takes over the port of a process that has ended."""

from __future__ import annotations

import contextlib
import logging
from typing import Any

import zenoh

LOG = logging.getLogger(__name__)

# Time without a listener after which the port is taken over: a process that only restarts keeps it
# [s]. Retry period if another process has taken the port over first [s].
ABSENT_S, RETRY_S = 2.0, 1.0


class StandIn:
    """Listener on the port of a process that this session was connected to.

    A session that finds its port taken connects as a client to the process that listens there. Once
    that process has ended, other sessions could no longer reach this one. So this process opens a
    second session, by ``config``, that listens there; the first one reconnects to it.
    """

    def __init__(self, config: zenoh.Config) -> None:
        self._config = config
        self._session: Any = None  # close() has no annotation
        self._try_at: float | None = None

    def poll(self, now: float, *, is_alone: bool) -> None:
        """Listen once the first session has been alone for ``ABSENT_S``; ``now``: monotonic [s]."""
        if not is_alone or self._session is not None:
            self._try_at = None
        elif self._try_at is None:
            self._try_at = now + ABSENT_S
        elif now >= self._try_at:
            self._try_at = now + RETRY_S
            with contextlib.suppress(zenoh.ZError):  # another process listens there by now
                self._session = zenoh.open(self._config)
                LOG.info("the listener here is gone: this process listens instead")

    def close(self) -> None:
        """End the session."""
        if self._session is not None:
            with contextlib.suppress(zenoh.ZError):  # it took too long
                self._session.close()
