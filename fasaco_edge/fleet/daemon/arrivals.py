"""Fleet arrivals: filter and rate limit of other robots' messages, before the loop gets them.

All fleets under one ``bus.base`` publish on the same keys; other publishers can, too. Robots of
this fleet and other publishers are tracked separately, each up to a limited number.
"""

from __future__ import annotations

from collections import deque

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.errors import FasacoError, FleetError
from fasaco_edge.fleet.mission.frames import MOST_OTHERS
from fasaco_edge.wire.documents.fleet import fleet_of
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_JSON_BYTES

# Least time between two messages of a robot [s].
LEAST_SPACING_S = 0.2
# A robot silent for this long makes room for another [s].
FORGOTTEN_S = 60.0


class FleetArrivals:
    """Filter and rate limits by key; runs on a Zenoh thread.

    Args:
        keys: of this robot.
        fleet: name of its fleet.
    """

    def __init__(self, keys: Keys, fleet: str) -> None:
        self._keys, self._fleet = keys, fleet
        # Time of each key's last message [s], oldest first: robots of this fleet; other publishers.
        self._received_at: dict[str, float] = {}
        self._strange_at: dict[str, float] = {}
        # The loop gets some messages whose fleet is unreadable, to report the fault: time of the
        # last [s].
        self._unreadable_at = float("-inf")
        self._has_refused = False
        self._faults = deque[FasacoError](maxlen=1)

    def is_due(self, sample: Sample, now: float) -> bool:
        """Return whether the loop gets a message; ``now`` is monotonic time [s]."""
        key, spaced = sample.key, now - LEAST_SPACING_S
        if self._keys.robot_of(key) in ("", self._keys.robot):
            return False
        if max(_time(self._received_at, key), _time(self._strange_at, key)) > spaced:
            return False
        fleet = fleet_of(sample.payload) if sample.size <= MAX_JSON_BYTES else None
        is_mate = fleet == self._fleet
        if key in self._received_at and (is_mate or fleet is None):
            _note(self._received_at, key, now)
            return True
        if is_mate:
            return self._has_place(key, now)
        if len(self._strange_at) >= MOST_OTHERS and key not in self._strange_at:
            del self._strange_at[next(iter(self._strange_at))]
        _note(self._strange_at, key, now)
        if fleet is not None or self._unreadable_at > spaced:
            return False
        self._unreadable_at = now
        return True

    def take_faults(self) -> list[FasacoError]:
        """Return the faults since the last call; on the loop's thread."""
        return [self._faults.popleft() for _ in range(len(self._faults))]

    def _has_place(self, key: str, now: float) -> bool:
        """Track another robot of this fleet if there is a free place; return whether there is."""
        if len(self._received_at) >= MOST_OTHERS:
            oldest = next(iter(self._received_at))
            if now - self._received_at[oldest] < FORGOTTEN_S:
                if not self._has_refused:
                    self._has_refused = True
                    text = f"at most {MOST_OTHERS} others of fleet {self._fleet!r} are kept"
                    self._faults.append(FleetError(f"{self._keys.robot_of(key)}: {text}"))
                return False
            del self._received_at[oldest]
        self._strange_at.pop(key, None)
        self._has_refused = False
        _note(self._received_at, key, now)
        return True


def _time(times: dict[str, float], key: str) -> float:
    return times.get(key, float("-inf"))


def _note(times: dict[str, float], key: str, now: float) -> None:
    times.pop(key, None)
    times[key] = now
