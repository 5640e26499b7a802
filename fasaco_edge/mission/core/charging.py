"""Charging: the accepted battery level, the drain per second of driving, and when to charge.

A level that jumps is accepted only after consistent reports for ``HOLD_S``, so that one wrong
message does not send the robot to its dock or away from it. The drain is the median over the last
stretches of driving, so outliers (a steep first percent, a jump of the gauge) have no effect.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from fasaco_edge.mission.config import BatteryPolicy, MissionConfig
from fasaco_edge.mission.core.time_limit import LINE_FACTOR, LOOK_EVERY_S, Lapse, seconds_back
from fasaco_edge.mission.events import BatteryReceived
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.path.route import Route
from fasaco_edge.mission.work.order_state import AT_HOME, NO_ORDER
from fasaco_edge.mission.work.sequencer import Sequencer
from fasaco_edge.text import percent

# A level that differs from the accepted level by more than JUMP must be repeated for HOLD_S [s].
JUMP, HOLD_S = 0.05, 5.0
# The first level is accepted if a level HOLD_S later differs by this much or less.
COARSE = 0.2
# The drain is measured over stretches of driving that use at least this much charge and time [s].
STEP, LEAST_S = 0.01, 10.0
# The drain is the median over the NEWEST stretches; at least FEWEST are needed.
NEWEST, FEWEST = 15, 3
# Least difference between the levels at which the robot turns back and at which it resumes.
HYSTERESIS = 0.1
# The estimated rest of the order has this many unknown cells beyond each cell at the map's border.
BEYOND_CELLS = 20
# A robot near its dock may go to charge at a level that is EARLY above the level at which it turns
# back. PLACES_AHEAD places on its path ahead are compared.
EARLY, PLACES_AHEAD = 0.2, 8
# Limit on the cells of a lattice on which these places are compared: larger lattices take too long.
MOST_CELLS = 200_000
# The battery is full if its level has risen by less than RISE in FULL_AFTER_S [s].
RISE, FULL_AFTER_S = 0.005, 1800.0


class BatteryGauge:
    """Filter over battery messages: accepts levels, rejects outliers, measures the drain.

    Attributes:
        level: accepted charge from 0 to 1; None before a level is accepted.
        power: state of the power supply, as in the message; "" before the first one.
        received_at: arrival time of the last level, accepted or not [s].
    """

    def __init__(self) -> None:
        self.level: float | None = None
        self.power = ""
        self.received_at = float("-inf")
        # Time of the last message; time of the last accepted level, or before the first level, time
        # of ``start_timeout``.
        self._noted_at = float("-inf")
        self._accepted_at: float | None = None
        # A level not accepted yet, and the time of its first report.
        self._claim: tuple[float, float] | None = None
        # Time and level where the current stretch of driving began.
        self._since: tuple[float, float] | None = None
        self._drains: deque[float] = deque(maxlen=NEWEST)

    def continue_from(self, before: BatteryGauge) -> None:
        """Take over the state of a predecessor."""
        vars(self).update(vars(before))

    @property
    def drain_per_s(self) -> float | None:
        """Charge used per second of driving; None until enough is measured."""
        return median(self._drains) if len(self._drains) >= FEWEST else None

    def silent_s(self, now: float) -> float:
        """Return the time since the last accepted level or, at first, ``start_timeout`` [s]."""
        return 0.0 if self._accepted_at is None else now - self._accepted_at

    def why_silent(self, since: float) -> str:
        """Return why no level was accepted after ``since`` [s], as the end of a sentence."""
        if self.received_at >= since:
            return ", it jumps to and fro"
        return ", its messages give none" if self._noted_at >= since else ""

    def start_timeout(self, now: float) -> None:
        """Start the timeout for the first level at ``now`` [s], unless it runs already."""
        self._accepted_at = now if self._accepted_at is None else self._accepted_at

    def receive(self, event: BatteryReceived, now: float, *, drives: bool) -> None:
        """Take in a message at ``now`` [s]; ``drives``: whether the robot is driving."""
        self.power, self._noted_at = event.power, now
        if event.level is None:
            return
        self.received_at = now
        if self.level is None or abs(event.level - self.level) > JUMP:
            claim, level = self._claim, self.level
            # Reports are consistent if they jump in the same direction: the level may drain
            # meanwhile, or change in coarse steps.
            is_new = claim is None or (
                abs(event.level - claim[0]) > COARSE
                if level is None
                else (event.level > level) != (claim[0] > level)
            )
            self._claim = event.level, now if is_new or claim is None else claim[1]
            if now - self._claim[1] < HOLD_S:
                return
            self._since = None
        self._claim, self.level, self._accepted_at = None, event.level, now
        # Use stamps, not ``now``: a simulated robot drives by the clock of its stamps.
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
    """Decides when the robot has to charge and when it may resume; times ``now`` are [s]."""

    config: MissionConfig
    map: MapState
    orders: Sequencer
    route: Route
    gauge: BatteryGauge = field(default_factory=BatteryGauge)
    # Time to the dock [s]; time for the rest of the order [s], None if unknown; age of both.
    _to_dock_s: float = field(default=0.0, init=False)
    _rest_s: float | None = field(default=None, init=False)
    _looked: Lapse = field(init=False)
    # Whether this is the best place on the path to leave for the dock.
    _is_best_here: bool = field(default=False, init=False)
    # The highest level since the robot entered its dock, and its time; None outside the dock.
    _best: tuple[float, float] | None = field(default=None, init=False)
    # ``turns_back_at`` when the robot last went to charge.
    _turned_at: float = field(default=0.0, init=False)
    # The level at which charging last stopped, if that is too low to resume; else None.
    _most: float | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self._looked = Lapse(self.map)

    def continue_from(self, before: Charging) -> None:
        """Take over a predecessor's gauge and charging state."""
        self.gauge.continue_from(before.gauge)
        self._best, self._turned_at, self._most = before._best, before._turned_at, before._most

    @property
    def policy(self) -> BatteryPolicy | None:
        """When to charge; None for never."""
        return self.config.battery

    def update(self, now: float) -> None:
        """Update the time to the dock at intervals; to be called with each decision."""
        if self.policy is None:
            return
        if not self._looked.has_started:
            self.gauge.start_timeout(now)
        elif self.gauge.drain_per_s is None or self._looked.seconds(now) < LOOK_EVERY_S:
            return
        self._looked.start(now)
        is_charging = self.orders.order_state.errand == "charge"
        self._rest_s = self._seconds_left() if is_charging else None
        self._to_dock_s = (
            0.0 if is_charging else seconds_back("charge", self.config, self.map, self.orders)
        )
        self._is_best_here = not is_charging and self._is_best_to_leave_here()

    def silence(self, now: float) -> str:
        """Return why the battery level is unknown; "" if it is known or not needed."""
        if self.policy is None:
            return ""
        if self.gauge.silent_s(now) <= self.policy.silent_s:
            return ""
        silent_s = self.policy.silent_s
        why = self.gauge.why_silent(now - silent_s)
        return f"no battery level for {silent_s:g} s{why}"

    def why_no_dock(self) -> str:
        """Return why the robot has no place to charge on this map; "" if it has one."""
        why = self.map.places.why_no_dock if self.policy is not None else ""
        return f"the robot does not go to charge: {why}" if why else ""

    def is_due(self, now: float) -> bool:
        """Return whether the robot has to go and charge now.

        After a stop by command, or without an order, the robot stays where it is.
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
        is_low = level <= self.turns_back_at or self._is_best_here
        return self.orders.goal("charge") is not None and is_low

    def begin_errand(self) -> None:
        """Begin the way to the dock."""
        self._turned_at = self.turns_back_at

    def why_due(self) -> str:
        """Return why the robot goes to charge, as the end of a path's reason."""
        if self.gauge.level is None:
            return ""
        near = ", the dock is near" if self._is_best_here else ""
        return f": battery at {percent(self.gauge.level, 0)}{near}"

    @property
    def turns_back_at(self) -> float:
        """The level at which the robot goes to charge; includes the charge for the path back."""
        assert self.policy is not None
        low, drain = self.policy.low, self.gauge.drain_per_s
        if drain is None:
            return low
        needed = self.policy.reserve + drain * LINE_FACTOR * self._to_dock_s
        return min(max(low, needed), self.policy.enough - HYSTERESIS)

    @property
    def goes_on_at(self) -> float:
        """The level at which the robot resumes: ``enough``, or less if the order needs less."""
        assert self.policy is not None
        policy, drain = self.policy, self.gauge.drain_per_s
        if drain is None or self._rest_s is None:
            return policy.enough
        needed = max(policy.low, policy.reserve) + drain * LINE_FACTOR * self._rest_s
        return min(policy.enough, max(needed, policy.low + HYSTERESIS))

    @property
    def may_work_s(self) -> float:
        """How long the robot may work from here until it has to go to charge [s]."""
        level, drain = self.gauge.level, self.gauge.drain_per_s
        if self.policy is None or level is None or not drain:
            return float("inf")
        return max(level - self.turns_back_at, 0.0) / drain

    def is_enough(self, now: float, *, docked: bool) -> bool:
        """Return whether the battery of a robot in its dock, or on its way there, suffices."""
        level = self.gauge.level
        if self.policy is None:
            return True  # the configuration has changed
        if not docked or level is None or self.silence(now):
            self._best = None
            return level is not None and not self.silence(now) and level >= self.goes_on_at
        if self._best is None or level > self._best[0] + RISE:
            self._best = level, now
        # Some batteries report full, others only stop rising.
        power, waited_s = self.gauge.power, now - self._best[1]
        is_full = power == "full" or (power != "discharging" and waited_s >= FULL_AFTER_S)
        is_charged = level >= self.goes_on_at
        # A robot that resumes at a lower level would soon return.
        least = max(self.policy.low, self._turned_at) + HYSTERESIS
        self._most = level if is_full and not is_charged else None
        return is_charged or (is_full and level >= least)

    def why(self, now: float) -> str:
        """Return why a robot waits in its dock."""
        if why := self.silence(now):
            return f"{why}: waits for one"
        if self.gauge.level is None:
            return "waits for the level of the battery"
        power = self.gauge.power
        but = f", but {power}" if power in ("discharging", "full") else ""
        now_at, then_at = percent(self.gauge.level, 0), percent(self.goes_on_at, 0)
        return f"battery at {now_at}{but}, goes on at {then_at}"

    def _is_best_to_leave_here(self) -> bool:
        """Return whether charging is due soon, and this is the best place to leave the path.

        Places on the path up to the level of turning back are compared. The best place has the
        shortest way to the dock, relative to the charge used. The result is False if the path ends
        before that level, as it may be the last path.
        """
        level, drain, area = self.gauge.level, self.gauge.drain_per_s, self.map.area
        goal = self.orders.goal("charge")
        if level is None or drain is None or area is None or goal is None:
            return False
        assert self.policy is not None
        spare, ahead = level - self.turns_back_at, self.route.path.ahead
        most = self.policy.enough if self._most is None else self._most
        if not 0.0 < spare <= min(EARLY, most - level):
            return False
        if area.lattice.states.size > MOST_CELLS:
            return False
        cost = self.config.cost
        last = int(spare / (drain * cost.step_s)) if drain > 0.0 else len(ahead)
        while last < len(ahead) and last > 0 and drain * cost.of_walk(ahead[: last + 1]) > spare:
            last = int(0.9 * last)
        if not 0 < last < len(ahead) - 1:
            return False
        rates = []
        for index in np.linspace(0, last, PLACES_AHEAD).astype(int).tolist():
            row, col = ahead[index].tolist()
            way = area.shortest_path((row, col), goal)
            then = level - drain * cost.of_walk(ahead[: index + 1])
            used = most - then
            rates.append(cost.of_walk(way) / used if len(way) else float("inf"))
        return rates[0] <= min(rates)

    def _seconds_left(self) -> float | None:
        """Return the time for the rest of the order, from the dock and back; None if unknown."""
        state, cells, area = self.orders.order_state, self.route.aside, self.map.area
        goal = self.orders.goal("charge")
        is_last = (
            state.is_open and state.next_pass() is state and not self.orders.cells.is_exploring
        )
        is_last = is_last and not self.orders.scope.is_part
        if not is_last or area is None or goal is None or cells is None or not len(cells):
            return None
        ends = [(int(row), int(col)) for row, col in (cells[0], cells[-1])]
        walks = area.shortest_path(goal, ends[0]), cells, area.shortest_path(ends[1], goal)
        beyond_s = self.config.cost.step_s * BEYOND_CELLS * self.orders.cells.frontier_cells
        return sum(self.config.cost.of_walk(walk) for walk in walks) + beyond_s
