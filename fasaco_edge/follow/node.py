"""Follower on the bus: a loop of twenty cycles a second from samples to commands."""

from __future__ import annotations

import logging
import math
import threading
import time
from abc import abstractmethod
from collections.abc import Callable

from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.bus.session import Bus, join
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.follow.daemons import BaseClaim
from fasaco_edge.follow.estimate import STAND, VelocityCommand
from fasaco_edge.follow.follower import PERIOD_S, Follower
from fasaco_edge.follow.inputs import Inputs, ScanInputs
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.follow.standstill import Standstill
from fasaco_edge.follow.supervision import LINK_S, FollowerState, Patience, Supervision
from fasaco_edge.host.processes import release_unused
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.base import Velocity, encode_velocity
from fasaco_edge.wire.ros_keys import RosNode, RosTopic, gid_of
from fasaco_edge.wire.topic_types import VOLATILE

log = logging.getLogger(__name__)

REPORT_EVERY_S = 1.0
# A cycle may run this much early [s].
LEAST_S = 1e-6


class Node:
    """A follower on the bus: its inputs, the claim on the base, and reports."""

    def __init__(self, bus: Bus, settings: FollowSettings, follower: Supervision) -> None:
        self._settings, self._follower = settings, follower
        self._inputs = Inputs(settings, bus)
        keys = Keys(settings.robot, settings.base)
        self._claim = None if settings.dry_run else BaseClaim(bus, settings)
        self._blocked = None if settings.dry_run else bus.advertise(keys, topics.BLOCKED)
        follower.standby = (FollowerState.LOOKS, "") if self._claim else None
        self._standstill = Standstill()
        self._logged: FollowerState | None = None
        self._due = -math.inf

    def turn(self) -> None:
        """Run a cycle: take the inputs, step the follower, send its output, and report."""
        follower, inputs = self._follower, self._inputs
        inputs.feed(follower)
        now = inputs.now()
        if not self._is_due(now):
            return
        follower.standby = self._claim.standby(time.monotonic()) if self._claim else None
        self._step(now)
        news = inputs.news
        report = self._standstill.report(follower, news.planner, news.revision, now)
        if report is not None and self._blocked is not None and not follower.standby:
            self._blocked.put(report)
        self._log()

    @abstractmethod
    def end(self) -> None:
        """Make the robot stand."""

    @abstractmethod
    def _step(self, now: float) -> None:
        """Step the follower, and send its output."""

    def _is_due(self, now: float) -> bool:
        """Return whether a cycle is due in simulated time, which may run slower than ``pace``."""
        if self._settings.pace == 1.0:
            return True
        if now < self._due - LEAST_S:
            return False
        due = self._due + PERIOD_S
        self._due = due if due > now else now + PERIOD_S
        return True

    def _log(self) -> None:
        state, detail = self._follower.state, self._follower.detail
        if state is not self._logged:
            self._logged = state
            standing = "" if state is FollowerState.DRIVING else "standing, "
            log.info("%s%s%s", standing, state.value, f": {detail}" if detail else "")


class FollowerNode(Node):
    """Sends the follower's commands to the base."""

    _follower: Follower

    def __init__(self, bus: Bus, settings: FollowSettings, report: Callable[[str], None]) -> None:
        self._scans = ScanInputs(settings, bus) if settings.scan else None
        follower = Follower(
            settings.limits,
            patience_of(settings),
            moves=not settings.dry_run,
            radius=settings.radius_m,
            sight=self._scans.sight if self._scans is not None else None,
        )
        super().__init__(bus, settings, follower)
        self._out = _velocities(bus, settings)
        self._report, self._reported_at = report, -math.inf

    def end(self) -> None:
        self._send(STAND)

    def _step(self, now: float) -> None:
        follower = self._follower
        if self._scans is not None:
            self._scans.feed(follower, self._inputs.time_of)
        command = follower.step(now)
        if command is not None:
            self._send(command)
        if self._settings.dry_run and now - self._reported_at >= REPORT_EVERY_S:
            self._reported_at, sent = now, command or STAND
            turn = math.degrees(sent.turn_rate)
            why = f"{follower.state.value}{f': {follower.detail}' if follower.detail else ''}"
            self._report(f"{sent.speed:z6.3f} m/s {turn:z7.1f} deg/s  {why}")

    def _send(self, command: VelocityCommand) -> None:
        """Send a command; send none in a dry run, or while another follower drives."""
        settings = self._settings
        if not settings.dry_run and not self._follower.standby:
            speed, rate = command.speed, command.turn_rate
            velocity = Velocity(speed, rate, settings.frame, time.time_ns())
            self._out.put(encode_velocity(velocity, settings.schema))


def _velocities(bus: Bus, settings: FollowSettings) -> Publisher:
    """Return the publisher of velocities; for rmw_zenoh, also declare its node and topic."""
    out = bus.publisher(settings.cmd_key, settings.schema, topics.CMD_VEL.qos or VOLATILE)
    ros = settings.ros
    if ros and ros["kind"] == "rmw_zenoh":
        node = RosNode(ros["domain"], bus.id, ros["namespace"], ros["node"])
        token = node.endpoint_token(1, "MP", RosTopic(ros["topic"], settings.schema))
        bus.token(node.token)
        bus.token(token)
        out.gid = gid_of(token)
    return out


def patience_of(settings: FollowSettings) -> Patience:
    """Return the timeouts of a follower's inputs."""
    link_s = max(settings.pose_age_s, LINK_S)
    return Patience(settings.pose_age_s, link_s, Patience().status_s * settings.pace)


def run_follower(
    settings: FollowSettings,
    stop: threading.Event,
    node_of: Callable[[Bus, FollowSettings, Callable[[str], None]], Node],
    report: Callable[[str], None],
) -> None:
    """Drive the base along the path until ``stop`` is set; then stop the base.

    In a dry run, ``report`` is called with commands or goals as text instead of sending them.
    """
    bus = join(BusSettings("client", settings.connect, secured=settings.secured), stop)
    if bus is None:
        return
    with bus:
        node = node_of(bus, settings, report)
        release_unused()
        try:
            due, period_s = time.monotonic(), PERIOD_S / settings.pace
            while not stop.is_set():
                node.turn()
                # Missed cycles are skipped.
                now = time.monotonic()
                due = due + period_s if due + period_s > now else now + period_s
                stop.wait(due - now)
        finally:
            node.end()
