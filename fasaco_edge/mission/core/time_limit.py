"""Time limit: the time within which an order has to end, with the robot at home.

The time starts with the order, and is measured by the robot's clock. Charging and pauses count;
time without a running daemon does not.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.line.way import way_s
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order import Errand
from fasaco_edge.mission.work.order_state import Stage
from fasaco_edge.mission.work.sequencer import Sequencer

# Period of estimates [s].
LOOK_EVERY_S = 5.0
# Factor on estimated times, as lines are longer than walks over cells.
LINE_FACTOR = 1.2
# Largest ratio of simulated to real time; if stamps advance faster, their clock was set.
MOST_SPEED_UP = 30.0


class Lapse:
    """Time since a start: the longer of the times by our clock and by the robot's stamps.

    Simulated time may run ``MOST_SPEED_UP`` times as fast as ours, and stamps may stand still.
    """

    def __init__(self, map_state: MapState) -> None:
        self._map = map_state
        # Our time [s] and the pose's stamp [ns] at the start; the stamp is 0 without a pose.
        self._since: tuple[float, int] | None = None

    @property
    def has_started(self) -> bool:
        """Whether the time was started."""
        return self._since is not None

    def start(self, now: float) -> None:
        """Start at ``now`` [s]."""
        self._since = now, self._stamp_ns

    def seconds(self, now: float) -> float:
        """Return the time since the last start; 0 before the first [s]."""
        if self._since is None:
            return 0.0
        at, stamp_ns = self._since
        ours_s, newest_ns = now - at, self._stamp_ns
        theirs_s = 1e-9 * (newest_ns - stamp_ns) if stamp_ns and newest_ns else 0.0
        return theirs_s if ours_s < theirs_s <= MOST_SPEED_UP * ours_s else ours_s

    @property
    def _stamp_ns(self) -> int:
        return self._map.pose.stamp_ns if self._map.pose is not None else 0


def seconds_back(
    errand: Errand, config: MissionConfig, map_state: MapState, orders: Sequencer
) -> float:
    """Return the driving time of the way to the destination of an errand; 0 if unknown [s]."""
    cell, goal, area = map_state.cell_at_pose(), orders.goal(errand), map_state.area
    if cell is None or goal is None or area is None:
        return 0.0
    walk, sweeping, floor = area.shortest_path(cell, goal), config.sweeping, map_state.ground.floor
    if sweeping is None or floor is None or not len(walk):
        return config.cost.of_walk(walk)
    assert map_state.pose is not None
    return way_s(walk, map_state.pose.pose, floor, sweeping)


@dataclass(slots=True, eq=False)
class TimeLimit:
    """Decides when the robot has to drive home to be there in time; times ``now`` are [s]."""

    config: MissionConfig
    map: MapState
    orders: Sequencer
    _looked: Lapse = field(init=False)
    _to_home_s: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        self._looked = Lapse(self.map)

    @property
    def minutes(self) -> float:
        """The time limit, of the order or else of the configuration; 0 for none [min]."""
        order = self.orders.order_state.order
        if order is None:
            return 0.0
        usual = self.config.policy.until_min
        return usual if order.until_min is None else order.until_min

    @property
    def left_s(self) -> float | None:
        """Time until the robot has to be home, at the last estimate [s]; None without a limit."""
        state = self.orders.order_state
        if not self.minutes or state.stage is Stage.OVER:
            return None
        return max(60.0 * self.minutes - state.spent_s, 0.0)

    def may_work_s(self, now: float) -> float:
        """Return how long the robot may work from here until it has to drive home [s]."""
        left_s = self.left_s
        if left_s is None:
            return float("inf")
        return left_s - self._looked.seconds(now) - LINE_FACTOR * self._to_home_s

    def is_due(self, now: float) -> bool:
        """Return whether the robot has to drive home at ``now``; to be called in each step."""
        orders, state = self.orders, self.orders.order_state
        if not self.minutes or not state.has_begun or state.stage is Stage.OVER:
            self._looked = Lapse(self.map)
            return False
        if not self._looked.has_started or self._looked.seconds(now) >= LOOK_EVERY_S:
            orders.spend(self._looked.seconds(now))
            self._looked.start(now)
            self._to_home_s = seconds_back("home", self.config, self.map, orders)
        return state.stage is not Stage.RETURNING and self.may_work_s(now) <= 0.0
