"""A follower's inputs from the bus: poses, paths and heartbeats of the daemon, by cycle."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.one_publisher import OnePublisher
from fasaco_edge.bus.session import Bus
from fasaco_edge.errors import FasacoError
from fasaco_edge.follow.clock import Clock, RealClock, SimulatedClock
from fasaco_edge.follow.daemons import Daemons
from fasaco_edge.follow.settings import FollowSettings, PoseSource
from fasaco_edge.follow.supervision import LINK_S, Patience, Supervision
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.schemas import TF_MESSAGE

LOG = logging.getLogger(__name__)
# Most poses that wait for the next cycle; beyond that the oldest are dropped.
MOST_POSES = 256


def patience_of(settings: FollowSettings) -> Patience:
    """Return the timeouts of a follower's inputs."""
    return Patience(
        settings.pose_age_s,
        max(settings.pose_age_s, LINK_S),
        Patience().status_s * settings.pace,
    )


class Inputs:
    """Subscribes, and passes the inputs since the last cycle to a follower.

    Attributes:
        planner, revision: the daemon that plans, "" for none, and the revision of its newest path.
    """

    def __init__(self, settings: FollowSettings, bus: Bus) -> None:
        real = settings.pace == 1.0
        self._clock: Clock = RealClock() if real else SimulatedClock(settings.pace)
        self._decoder = PoseDecoder(settings.pose_schema, settings.frames)
        self._poses = deque[tuple[Sample, PoseSource, float]](maxlen=MOST_POSES)
        self._publisher = OnePublisher("poses", topics.POSE.one_publisher_s, bus)
        self._conflict = ""
        self._daemons = Daemons()
        # The daemon that plans, and the revision of its newest path.
        self.planner, self.revision = "", 0
        keys = Keys(settings.robot, settings.base)
        for source in settings.poses:
            bus.subscribe(source.key, self._pose_taker(source), source.latched, source.depth)
        bus.watch_tokens(keys.of(topics.CLAIM), self._daemons.take_claim)
        bus.listen(keys, topics.STATUS, self._take_status)
        bus.listen(keys, topics.PATH, self._daemons.take_path)

    def now(self) -> float:
        """Return the time by the clock of the robot's seconds [s]."""
        return self._clock.at(time.monotonic())

    def time_of(self, came_at: float) -> float:
        """Return the same for an arrival, by the computer's monotonic clock [s]."""
        return self._clock.at(came_at)

    @property
    def daemon_state(self) -> str:
        """The state of the daemon that plans, by its newest status; "" for none."""
        return self._daemons.state

    def feed(self, follower: Supervision) -> None:
        """Pass the inputs to a follower."""
        news = self._daemons.news()
        self.planner, self.revision = news.planner, news.revision
        follower.take_planner(news.planner)
        if news.status_at is not None:
            follower.heard_status(news.status_at)
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
                follower.refuse_pose(error)
                continue
            if pose is not None:
                follower.take_pose(pose, self._clock.hear(pose.stamp_ns, came_at))
            if (link := self._decoder.oldest_link) is not None:
                follower.heard_link(link)
        self._warn(self._publisher.conflict(time.monotonic()))
        if news.path is not None:
            follower.take_path(news.path.payload)
        if news.unnamed is not None:
            follower.take_unnamed_path(news.unnamed.payload)

    def _warn(self, conflict: str) -> None:
        if conflict and not self._conflict:
            LOG.warning("%s", conflict, extra={"event": "two_publishers"})
        self._conflict = conflict

    def _pose_taker(self, source: PoseSource) -> Callable[[Sample], None]:
        def take(sample: Sample) -> None:
            self._poses.append((sample, source, time.monotonic()))

        return take

    def _take_status(self, sample: Sample) -> None:
        self._daemons.take_status(sample.payload, self.now())
