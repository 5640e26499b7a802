"""Way back: how long the robot takes to home or to its dock, and how old such an estimate is."""

from __future__ import annotations

from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.line.way import way_s
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order import Errand
from fasaco_edge.mission.orders.sequencer import Sequencer

# Period of estimates [s].
LOOK_EVERY_S = 5.0
# Factor on estimated times, as lines are longer than walks over cells.
SPARE = 1.2
# Simulated robots run at some 20 times our clock; where stamps run faster, their clock was set.
FASTEST = 30.0


class Lapse:
    """Measures time since a look: the longer one by our clock and by the robot's.

    Simulated time may run faster than ours, up to ``FASTEST``, and stamps may stand still.
    """

    def __init__(self, map_state: MapState) -> None:
        self._map = map_state
        # Our time [s] and the stamp of the pose [ns], 0 without one, at the last look; None before
        # the first.
        self._since: tuple[float, int] | None = None

    @property
    def has_begun(self) -> bool:
        """Whether there was a look."""
        return self._since is not None

    def begin(self, now: float) -> None:
        """Note a look at ``now`` [s]."""
        self._since = now, self._stamp_ns

    def seconds(self, now: float) -> float:
        """Return the time since the last look; 0 before the first [s]."""
        if self._since is None:
            return 0.0
        at, stamp_ns = self._since
        ours_s, newest_ns = now - at, self._stamp_ns
        theirs_s = 1e-9 * (newest_ns - stamp_ns) if stamp_ns and newest_ns else 0.0
        return theirs_s if ours_s < theirs_s <= FASTEST * ours_s else ours_s

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
    walk, sweeping, floor = area.shortest_path(cell, goal), config.sweeping, map_state.floor
    if sweeping is None or floor is None or not len(walk):
        return config.cost.of_walk(walk)
    assert map_state.pose is not None
    return way_s(walk, map_state.pose.pose, floor, sweeping)
