"""The claim on a robot's name: of several daemons with one name, only one plans."""

from __future__ import annotations

import logging

from fasaco_edge.bus.claim import BusClaim
from fasaco_edge.bus.session import Bus
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.status import ClaimReport
from fasaco_edge.wire.keys import Keys

LOG = logging.getLogger(__name__)


class NameClaim(BusClaim):
    """The claim of this daemon."""

    def __init__(self, bus: Bus, keys: Keys) -> None:
        super().__init__(bus, keys, topics.CLAIM)
        self._was_waiting = False

    def report(self) -> ClaimReport:
        """Return the claim's part of the status."""
        return ClaimReport(self._bus.id, str(self.state))

    @property
    def reason(self) -> str:
        """The reason to wait."""
        return f"another daemon of this name plans: Zenoh id {self.rival}"

    def update(self, now: float) -> bool:
        """Query the others; return whether the state of this daemon has changed.

        ``announce`` then replaces the token, once the previous path is withdrawn.
        """
        has_changed = super().update(now)
        if self.rival_yielded:
            LOG.warning("another daemon of this name was planning, too, and has yielded")
        return has_changed

    def announce(self) -> None:
        """Declare the token of the state, and log the state once."""
        state = self.state
        if self._was_waiting is not state.is_waiting:
            self._was_waiting = state.is_waiting
            self._bus.let_others_answer(state.is_waiting)
        self.show()
        if state.is_waiting:
            LOG.warning("%s; this one waits", self.reason, extra={"event": "name_taken"})
        elif self.rival:
            LOG.warning("%s is gone: this daemon plans", self.rival)
