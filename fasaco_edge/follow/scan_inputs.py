"""Inputs of a follower that sees: scans, and the maps to compare them with, by cycle."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable
from functools import partial

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.one_publisher import OnePublisher
from fasaco_edge.bus.session import Bus
from fasaco_edge.follow.follower import Follower
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.follow.sight import Sight, SightSettings
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_SCAN_BEAMS

LOG = logging.getLogger(__name__)
# Only the newest scans count, and of maps the newest with its updates.
MOST_SCANS, MOST_UPDATES = 2, 256
# A scan has a range and an intensity for each beam, some numbers and a name.
MOST_SCAN_BYTES = 8 * MAX_SCAN_BEAMS + 1024
# A map has a byte for each pixel, and this much more.
HEADER_BYTES = 1024

MAP, UPDATE, SCAN = topics.MAP.name, topics.MAP_UPDATE.name, topics.SCAN.name


class ScanInputs:
    """Subscribes, and passes on the samples since the last cycle.

    Attributes:
        sight: takes in maps.
    """

    def __init__(self, settings: FollowSettings, bus: Bus) -> None:
        self.sight = Sight(SightSettings.of(settings.scan))
        self._most_map_bytes: int = settings.scan["most_pixels"] + HEADER_BYTES
        self._scans = deque[tuple[Sample, float]](maxlen=MOST_SCANS)
        self._maps = deque[tuple[bool, bytes]](maxlen=MOST_UPDATES)
        self._publisher = OnePublisher("scans", topics.SCAN.one_publisher_s, bus)
        self._conflict = ""
        keys = Keys(settings.robot, settings.base)
        takers: dict[str, Callable[[Sample], None]] = {
            MAP: partial(self._take_map, is_update=False),
            UPDATE: partial(self._take_map, is_update=True),
            SCAN: self._take_scan,
        }
        for topic in (topics.MAP, topics.MAP_UPDATE, topics.SCAN):
            bus.listen(keys, topic, takers[topic.name])
        for name, key, latched, depth in settings.scan["topics"]:
            in_order = name in topics.IN_ORDER
            bus.subscribe(key, takers[name], latched, depth, in_order=in_order)

    def feed(self, follower: Follower, time_of: Callable[[float], float]) -> None:
        """Pass on maps and scans.

        Args:
            follower: to whom.
            time_of: gives the time for an arrival by the computer's monotonic clock [s].
        """
        while self._maps:
            is_update, payload = self._maps.popleft()
            self.sight.take_map(payload, is_update=is_update)
        while self._scans:
            sample, came_at = self._scans.popleft()
            if self._publisher.takes(sample.sender, came_at):
                follower.take_scan(sample.payload, time_of(came_at))
        conflict = self._publisher.conflict(time.monotonic())
        if conflict and not self._conflict:
            LOG.warning("%s", conflict, extra={"event": "two_publishers"})
        self._conflict = conflict

    def _take_scan(self, sample: Sample) -> None:
        if sample.size <= MOST_SCAN_BYTES:
            self._scans.append((sample, time.monotonic()))

    def _take_map(self, sample: Sample, *, is_update: bool) -> None:
        if sample.size > self._most_map_bytes:
            return
        if not is_update:
            # A new map replaces all before it.
            self._maps.clear()
        self._maps.append((is_update, sample.payload))
