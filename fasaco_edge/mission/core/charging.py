"""Charging: what is believed of the battery, what driving drains, and when to charge how much.

A charge is believed once it has come for a while: one wrong message must not send the robot to its
dock, nor away from it. The drain is the median over the last pieces of driving, so that neither a
steep first percent nor a jump of the gauge counts.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from statistics import median

from fasaco_edge.mission.config import BatteryPolicy, MissionConfig
from fasaco_edge.mission.core.events import BatteryReceived
from fasaco_edge.mission.core.route import Route
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order_state import AT_HOME, NO_ORDER
from fasaco_edge.mission.orders.sequencer import Sequencer

# A charge further from the last one than this counts once it has come for so long [s].
JUMP, HOLD_S = 0.05, 5.0
# The first one counts once another came after so long that is no further from it.
COARSE = 0.2
# A piece of driving shows a drain once it took so much, and so long [s].
STEP, LEAST_S = 0.01, 10.0
# So many of the last pieces count, and no fewer than these.
NEWEST, FEWEST = 15, 3
# The way back is looked for this often [s].
WAY_EVERY_S = 5.0
# Between the level at which it turns back and that at which it goes on; of the rest's time more
# than is planned, as lines are longer than walks over cells.
BETWEEN, SPARE = 0.1, 1.2
# A charge that has risen by less than this for so long [s] is all that this battery takes.
RISE, ALL_AFTER_S = 0.005, 1800.0


class BatteryGauge:
    """Believes some of what the battery says.

    Attributes:
        level: charge from 0 to 1; None before one is believed.
        power: what the supply does, as its message says; "" before there was one.
        heard_at: when the last charge came, believed or not [s].
    """

    def __init__(self) -> None:
        self.level: float | None = None
        self.power = ""
        self.heard_at = float("-inf")
        self._told_at = 0.0
        # A charge that is to come for some time, and since when.
        self._claim: tuple[float, float] | None = None
        # Time and charge where the current piece of driving began.
        self._since: tuple[float, float] | None = None
        self._drains: deque[float] = deque(maxlen=NEWEST)

    @property
    def drain_per_s(self) -> float | None:
        """What driving takes a second; None before enough was seen."""
        return median(self._drains) if len(self._drains) >= FEWEST else None

    def silent_s(self, now: float) -> float:
        """Return how long no charge has come that is believed, or since the beginning none [s]."""
        return now - self._told_at

    def begin(self, now: float) -> None:
        """Wait for the first charge from ``now`` [s] on."""
        self._told_at = now

    def note(self, event: BatteryReceived, now: float, *, drives: bool) -> None:
        """Take a message at ``now`` [s] of a robot that drives, or does not."""
        self.power = event.power
        if event.level is None:
            return
        self.heard_at = now
        if self.level is None or abs(event.level - self.level) > JUMP:
            claim, level = self._claim, self.level
            # It may drain on meanwhile, or come in coarse steps: what counts is to which side.
            is_new = claim is None or (
                abs(event.level - claim[0]) > COARSE
                if level is None
                else (event.level > level) != (claim[0] > level)
            )
            self._claim = event.level, now if is_new or claim is None else claim[1]
            if now - self._claim[1] < HOLD_S:
                return
            self._since = None
        self._claim, self.level, self._told_at = None, event.level, now
        # By its own clock, as robots drive by it: that of a simulation may be faster.
        at_s = 1e-9 * event.stamp_ns if event.stamp_ns else now
        self._measure(event.level, at_s, drives=drives and event.power != "charging")

    def _measure(self, level: float, at_s: float, *, drives: bool) -> None:
        since = self._since
        if not drives or since is None or level > since[1] or at_s < since[0]:
            self._since = (at_s, level) if drives else None
        elif since[1] - level >= STEP and at_s - since[0] >= LEAST_S:
            self._drains.append((since[1] - level) / (at_s - since[0]))
            self._since = at_s, level


@dataclass(slots=True, eq=False)
class Charging:
    """Decides when the robot has to charge, and when it has enough; times ``now`` are [s]."""

    config: MissionConfig
    map: MapState
    orders: Sequencer
    route: Route
    gauge: BatteryGauge = field(default_factory=BatteryGauge)
    # The way back, and what is still to be driven where that is known [s]; as of when.
    _way_s: float = field(default=0.0, init=False)
    _rest_s: float | None = field(default=None, init=False)
    _looked_at: float | None = field(default=None, init=False)
    # The highest charge since the robot is in its dock, and since when; None elsewhere.
    _best: tuple[float, float] | None = field(default=None, init=False)

    @property
    def policy(self) -> BatteryPolicy | None:
        """When to charge; None for never."""
        return self.config.battery

    def look(self, now: float) -> None:
        """Look how far it is, now and then; to be called with each decision."""
        if self.policy is None:
            return
        if self._looked_at is None:
            self.gauge.begin(now)
        elif self.gauge.drain_per_s is None or now - self._looked_at < WAY_EVERY_S:
            return
        self._looked_at = now
        is_charging = self.orders.order_state.errand == "charge"
        self._rest_s = self._seconds_left() if is_charging else None
        self._way_s = 0.0 if is_charging else self._seconds_to_dock()

    def silence(self, now: float) -> str:
        """Return why it is not known when to charge; "" where it is, or need not be."""
        if self.policy is None:
            return ""
        if self.gauge.silent_s(now) <= self.policy.silent_s:
            return ""
        silent_s = self.policy.silent_s
        jumps = ", it jumps to and fro" if now - self.gauge.heard_at <= silent_s else ""
        return f"no charge of the battery for {silent_s:g} s{jumps}"

    def is_due(self, now: float) -> bool:
        """Tell whether the robot has to go and charge now.

        One that was told to stop, by a cancelled order too, drives nowhere by itself.
        """
        order, level = self.orders.order_state, self.gauge.level
        if self.policy is None or level is None or self.silence(now):
            return False
        if (
            order.paused
            or order.errand
            or (not order.order and order.why not in (NO_ORDER, AT_HOME))
        ):
            return False
        return self.orders.goal("charge") is not None and level <= self.turns_back_at

    @property
    def turns_back_at(self) -> float:
        """The level at which the robot goes to charge: what the way back takes counts."""
        assert self.policy is not None
        low, drain = self.policy.low, self.gauge.drain_per_s
        if drain is None:
            return low
        needed = self.policy.reserve + drain * SPARE * self._way_s
        return min(max(low, needed), self.policy.enough - BETWEEN)

    @property
    def goes_on_at(self) -> float:
        """The level at which it goes on: what the rest of the order needs, if that is less."""
        assert self.policy is not None
        policy, drain = self.policy, self.gauge.drain_per_s
        if drain is None or self._rest_s is None:
            return policy.enough
        needed = max(policy.low, policy.reserve) + drain * SPARE * self._rest_s
        return min(policy.enough, max(needed, policy.low + BETWEEN))

    def is_enough(self, now: float, *, docked: bool) -> bool:
        """Tell whether the robot, which is in its dock or on the way there, has enough."""
        level = self.gauge.level
        if self.policy is None:
            return True  # the configuration has changed
        if not docked or level is None or self.silence(now):
            self._best = None
            return level is not None and not self.silence(now) and level >= self.goes_on_at
        if self._best is None or level > self._best[0] + RISE:
            self._best = level, now
        # Some say that they are full, others only rise no further.
        power, waited_s = self.gauge.power, now - self._best[1]
        is_all = power == "full" or (power != "discharging" and waited_s >= ALL_AFTER_S)
        return level >= self.goes_on_at or (is_all and level >= self.policy.low + BETWEEN)

    def why(self, now: float) -> str:
        """Return what the robot in its dock waits for."""
        if why := self.silence(now):
            return f"{why}: waits for one"
        if self.gauge.level is None:
            return "waits for the charge of the battery"
        but = ", but discharging" if self.gauge.power == "discharging" else ""
        return f"battery at {self.gauge.level:.0%}{but}, goes on at {self.goes_on_at:.0%}"

    def _seconds_to_dock(self) -> float:
        cell, goal, area = self.map.robot_cell(), self.orders.goal("charge"), self.map.area
        if cell is None or goal is None or area is None:
            return 0.0
        return self.config.cost.of_walk(area.shortest_path(cell, goal))

    def _seconds_left(self) -> float | None:
        """Return what the rest of the order takes from the dock and back; None if not known."""
        state, cells, area = self.orders.order_state, self.route.aside, self.map.area
        goal = self.orders.goal("charge")
        is_last = state.is_open and state.next_pass() is state and not self.orders.is_exploring
        if not is_last or area is None or goal is None or cells is None or not len(cells):
            return None
        ends = [(int(row), int(col)) for row, col in (cells[0], cells[-1])]
        ways = area.shortest_path(goal, ends[0]), cells, area.shortest_path(ends[1], goal)
        return sum(self.config.cost.of_walk(way) for way in ways)
