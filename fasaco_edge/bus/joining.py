"""Opening a session on a bus that may not be there yet."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable

LOG = logging.getLogger(__name__)

# Retry period while nothing listens at the endpoint [s].
RETRY_S = 1.0


def join(
    settings: BusSettings, stop: threading.Event, waits: Callable[[bool], None] = lambda _: None
) -> Bus | None:
    """Open a session once a process listens at the endpoint; None if ``stop`` is set before.

    ``waits`` is called before each retry; its argument is whether this is the first retry.
    """
    is_first = True
    while not stop.is_set():
        try:
            return open_bus(settings)
        except BusUnavailable as error:
            if is_first:
                there = ", ".join(settings.connect)
                LOG.warning("waiting for the bus at %s: %s", there, error, extra={"event": "bus"})
            waits(is_first)
            is_first = False
            stop.wait(RETRY_S)
    return None
