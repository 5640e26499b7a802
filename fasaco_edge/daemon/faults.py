"""Faults: logged with their code, so that they can be counted, limited and looked for."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from fasaco_edge.errors import FasacoError, NotPublished

LOG = logging.getLogger(__name__)

# Of what fails again and again one is logged in so long [s].
PERIOD_S = 10.0
# So many wait to be counted at most.
MOST_FAULTS = 100


def log_fault(log: logging.Logger, fault: FasacoError) -> str:
    """Log a fault; return its text."""
    text = fault_text(fault)
    log.warning("%s", text, extra={"event": "fault", "code": fault.code})
    return text


def fault_text(fault: FasacoError) -> str:
    """Return a fault with what to do."""
    return f"{fault}: {fault.hint}" if fault.hint else str(fault)


class PublishGuard:
    """Publishes what the loop sends: a failure costs that message alone.

    All failures are counted; of each topic one in ``PERIOD_S`` is logged.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._faults: list[FasacoError] = []
        self._logged_at: dict[str, float] = {}

    def attempt(self, topic: str, publish: Callable[[], None]) -> bool:
        """Make and send a message; tell whether that went well."""
        try:
            publish()
        except Exception as error:
            why = (
                str(error) if isinstance(error, FasacoError) else f"{type(error).__name__}: {error}"
            )
            fault = NotPublished(f"{topic} was not published: {why}")
            now = self._clock()
            if now - self._logged_at.get(topic, float("-inf")) >= PERIOD_S:
                self._logged_at[topic] = now
                log_fault(LOG, fault)
                if not isinstance(error, FasacoError):
                    LOG.exception("%s", topic)
            if len(self._faults) < MOST_FAULTS:
                self._faults.append(fault)
            return False
        return True

    def take_faults(self) -> list[FasacoError]:
        """Return what was not published since the last call; it is logged already."""
        faults, self._faults = self._faults, []
        return faults
