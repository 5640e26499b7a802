"""The follower on the bus: a loop of twenty cycles a second from samples to commands."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from fasaco_edge.bus.joining import join
from fasaco_edge.bus.session import Bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.follow.daemons import BaseClaim
from fasaco_edge.follow.estimate import STAND, Command, Limits
from fasaco_edge.follow.follower import RATE_HZ, Follower
from fasaco_edge.follow.inputs import Inputs, ScanInputs, patience_of
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.follow.standstill import Standstill, report_of
from fasaco_edge.follow.supervision import State, Supervision
from fasaco_edge.host.processes import release_unused
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.twists import Velocity, encode_velocity
from fasaco_edge.wire.schemas import TWIST_STAMPED
from fasaco_edge.wire.topic_types import VOLATILE

if TYPE_CHECKING:
    from fasaco_edge.follow.docking import DockingNode

log = logging.getLogger(__name__)

REPORT_EVERY_S = 1.0
# A cycle may run this much early [s].
LEAST_S = 1e-6


class Out(Protocol):
    """Where commands go."""

    def put(self, payload: bytes) -> None:
        """Send a message."""


class Node(Protocol):
    """A follower on the bus."""

    def turn(self) -> None:
        """Run a cycle: take the inputs, and send commands."""

    def end(self) -> None:
        """Make the robot stand."""


def run_follower(
    settings: FollowSettings,
    stop: threading.Event,
    node_of: Callable[[Bus, FollowSettings, Callable[[str], None]], Node],
    report: Callable[[str], None],
) -> None:
    """Drive the base along the path until ``stop`` is set; then stop the base.

    Args:
        settings: the follower's.
        stop: ends it.
        node_of: makes the node that runs the cycles.
        report: called each second with the command in a dry run.
    """
    bus = join(BusSettings("client", settings.connect, secured=settings.secured), stop)
    if bus is None:
        return
    with bus:
        node = node_of(bus, settings, report)
        release_unused()
        try:
            _take_turns(node, 1.0 / (RATE_HZ * settings.pace), stop)
        finally:
            node.end()


def native_node(bus: Bus, settings: FollowSettings, report: Callable[[str], None]) -> FollowerNode:
    """Return the node that sends velocities on the native key."""
    out = bus.publisher(settings.cmd_key, settings.schema, topics.CMD_VEL.qos or VOLATILE)
    return FollowerNode(settings, bus, out, report)


def docking_of(bus: Bus, settings: FollowSettings) -> DockingNode | None:
    """Return the node for docking by Nav2; None if the base docks itself, or in a dry run."""
    if not settings.dock or settings.dry_run:
        return None
    # A follower without a dock does not load it.
    from fasaco_edge.follow.docking import DockingNode  # noqa: PLC0415

    return DockingNode(bus, settings)


def _take_turns(node: Node, period_s: float, stop: threading.Event) -> None:
    due = time.monotonic()
    while not stop.is_set():
        node.turn()
        due += period_s
        now = time.monotonic()
        if due <= now:
            # Missed cycles are skipped.
            due = now + period_s
        stop.wait(due - now)


class Role:
    """The claim on the base, the report to the daemon, and docking by Nav2."""

    def __init__(self, bus: Bus, settings: FollowSettings) -> None:
        self._claim = None if settings.dry_run else BaseClaim(bus, settings)
        self._docking = docking_of(bus, settings)
        keys = Keys(settings.robot, settings.base)
        self._blocked = None if settings.dry_run else bus.advertise(keys, topics.BLOCKED)
        self._standstill = Standstill()
        self.is_on_standby = self._claim is not None

    def report(self, inputs: Inputs, follower: Supervision, now: float) -> None:
        """Report to the daemon what keeps the robot from driving its path, if anything does."""
        held_s = self._standstill.look(follower, now)
        if held_s is not None and self._blocked is not None and not self.is_on_standby:
            self._blocked.put(report_of(follower, held_s, inputs.planner, inputs.revision))

    def turn(self, inputs: Inputs, follower: Supervision) -> None:
        """Run a cycle: let the follower stand by while another one drives; dock."""
        why = self._claim.standby(time.monotonic()) if self._claim is not None else None
        self.is_on_standby = why is not None
        follower.stand_by(why)
        if self._docking is not None:
            if self.is_on_standby:
                self._docking.end()
            else:
                self._docking.turn(inputs, follower)

    def end(self) -> None:
        """End docking by Nav2."""
        if self._docking is not None:
            self._docking.end()


class FollowerNode:
    """Takes the inputs, steps the follower, and sends its commands."""

    def __init__(
        self, settings: FollowSettings, bus: Bus, out: Out, report: Callable[[str], None]
    ) -> None:
        self._settings = settings
        self._out = out
        self._report = report
        self._scans = ScanInputs(settings, bus) if settings.scan else None
        self._follower = Follower(
            Limits(
                settings.speed_m_s,
                settings.acceleration_m_s2,
                math.radians(settings.turn_deg_s),
                math.radians(settings.turn_deg_s2),
                math.radians(settings.steered_deg),
                settings.turn_radius_m,
            ),
            patience_of(settings),
            moves=not settings.dry_run,
            radius=settings.radius_m,
            sight=self._scans.sight if self._scans is not None else None,
        )
        self._inputs = Inputs(settings, bus)
        self._role = Role(bus, settings)
        self._states = StateLog()
        self._reported_at = -math.inf
        self._due = -math.inf

    def turn(self) -> None:
        """Take the inputs, and send the resulting command."""
        follower = self._follower
        self._inputs.feed(follower)
        if self._scans is not None:
            self._scans.feed(follower, self._inputs.time_of)
        now = self._inputs.now()
        if self._settings.pace != 1.0 and not self._is_due(now):
            return
        self._role.turn(self._inputs, follower)
        command = follower.step(now)
        self._role.report(self._inputs, follower, now)
        if command is not None:
            self._send(command)
        if self._states.note(follower.state, follower.detail):
            self._reported_at = -math.inf
        self._say(command)

    def end(self) -> None:
        """Make the robot stand."""
        self._role.end()
        self._send(STAND)

    def _is_due(self, now: float) -> bool:
        """Return whether a cycle is due in simulated time: it may run slower than its pace."""
        if now < self._due - LEAST_S:
            return False
        due = self._due + 1.0 / RATE_HZ
        self._due = due if due > now else now + 1.0 / RATE_HZ
        return True

    def _send(self, command: Command) -> None:
        """Send a command; send none in a dry run, or while another follower drives."""
        if self._settings.dry_run or self._role.is_on_standby:
            return
        velocity = Velocity(command.speed, command.turn_rate)
        if self._settings.schema == TWIST_STAMPED:
            velocity = Velocity(
                command.speed, command.turn_rate, self._settings.frame, time.time_ns()
            )
        self._out.put(encode_velocity(velocity, self._settings.schema))

    def _say(self, command: Command | None) -> None:
        """In a dry run report each second."""
        now = time.monotonic()
        if self._settings.dry_run and now - self._reported_at >= REPORT_EVERY_S:
            self._reported_at = now
            sent = command or STAND
            turn = math.degrees(sent.turn_rate)
            state = self._follower.state.value
            self._report(f"{sent.speed:6.3f} m/s {turn:7.1f} deg/s  {state}")


class StateLog:
    """Logs changes of the robot's state."""

    def __init__(self) -> None:
        self._state: State | None = None

    def note(self, state: State, detail: str) -> bool:
        """Log a state if it has changed; return whether it has."""
        if state is self._state:
            return False
        self._state = state
        words = f": {detail}" if detail else ""
        if state is State.DRIVING:
            log.info("driving%s", words)
        else:
            log.info("standing, %s%s", state.value, words)
        return True
