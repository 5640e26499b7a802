"""Joining a bus that may not be there yet."""

from __future__ import annotations

import logging
import threading

from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable

log = logging.getLogger(__name__)

# Retry period while nothing listens at the endpoint [s].
RETRY_S = 1.0


def join(settings: BusSettings, stop: threading.Event) -> Bus | None:
    """Open a session once a program listens there; None if ``stop`` is set before."""
    is_logged = False
    while not stop.is_set():
        try:
            return open_bus(settings)
        except BusUnavailable as error:
            if not is_logged:
                log.warning("waiting for the bus at %s: %s", ", ".join(settings.connect), error)
                is_logged = True
            stop.wait(RETRY_S)
    return None
