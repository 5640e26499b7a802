"""The daemons of one robot, as a follower receives them: claims, statuses and paths, by Zenoh id.

Only samples of the daemon that plans count: the status of another one, which waits or restarts in a
loop, is no sign of life of the planner, and its path is not driven. Samples of one daemon may
arrive in any order, a path before the token of its claim, so the newest of each is kept.
"""

from __future__ import annotations

import json
import threading
from dataclasses import dataclass
from typing import Any, TypeGuard

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.claim import ID
from fasaco_edge.wire.limits import MAX_JSON_BYTES, MAX_JSON_INTEGER

# Most daemons whose samples are kept; beyond that the samples of the oldest daemon are dropped.
MOST_DAEMONS = 16
# Most claims that are kept; further ones are ignored. A claim dropped in their place would not be
# sent again.
MOST_CLAIMS = 1_000

PLANS = "plans"


@dataclass(slots=True)
class News:
    """Samples that arrived from the daemon that plans since the last call.

    Attributes:
        planner: its id; "" if none plans.
        status_at: arrival of its newest status [s]; None without a new one.
        path: its newest path; None without a new one.
        revision: of the newest path; 0 if unknown.
        unnamed: newest path that names no daemon; None without a new one.
    """

    planner: str
    status_at: float | None = None
    path: Sample | None = None
    revision: int = 0
    unnamed: Sample | None = None


@dataclass(slots=True)
class _Daemon:
    """The newest samples of a daemon."""

    status_at: float | None = None
    state: str = ""
    path: Sample | None = None
    revision: int = 0


class Daemons:
    """Keeps the newest samples of each daemon, and returns those of the one that plans.

    Samples come on Zenoh's threads.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._planners: set[str] = set()
        self._daemons: dict[str, _Daemon] = {}
        self._unnamed: Sample | None = None

    def take_claim(self, key: str, is_there: bool) -> None:
        """Take in that the token of a claim appeared or is gone."""
        _, _, claim = key.rpartition("/claim/")
        own, _, stand = claim.partition("/")
        # The daemons ignore other tokens, too.
        if stand != PLANS or not _is_id(own):
            return
        with self._lock:
            if not is_there:
                self._planners.discard(own)
            elif len(self._planners) < MOST_CLAIMS:
                self._planners.add(own)

    def take_status(self, payload: bytes, now: float) -> None:
        """Take in a status; one that is malformed, or whose daemon does not plan, is ignored."""
        document = _object(payload)
        claim = document.get("claim")
        own = claim.get("id") if isinstance(claim, dict) and claim.get("stand") == PLANS else None
        if not _is_id(own):
            return
        state = document.get("state")
        with self._lock:
            daemon = self._daemon(own)
            daemon.status_at, daemon.state = now, state if isinstance(state, str) else ""

    def take_path(self, sample: Sample) -> None:
        """Take in a path."""
        attachment = _object(sample.attachment)
        own, revision = attachment.get("daemon"), attachment.get("revision")
        with self._lock:
            if _is_id(own):
                daemon = self._daemon(own)
                daemon.path, daemon.revision = sample, revision if _is_count(revision) else 0
            else:
                self._unnamed = sample

    def news(self) -> News:
        """Return the new samples of the daemon that plans; each sample once."""
        with self._lock:
            news = News(min(self._planners, default=""), unnamed=self._unnamed)
            self._unnamed = None
            if (daemon := self._daemons.get(news.planner)) is not None:
                news.status_at, daemon.status_at = daemon.status_at, None
                news.path, daemon.path = daemon.path, None
                news.revision = daemon.revision
            return news

    @property
    def state(self) -> str:
        """The state of the daemon that plans, by its newest status; "" for none."""
        with self._lock:
            daemon = self._daemons.get(min(self._planners, default=""))
            return "" if daemon is None else daemon.state

    def _daemon(self, own: str) -> _Daemon:
        """Return the kept samples of a daemon; the caller holds the lock."""
        if own not in self._daemons:
            planner = min(self._planners, default="")
            others = [one for one in self._daemons if one != planner]
            if len(self._daemons) >= MOST_DAEMONS:
                del self._daemons[others[0]]
            self._daemons[own] = _Daemon()
        return self._daemons[own]


def _is_id(value: object) -> TypeGuard[str]:
    return isinstance(value, str) and ID.fullmatch(value) is not None


def _is_count(value: object) -> TypeGuard[int]:
    return type(value) is int and 0 <= value <= MAX_JSON_INTEGER


def _object(payload: bytes) -> dict[str, Any]:
    """Return a JSON object; an empty one for anything else."""
    if len(payload) > MAX_JSON_BYTES:
        return {}
    try:
        document = json.loads(payload)
    except (ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}
