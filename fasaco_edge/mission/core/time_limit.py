"""Time limit: how long the robot may go on with its order, and when it has to turn home.

The time is the robot's, from the order's beginning on; charging and pauses count, as the robot has
to be home by then. Time during which no daemon runs does not.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.core.way_back import LOOK_EVERY_S, SPARE, Lapse, seconds_back
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order_state import Stage
from fasaco_edge.mission.orders.sequencer import Sequencer


@dataclass(slots=True, eq=False)
class TimeLimit:
    """Says when the robot has to turn home to be there in time; times ``now`` are [s]."""

    config: MissionConfig
    map: MapState
    orders: Sequencer
    _looked: Lapse = field(init=False)
    _to_home_s: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        self._looked = Lapse(self.map)

    @property
    def minutes(self) -> float:
        """The limit of the order, by itself or by the configuration; 0 for none [min]."""
        order = self.orders.order_state.order
        if order is None:
            return 0.0
        usual = self.config.policy.until_min
        return usual if order.until_min is None else order.until_min

    @property
    def left_s(self) -> float | None:
        """Time at the last look until the robot has to be home; None without a limit [s]."""
        state = self.orders.order_state
        if not self.minutes or state.stage is Stage.OVER:
            return None
        return max(60.0 * self.minutes - state.spent_s, 0.0)

    def may_work_s(self, now: float) -> float:
        """Return how long it may go on from here until it has to turn home [s]."""
        left_s = self.left_s
        if left_s is None:
            return float("inf")
        return left_s - self._looked.seconds(now) - SPARE * self._to_home_s

    def is_due(self, now: float) -> bool:
        """Return whether the robot has to turn home at ``now``; to be called in each step."""
        orders, state = self.orders, self.orders.order_state
        if not self.minutes or not state.has_begun or state.stage is Stage.OVER:
            self._looked = Lapse(self.map)
            return False
        if not self._looked.has_begun or self._looked.seconds(now) >= LOOK_EVERY_S:
            orders.spend(self._looked.seconds(now))
            self._looked.begin(now)
            self._to_home_s = seconds_back("home", self.config, self.map, orders)
        return state.stage is not Stage.RETURNING and self.may_work_s(now) <= 0.0
