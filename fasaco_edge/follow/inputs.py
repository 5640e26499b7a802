"""Inputs of a follower in each cycle: poses, paths and heartbeats of the daemon, scans and maps."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable
from functools import partial

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.one_publisher import OnePublisher
from fasaco_edge.bus.session import Bus
from fasaco_edge.errors import FasacoError
from fasaco_edge.follow.daemons import Daemons, News
from fasaco_edge.follow.follower import Follower
from fasaco_edge.follow.settings import FollowSettings, PoseSource
from fasaco_edge.follow.sight import Mount, Sight
from fasaco_edge.follow.supervision import Supervision
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_SCAN_BEAMS
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.schemas import TF_MESSAGE

LOG = logging.getLogger(__name__)
# Largest number of poses that wait for the next cycle; further poses displace the oldest.
MOST_POSES = 256


# A simulation's time advances at most this far without a pose [s], as poses come ten times a
# second.
LEAD_S = 0.09
# After this real time without a pose [s], the simulation counts as stopped, and time goes on.
SILENT_S = 2.0
# Stamps that jump back, or forward by more than this, come from another simulation [s].
JUMP_S = 5.0


class Clock:
    """The robot's time, which is the computer's or a simulation's, and never goes back.

    A simulation runs at a multiple of real time, or slower if the computer cannot keep up. By the
    computer's time, a follower would then consider fresh poses old, and expect the robot too far
    ahead; so the time is that of the stamps of the poses.

    Args:
        pace: simulated seconds per second; 1 for the computer's time.
    """

    def __init__(self, pace: float) -> None:
        self._pace = pace
        self._stamp_ns: int | None = None
        # The simulation's time at the newest pose, and the arrival of that pose.
        self._time = self._received_at = 0.0

    def at(self, now: float) -> float:
        """Return the robot's time at a monotonic time of the computer."""
        if self._stamp_ns is None:
            return now * self._pace
        since = max(now - self._received_at, 0.0)
        lead = min(since * self._pace, LEAD_S)
        return self._time + lead + max(since - SILENT_S, 0.0) * self._pace

    def take_stamp(self, stamp_ns: int, now: float) -> float:
        """Take in the stamp of a pose that arrived at ``now``; return the robot's time then."""
        if self._pace == 1.0:
            return now
        time = self.at(now)
        if self._stamp_ns is not None:
            step = (stamp_ns - self._stamp_ns) * 1e-9
            if 0.0 <= step <= JUMP_S:
                time = max(time, self._time + step)
        self._stamp_ns, self._time, self._received_at = stamp_ns, time, now
        return time


class WatchedPublisher(OnePublisher):
    """Selects one publisher of an input, and logs a conflict of two publishers."""

    _logged = ""

    def log(self) -> None:
        """Log a conflict of two publishers once."""
        conflict = self.conflict(time.monotonic())
        if conflict and not self._logged:
            LOG.warning("%s", conflict, extra={"event": "two_publishers"})
        self._logged = conflict


class Inputs:
    """Subscribes to inputs, and passes those since the last cycle to a follower."""

    def __init__(self, settings: FollowSettings, bus: Bus) -> None:
        # What the planning daemon sent since the last cycle.
        self.news = News()
        self._clock = Clock(settings.pace)
        self._decoder = PoseDecoder(settings.pose_schema, settings.frames)
        self._poses = deque[tuple[Sample, PoseSource, float]](maxlen=MOST_POSES)
        self._publisher = WatchedPublisher("poses", topics.POSE.one_publisher_s, bus)
        self._daemons = Daemons()
        keys = Keys(settings.robot, settings.base)
        for source in settings.poses:
            bus.subscribe(source.key, self._pose_taker(source), source.latched, source.depth)
        bus.watch_tokens(keys.of(topics.CLAIM), self._daemons.take_claim)
        bus.listen(keys, topics.STATUS, self._take_status)
        bus.listen(keys, topics.PATH, self._daemons.take_path)

    def now(self) -> float:
        """Return the robot's time [s]."""
        return self.time_of(time.monotonic())

    def time_of(self, came_at: float) -> float:
        """Return the robot's time at a time of the computer's monotonic clock [s]."""
        return self._clock.at(came_at)

    def feed(self, follower: Supervision) -> None:
        """Pass the inputs to a follower."""
        news = self.news = self._daemons.news()
        follower.take_planner(news.planner)
        if news.status_at is not None:
            follower.take_heartbeat(news.status_at)
        while self._poses:
            sample, source, came_at = self._poses.popleft()
            # Each link of a chain of transforms has a publisher of its own.
            is_chained = (source.schema or sample.schema) == TF_MESSAGE
            if not is_chained and not self._publisher.takes(sample.sender, came_at):
                continue
            at = self._clock.at(came_at)
            try:
                pose = self._decoder.decode(
                    sample.payload,
                    source.schema or sample.schema,
                    is_static=source.is_static,
                    came_at=at,
                )
            except FasacoError as error:
                follower.pose_fault = error
                continue
            if pose is not None:
                follower.take_pose(pose, self._clock.take_stamp(pose.stamp_ns, came_at))
            follower.link = self._decoder.oldest_link
        self._publisher.log()
        if news.path is not None:
            follower.take_path(news.path.payload, news.speed_m_s)

    def _pose_taker(self, source: PoseSource) -> Callable[[Sample], None]:
        def take(sample: Sample) -> None:
            self._poses.append((sample, source, time.monotonic()))

        return take

    def _take_status(self, sample: Sample) -> None:
        self._daemons.take_status(sample.payload, self.now())


# Largest numbers of waiting scans, and of waiting messages of maps; further messages displace the
# oldest.
MOST_SCANS, MOST_UPDATES = 2, 256
# Largest size of a scan: a range and an intensity for each beam, and the other members.
MOST_SCAN_BYTES = 8 * MAX_SCAN_BEAMS + 1024
# Largest size of a map, without its pixels of one byte each.
HEADER_BYTES = 1024
MAP, UPDATE, SCAN = topics.MAP.name, topics.MAP_UPDATE.name, topics.SCAN.name


class ScanInputs:
    """Subscribes to scans and maps, and passes on the messages since the last cycle."""

    def __init__(self, settings: FollowSettings, bus: Bus) -> None:
        scan = settings.scan
        mount = Mount(**scan["mount"])
        self.sight = Sight(mount, settings.radius_m, scan["lost_s"], scan["free_at_most"])
        self._most_map_bytes: int = scan["most_pixels"] + HEADER_BYTES
        self._scans = deque[tuple[Sample, float]](maxlen=MOST_SCANS)
        self._maps = deque[tuple[bool, bytes]](maxlen=MOST_UPDATES)
        self._publisher = WatchedPublisher("scans", topics.SCAN.one_publisher_s, bus)
        keys = Keys(settings.robot, settings.base)
        takers: dict[str, Callable[[Sample], None]] = {
            MAP: partial(self._take_map, is_update=False),
            UPDATE: partial(self._take_map, is_update=True),
            SCAN: self._take_scan,
        }
        for topic in (topics.MAP, topics.MAP_UPDATE, topics.SCAN):
            bus.listen(keys, topic, takers[topic.name])
        for name, key, latched, depth in scan["topics"]:
            in_order = name in topics.IN_ORDER
            bus.subscribe(key, takers[name], latched, depth, in_order=in_order)

    def feed(self, follower: Follower, time_of: Callable[[float], float]) -> None:
        """Pass maps to the sight, scans to a follower; ``time_of``: see ``Inputs.time_of``."""
        while self._maps:
            is_update, payload = self._maps.popleft()
            self.sight.take_map(payload, is_update=is_update)
        while self._scans:
            sample, came_at = self._scans.popleft()
            if self._publisher.takes(sample.sender, came_at):
                follower.take_scan(sample.payload, time_of(came_at))
        self._publisher.log()

    def _take_scan(self, sample: Sample) -> None:
        if sample.size <= MOST_SCAN_BYTES:
            self._scans.append((sample, time.monotonic()))

    def _take_map(self, sample: Sample, *, is_update: bool) -> None:
        if sample.size > self._most_map_bytes:
            return
        if not is_update:
            self._maps.clear()
        self._maps.append((is_update, sample.payload))
