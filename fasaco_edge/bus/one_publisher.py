"""Rule of one publisher: of several publishers of an input, the first one received counts.

Another publisher takes over once the first has been silent for ``Topic.one_publisher_s``, or its
session has ended. So a map, pose or mask does not alternate between publishers, and a restarted
program is accepted again.

A publisher is identified by the Zenoh id of its session, see ``arrival.Sample.sender``. A sample of
unknown origin always counts, but two publishers of such maps are noticed, as their maps alternate:
then the maps of one do not count.
"""

from __future__ import annotations

import zlib
from collections import deque
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from fasaco_edge.grid.occupancy import OccupancyGrid

# A second publisher is reported for at least this long after its last sample [s].
SHOWN_S = 10.0


class Sessions(Protocol):
    """The bus's view of other sessions, by their Zenoh ids."""

    def is_linked(self, session: str) -> bool:
        """Return whether ``session`` is connected to this session directly."""
        ...

    def is_relay(self, session: str) -> bool:
        """Return whether ``session`` is this one or its router: both mark samples without id."""
        ...


class OnePublisher:
    """The publisher of one input that counts; used from one thread, or under the caller's lock.

    ``name``: the input in the plural, such as "maps". After ``silent_s`` [s] of silence another
    publisher takes over.
    """

    def __init__(self, name: str, silent_s: float, sessions: Sessions) -> None:
        self._name, self._silent_s, self._sessions = name, silent_s, sessions
        # The publisher that counts, the time of its last sample [s], and whether it was connected
        # directly.
        self._first, self._received_at, self._was_linked = "", float("-inf"), False
        # The publisher refused last, the time [s], and whether its newest sample was refused.
        self._other, self._refused_at, self._misses = "", float("-inf"), False

    def takes(self, sender: str, now: float) -> bool:
        """Return whether a sample of session ``sender``, "" if unknown, counts at ``now`` [s]."""
        if sender != self._first:
            if not sender or self._sessions.is_relay(sender):
                return True
            if self._first and not self._is_over(now):
                self._other, self._refused_at, self._misses = sender, now, True
                return False
            self._count(sender)
        self._received_at, self._misses = now, False
        return True

    def takes_over(self, now: float) -> bool:
        """Return True once when a refused publisher takes over: its newest sample is missing.

        A silent publisher that is still connected counts until another one publishes.
        """
        if not self._misses or not self._is_over(now):
            return False
        if self._was_linked and self._sessions.is_linked(self._first):
            return False
        self._count(self._other)
        self._received_at, self._misses = now, False
        return True

    def refuses(self, sender: str) -> bool:
        """Return whether a publisher is the one that was refused last."""
        return bool(sender) and sender == self._other

    def conflict(self, now: float) -> str:
        """Return the conflict of two publishers in words, or ""."""
        if not self._other or now - self._refused_at > max(self._silent_s, SHOWN_S):
            return ""
        return (
            f"{self._name} come from two publishers: session {self._first} counts, "
            f"session {self._other} does not"
        )

    def _count(self, sender: str) -> None:
        if sender == self._other:
            self._other = ""
        self._first, self._was_linked = sender, self._sessions.is_linked(sender)

    def _is_over(self, now: float) -> bool:
        is_gone = self._was_linked and not self._sessions.is_linked(self._first)
        return is_gone or now - self._received_at > self._silent_s


# This many maps within PERIOD_S [s], each equal to the last but one, show two publishers. A
# door that opens and shuts is slower.
RETURNS, PERIOD_S = 3, 10.0
# Least difference of the two maps: free pixels along this length [m]. Fewer are flicker.
LEAST_WALL_M = 0.5

# Frame, geometry and checksum of the pixels; and the number of free pixels.
_Seen = tuple[tuple[object, ...], int]


class ReturningMaps:
    """Detects maps that alternate, and keeps to one of the two while that one still arrives."""

    def __init__(self) -> None:
        self._last_at = float("-inf")
        self._last: _Seen | None = None
        self._before: _Seen | None = None
        self._returned = deque[float](maxlen=RETURNS)

    def takes(self, grid: OccupancyGrid, now: float) -> bool:
        """Note a map that arrived at ``now`` [s, monotonic]; return whether it counts."""
        pixels = grid.cells.tobytes()
        seen = (grid.frame, grid.geometry, zlib.crc32(pixels)), pixels.count(0)
        last, before = self._last, self._before
        if last is None or seen == last:
            self._last, self._last_at = seen, now
            return True
        is_large = abs(seen[1] - last[1]) * grid.geometry.resolution >= LEAST_WALL_M
        if seen == before and (is_large or seen[0][1] != last[0][1]):
            self._returned.append(now)
            # Maps of two frames both count: the mission chooses the frame.
            is_same_frame = seen[0][0] == last[0][0]
            if is_same_frame and self.conflict(now) and now - self._last_at <= PERIOD_S:
                return False
        self._before, self._last, self._last_at = last, seen, now
        return True

    def conflict(self, now: float) -> str:
        """Return the text of a conflict; "" for none."""
        if len(self._returned) < RETURNS or now - self._returned[0] > PERIOD_S:
            return ""
        return "maps alternate, as from two publishers"
