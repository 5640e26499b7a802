"""The claim on a robot's base: of several followers of one robot, one drives.

Each shows a token ``driver/<its Zenoh id>/<waits, yields or drives>``. One that waits sends
nothing, no zeros either. A session sees its own token even where access rules hide it from others:
so a second session must see the token before the first command.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable

from fasaco_edge.bus.claim import ASK_PERIOD_S, SETTLE_S, BusClaim, ClaimState
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.follow.supervision import State
from fasaco_edge.host.processes import release_unused
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys

log = logging.getLogger(__name__)

DRIVES = "drives"
# Queries of the second session for the token, their pause, and the pause after the last [s].
LOOKS, LOOK_S, LOOK_AGAIN_S = 5, 0.2, 5.0

Standby = tuple[State, str]
NO_RIGHT = "access rules keep its token from others: the role driver needs `driver/*/*`, too"


class BaseClaim(BusClaim):
    """The claim of this follower.

    Args:
        bus: its session.
        settings: the follower's.
    """

    # Another follower that drives sees this token with its next query: until then this one must not
    # drive.
    rejoin_s = ASK_PERIOD_S + 2.0 * SETTLE_S

    def __init__(self, bus: Bus, settings: FollowSettings) -> None:
        super().__init__(bus, Keys(settings.robot, settings.base), topics.DRIVER, DRIVES)
        self._is_shown = _Shown(settings, self._keys.claim(bus.id, "*", topics.DRIVER))

    def standby(self, now: float) -> Standby | None:
        """Return why this follower must leave the base alone; None if it drives.

        Args:
            now: monotonic time [s].
        """
        if self.update(now):
            self.show()
            if self.state is ClaimState.PLANS and self.rival:
                log.warning("follower %s is gone: this one drives", self.rival)
        if self.state is ClaimState.LOOKS or self.is_uncertain(now):
            return State.LOOKS, ""
        if self.state.is_waiting:
            return State.SECOND, f"Zenoh id {self.rival}; this one waits"
        if not self._is_shown(now):
            return State.NO_RIGHT, NO_RIGHT
        return None


class _Shown:
    """Whether others see a token, by the view of a second session; queried until they do."""

    def __init__(self, settings: FollowSettings, token: str) -> None:
        self._settings = BusSettings("client", settings.connect, secured=settings.secured)
        self._token = token
        self._is_shown = False
        self._look_at = -math.inf

    def __call__(self, now: float) -> bool:
        if not self._is_shown and now >= self._look_at:
            self._is_shown = self._look()
            self._look_at = time.monotonic() + LOOK_AGAIN_S
        return self._is_shown

    def _look(self) -> bool:
        try:
            with open_bus(self._settings) as other:
                found = _any_of(LOOKS, lambda: bool(other.alive(self._token)))
        except BusUnavailable:
            return False
        release_unused()
        return found


def _any_of(times: int, holds: Callable[[], bool]) -> bool:
    """Return whether a condition holds, now or at one of the next looks."""
    for _ in range(times):
        if holds():
            return True
        time.sleep(LOOK_S)
    return False
