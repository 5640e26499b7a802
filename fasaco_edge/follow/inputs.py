"""A follower's inputs from the bus: poses, paths and heartbeats of the daemon, by cycle."""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.mailbox import LatestSlot
from fasaco_edge.bus.session import Bus
from fasaco_edge.errors import FasacoError
from fasaco_edge.follow.clock import Clock, RealClock, SimulatedClock
from fasaco_edge.follow.settings import FollowSettings, PoseSource
from fasaco_edge.follow.supervision import LINK_S, Patience, Supervision
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.poses import PoseDecoder

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
    """Subscribes, and passes the inputs since the last cycle to a follower."""

    def __init__(self, settings: FollowSettings, bus: Bus) -> None:
        real = settings.pace == 1.0
        self._clock: Clock = RealClock() if real else SimulatedClock(settings.pace)
        self._decoder = PoseDecoder(settings.pose_schema, settings.frames)
        self._poses = deque[tuple[Sample, PoseSource, float]](maxlen=MOST_POSES)
        self._path: LatestSlot[Sample] = LatestSlot()
        # Ids of the daemons that plan, and when one of them was heard; on Zenoh's threads.
        self._planners: set[str] = set()
        self._heard_at: float | None = None
        self._status = b""
        self._lock = threading.Lock()
        keys = Keys(settings.robot, settings.base)
        for source in settings.poses:
            bus.subscribe(source.key, self._pose_taker(source), source.latched, source.depth)
        bus.watch_tokens(keys.of(topics.CLAIM), self._on_claim)
        bus.listen(keys, topics.STATUS, self._on_status)
        bus.listen(keys, topics.PATH, self._path.put)

    def now(self) -> float:
        """Return the time by the clock of the robot's seconds [s]."""
        return self._clock.at(time.monotonic())

    @property
    def daemon_state(self) -> str:
        """The daemon's state by its newest status; "" for none."""
        try:
            state = json.loads(self._status)["state"]
        except (ValueError, KeyError, TypeError):
            return ""
        return state if isinstance(state, str) else ""

    def feed(self, follower: Supervision) -> None:
        """Pass the inputs to a follower."""
        with self._lock:
            planner = min(self._planners, default="")
            heard_at, self._heard_at = self._heard_at, None
        follower.take_planner(planner, self.now())
        if heard_at is not None:
            follower.heard_status(heard_at)
        while self._poses:
            sample, source, came_at = self._poses.popleft()
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
        if (path := self._path.take(0.0)) is not None:
            follower.take_path(path.payload)

    def _pose_taker(self, source: PoseSource) -> Callable[[Sample], None]:
        def take(sample: Sample) -> None:
            self._poses.append((sample, source, time.monotonic()))

        return take

    def _on_claim(self, key: str, is_there: bool) -> None:
        _, _, claim = key.rpartition("/claim/")
        planner, _, stand = claim.partition("/")
        if stand == "plans":
            with self._lock:
                (self._planners.add if is_there else self._planners.discard)(planner)

    def _on_status(self, sample: Sample) -> None:
        with self._lock:
            self._heard_at, self._status = self.now(), sample.payload
