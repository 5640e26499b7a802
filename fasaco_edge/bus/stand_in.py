"""A listener that takes the place of a process whose port this session found taken."""

from __future__ import annotations

import contextlib
import logging
from typing import Any

import zenoh

LOG = logging.getLogger(__name__)

# A port without a listener for this long [s] is taken over: a process that only restarts gets its
# port back. Retry period if another process has taken it over first [s].
ABSENT_S, RETRY_S = 2.0, 1.0


class StandIn:
    """Listener that replaces a process that this session had joined and that is gone.

    A session that finds its port taken connects as a client to the process that holds it. Once that
    process is gone, no other session could reach this one: so it listens there itself, with a
    second session that the first one finds.

    Args:
        config: of a session that listens there.
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
            self._session.close()
