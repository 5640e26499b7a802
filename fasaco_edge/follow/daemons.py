"""Partners of a follower: the daemons of its robot, and the other followers of its base.

Only samples of the daemon that plans count. The status of another daemon, which waits or restarts
in a loop, does not prove that the planner runs, and its path is not driven. Samples of one daemon
may arrive in any order, for instance a path before the token of its claim, so the newest sample of
each kind is kept.

Of several followers of one robot, one drives. Each follower shows a token ``driver/<its Zenoh
id>/<waits, yields or drives>``. A follower that waits sends no commands, not even zeros. A session
sees its own token even where access rules hide it from others. So a second session must see the
token before the follower sends its first command.
"""

from __future__ import annotations

import json
import logging
import math
import threading
import time
from dataclasses import dataclass, replace
from typing import Any, TypeGuard

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.claim import ASK_PERIOD_S, ID, SETTLE_S, BusClaim, ClaimState
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.follow.supervision import FollowerState, Reason
from fasaco_edge.host.processes import release_unused
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_JSON_BYTES, MAX_JSON_INTEGER

# Largest number of daemons whose samples are kept; further daemons displace the oldest.
MOST_DAEMONS = 16
# Largest number of claims kept; further claims are ignored, as older claims would not arrive again.
MOST_CLAIMS = 1_000

PLANS = "plans"


@dataclass(slots=True)
class News:
    """The newest samples of a daemon.

    Attributes:
        planner: its id; "" without a daemon.
        status_at: arrival of its newest status [s]; None without a new status.
        path: its newest path; None without a new path.
        revision: revision of its newest path; 0 if unknown.
        speed_m_s: speed limit on its newest path [m/s]; infinity without a limit.
    """

    planner: str = ""
    status_at: float | None = None
    path: Sample | None = None
    revision: int = 0
    speed_m_s: float = math.inf


class Daemons:
    """Keeps the newest samples of each daemon, and returns those of the daemon that plans.

    Samples arrive on Zenoh's threads.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._planners: set[str] = set()
        self._daemons: dict[str, News] = {}

    def take_claim(self, key: str, is_there: bool) -> None:
        """Take in that the token of a claim appeared or disappeared."""
        _, _, claim = key.rpartition("/claim/")
        own, _, stand = claim.partition("/")
        # Daemons ignore malformed tokens, too.
        if stand != PLANS or not _is_id(own):
            return
        with self._lock:
            if not is_there:
                self._planners.discard(own)
            elif len(self._planners) < MOST_CLAIMS:
                self._planners.add(own)

    def take_status(self, payload: bytes, now: float) -> None:
        """Take in a status; it is ignored if it is malformed, or its daemon does not plan."""
        claim = _object(payload).get("claim")
        own = claim.get("id") if isinstance(claim, dict) and claim.get("stand") == PLANS else None
        if not _is_id(own):
            return
        with self._lock:
            self._daemon(own).status_at = now

    def take_path(self, sample: Sample) -> None:
        """Take in a path; a path that does not name its daemon is ignored."""
        attachment = _object(sample.attachment)
        own, revision = attachment.get("daemon"), attachment.get("revision")
        if not _is_id(own):
            return
        speed = attachment.get("speed_m_s")
        with self._lock:
            daemon = self._daemon(own)
            daemon.path, daemon.revision = sample, revision if _is_count(revision) else 0
            daemon.speed_m_s = speed if _is_speed(speed) else math.inf

    def news(self) -> News:
        """Return the newest samples of the daemon that plans; each status and path only once."""
        with self._lock:
            kept = self._daemons.get(self._planner) or News(self._planner)
            news = replace(kept)
            kept.status_at = kept.path = None
            return news

    @property
    def _planner(self) -> str:
        return min(self._planners, default="")

    def _daemon(self, own: str) -> News:
        """Return the kept samples of a daemon; the caller holds the lock."""
        if own not in self._daemons:
            if len(self._daemons) >= MOST_DAEMONS:
                del self._daemons[next(one for one in self._daemons if one != self._planner)]
            self._daemons[own] = News(own)
        return self._daemons[own]


def _is_id(value: object) -> TypeGuard[str]:
    return isinstance(value, str) and ID.fullmatch(value) is not None


def _is_count(value: object) -> TypeGuard[int]:
    return type(value) is int and 0 <= value <= MAX_JSON_INTEGER


def _is_speed(value: object) -> TypeGuard[float]:
    return type(value) in (int, float) and 0.0 < value < math.inf  # type: ignore[operator]


def _object(payload: bytes) -> dict[str, Any]:
    """Return a JSON object; an empty one for anything else."""
    if len(payload) > MAX_JSON_BYTES:
        return {}
    try:
        document = json.loads(payload)
    except (ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}


log = logging.getLogger(__name__)

DRIVES = "drives"
# Number of times that the second session queries the token, the pause between two queries [s], and
# the pause before the next second session [s].
LOOKS, LOOK_S, LOOK_AGAIN_S = 5, 0.2, 5.0

NO_RIGHT = "access rules keep its token from others: the role driver needs `driver/*/*`, too"


class BaseClaim(BusClaim):
    """The claim of this follower."""

    # Time within which another follower that drives sees this token; this follower must not drive
    # before.
    rejoin_s = ASK_PERIOD_S + 2.0 * SETTLE_S

    def __init__(self, bus: Bus, settings: FollowSettings) -> None:
        super().__init__(bus, Keys(settings.robot, settings.base), topics.DRIVER, DRIVES)
        self._second = BusSettings("client", settings.connect, secured=settings.secured)
        self._is_seen, self._look_at = False, -math.inf

    def standby(self, now: float) -> Reason | None:
        """Return why this follower must leave the base alone; None if it drives."""
        if self.update(now):
            self.show()
            if self.state is ClaimState.PLANS and self.rival:
                log.warning("follower %s is gone: this one drives", self.rival)
        if self.state is ClaimState.LOOKS or self.is_uncertain(now):
            return FollowerState.LOOKS, ""
        if self.state.is_waiting:
            return FollowerState.SECOND, f"Zenoh id {self.rival}; this one waits"
        if not self._is_seen and now >= self._look_at:
            self._is_seen = self._look()
            self._look_at = time.monotonic() + LOOK_AGAIN_S
        return None if self._is_seen else (FollowerState.NO_RIGHT, NO_RIGHT)

    def _look(self) -> bool:
        """Return whether a second session sees the token."""
        token = self._keys.claim(self._bus.id, "*", topics.DRIVER)
        try:
            with open_bus(self._second) as second:
                for _ in range(LOOKS):
                    if second.alive(token):
                        return True
                    time.sleep(LOOK_S)
        except BusUnavailable:
            return False
        finally:
            release_unused()
        return False
