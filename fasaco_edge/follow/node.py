"""The follower on the bus: a loop of twenty turns a second between samples and commands."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.mailbox import LatestSlot
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable, FasacoError
from fasaco_edge.follow.estimate import STAND, Command, Limits
from fasaco_edge.follow.follower import LINK_S, RATE_HZ, Follower, Patience, State
from fasaco_edge.follow.settings import FollowSettings, PoseSource
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.messages.twists import Velocity, encode_velocity
from fasaco_edge.wire.schemas import TWIST_STAMPED
from fasaco_edge.wire.topic_types import VOLATILE

log = logging.getLogger(__name__)

# Poses that may wait for the next turn; of more the oldest go.
MOST_POSES = 256
# While nobody listens at the endpoint it is tried again after so long [s].
RETRY_S = 1.0
REPORT_EVERY_S = 1.0


class Out(Protocol):
    """Where commands go."""

    def put(self, payload: bytes) -> None:
        """Send a message."""


def run_follower(
    settings: FollowSettings,
    stop: threading.Event,
    out_of: Callable[[Bus, FollowSettings], Out],
    report: Callable[[str], None],
) -> None:
    """Drive the base along the path until ``stop`` is set; it is told to stand before the end.

    Args:
        settings: the follower's.
        stop: ends it.
        out_of: makes what commands are sent by.
        report: is told each second what would be sent, in a dry run.
    """
    bus = _joined(settings, stop)
    if bus is None:
        return
    with bus:
        node = FollowerNode(settings, bus, out_of(bus, settings), report)
        try:
            node.run(stop)
        finally:
            node.send(STAND)


def native_out(bus: Bus, settings: FollowSettings) -> Out:
    """Return the publisher of the native key."""
    return bus.publisher(settings.cmd_key, settings.schema, topics.CMD_VEL.qos or VOLATILE)


def _joined(settings: FollowSettings, stop: threading.Event) -> Bus | None:
    """Join the bus, once somebody listens there; None where ``stop`` is set before."""
    told = False
    while not stop.is_set():
        try:
            return open_bus(BusSettings("client", settings.connect, secured=settings.secured))
        except BusUnavailable as error:
            if not told:
                log.warning("waiting for the bus at %s: %s", ", ".join(settings.connect), error)
                told = True
            stop.wait(RETRY_S)
    return None


class FollowerNode:
    """Takes what came in, steps the follower, and sends what it says."""

    def __init__(
        self, settings: FollowSettings, bus: Bus, out: Out, report: Callable[[str], None]
    ) -> None:
        self._settings = settings
        self._out = out
        self._report = report
        self._pace = settings.pace
        self._follower = Follower(
            Limits(
                settings.speed_m_s,
                settings.acceleration_m_s2,
                math.radians(settings.turn_deg_s),
                math.radians(settings.turn_deg_s2),
                math.radians(settings.steered_deg),
            ),
            Patience(
                settings.pose_age_s,
                max(settings.pose_age_s, LINK_S),
                Patience().status_s * settings.pace,
            ),
            moves=not settings.dry_run,
        )
        self._decoder = PoseDecoder(settings.pose_schema, settings.frames)
        self._poses = deque[tuple[Sample, PoseSource, float]](maxlen=MOST_POSES)
        self._path: LatestSlot[Sample] = LatestSlot()
        # Ids of the daemons that plan, and when one of them was heard; on Zenoh's threads.
        self._planners: set[str] = set()
        self._heard_at: float | None = None
        self._lock = threading.Lock()
        self._said: tuple[State, str] | None = None
        self._reported_at = -math.inf
        keys = Keys(settings.robot, settings.base)
        for source in settings.poses:
            bus.subscribe(source.key, self._pose_taker(source), source.latched, source.depth)
        bus.watch_tokens(keys.of(topics.CLAIM), self._on_claim)
        bus.listen(keys, topics.STATUS, self._on_status)
        bus.listen(keys, topics.PATH, self._path.put)

    def run(self, stop: threading.Event) -> None:
        """Let turns follow each other until ``stop`` is set."""
        period_s = 1.0 / (RATE_HZ * self._pace)
        due = time.monotonic()
        while not stop.is_set():
            self.turn()
            due += period_s
            now = time.monotonic()
            if due <= now:
                # Turns that were missed are not made up for.
                due = now + period_s
            stop.wait(due - now)

    def turn(self) -> None:
        """Take what came, and send what follows from it."""
        follower = self._follower
        self._take(follower)
        command = follower.step(self._now())
        if command is not None:
            self.send(command)
        self._tell(command)

    def send(self, command: Command) -> None:
        """Send a command; in a dry run none."""
        if self._settings.dry_run:
            return
        velocity = Velocity(command.speed, command.turn_rate)
        if self._settings.schema == TWIST_STAMPED:
            velocity = Velocity(
                command.speed, command.turn_rate, self._settings.frame, time.time_ns()
            )
        self._out.put(encode_velocity(velocity, self._settings.schema))

    def _take(self, follower: Follower) -> None:
        with self._lock:
            planner = min(self._planners, default="")
            heard_at, self._heard_at = self._heard_at, None
        follower.take_planner(planner, self._now())
        if heard_at is not None:
            follower.heard_status(heard_at)
        while self._poses:
            sample, source, at = self._poses.popleft()
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
                follower.take_pose(pose, at)
            if (link := self._decoder.oldest_link) is not None:
                follower.heard_link(link)
        if (path := self._path.take(0.0)) is not None:
            follower.take_path(path.payload)

    def _tell(self, command: Command | None) -> None:
        """Log what the robot does, where that is new; in a dry run report each second."""
        follower = self._follower
        said = follower.state, "" if follower.state is State.DRIVING else follower.detail
        if self._said is None or self._said[0] is not said[0]:
            detail = f": {follower.detail}" if follower.detail else ""
            what = "driving" if follower.state is State.DRIVING else "standing"
            why = "" if follower.state is State.DRIVING else f", {follower.state.value}{detail}"
            log.info("%s%s", what, why)
            self._said = said
            self._reported_at = -math.inf
        now = time.monotonic()
        if self._settings.dry_run and now - self._reported_at >= REPORT_EVERY_S:
            self._reported_at = now
            sent = command or STAND
            turn = math.degrees(sent.turn_rate)
            self._report(f"{sent.speed:6.3f} m/s {turn:7.1f} deg/s  {follower.state.value}")

    def _now(self) -> float:
        """Return the time by the clock that the robot's seconds are counted by [s]."""
        return time.monotonic() * self._pace

    def _pose_taker(self, source: PoseSource) -> Callable[[Sample], None]:
        def take(sample: Sample) -> None:
            self._poses.append((sample, source, self._now()))

        return take

    def _on_claim(self, key: str, is_there: bool) -> None:
        _, _, claim = key.rpartition("/claim/")
        planner, _, stand = claim.partition("/")
        if stand == "plans":
            with self._lock:
                (self._planners.add if is_there else self._planners.discard)(planner)

    def _on_status(self, _sample: Sample) -> None:
        with self._lock:
            self._heard_at = self._now()
