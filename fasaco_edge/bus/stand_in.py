"""Listener in place of a process that was joined, and is gone.

A session that finds its port taken is a client of whom has it. Once that one is gone, nobody else
could reach this process: so it listens there itself, by a second session that the first finds.
"""

from __future__ import annotations

import contextlib
import logging
from typing import Any

import zenoh

LOG = logging.getLogger(__name__)

# So long nobody may have listened [s]: one that is only restarted gets its port again.
ABSENT_S = 2.0
# And so long until the next try, where another process was first [s].
RETRY_S = 1.0


class StandIn:
    """Listens where nobody does any more.

    Args:
        config: of a session that listens there.
    """

    def __init__(self, config: zenoh.Config) -> None:
        self._config = config
        self._session: Any = None  # close() has no annotation
        self._try_at: float | None = None

    def poll(self, now: float, *, is_alone: bool) -> None:
        """Listen once the first session has been alone for ``ABSENT_S``; ``now`` is steady [s]."""
        if not is_alone or self._session is not None:
            self._try_at = None
        elif self._try_at is None:
            self._try_at = now + ABSENT_S
        elif now >= self._try_at:
            self._try_at = now + RETRY_S
            with contextlib.suppress(zenoh.ZError):  # another process listens there by now
                self._session = zenoh.open(self._config)
                LOG.info("who listened here is gone: this process listens instead")

    def close(self) -> None:
        """End the session."""
        if self._session is not None:
            self._session.close()
