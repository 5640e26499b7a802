"""Checks of the path: whether the robot is still on it, and whether it leads to anything."""

from __future__ import annotations

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.core.route import Route
from fasaco_edge.mission.core.standing import PATIENCE_S, Standing
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.line.layer import LineLayer
from fasaco_edge.mission.map.inputs import InputMonitor
from fasaco_edge.mission.orders.sequencer import Sequencer

# Period of checks whether a path leads to anything [s].
WORTH_S = 1.0


class PathChecks:
    """Wants a new plan where the path no longer serves the driving robot.

    None is wanted twice: nothing is checked while a plan is wanted or made.
    """

    def __init__(
        self,
        ledger: MissionLedger,
        monitor: InputMonitor,
        orders: Sequencer,
        route: Route,
        line: LineLayer,
        standing: Standing,
    ) -> None:
        self._ledger, self._monitor, self._orders = ledger, monitor, orders
        self._route, self._line, self._standing = route, line, standing
        self._worth_at = float("-inf")

    def check_deviation(self, cell: Cell, now: float) -> None:
        """Want a new plan for a robot in ``cell`` that is off its path or at its end."""
        route, monitor, path = self._route, self._monitor, self._route.path
        waited = self._standing.has_waited
        if self._has_plan_due:
            return
        if monitor.doubt:
            doubted = route.published_at < monitor.doubt_since
            if doubted and list(cell) in path.ahead[:2].tolist():
                monitor.clear_doubt()  # it only flickered
            elif waited and now - monitor.doubt_since >= PATIENCE_S:
                route.want(monitor.doubt)
            return
        last = tuple(path.cells[-1].tolist()) if len(path.cells) else None
        has_visited = last is not None and self._ledger.current.has_visited(last)
        # A path may lead no further than the robot's cell: it may yet turn to drive it.
        has_stopped = waited and not self._standing.turns
        at_end = path.finished and (has_visited or has_stopped)
        if at_end or (has_stopped and self._standing.is_at(last)):
            self._line.open_missed()
            if self._orders.note_path_end():
                self._orders.advance(now)
            else:
                route.want("cells left over")
        elif waited and (path.is_far(cell) or self._standing.is_beside_path):
            route.want("robot left the path")

    def check_worth(self, now: float) -> None:
        """Want a new plan for a fleet's robot where others have swept all that lay ahead."""
        route = self._route
        is_due = now - self._worth_at >= WORTH_S
        if not is_due or self._has_plan_due or len(route.path.ahead) <= 1:
            return
        self._worth_at = now
        if not self._line.is_worth_driving and not self._orders.cells.left_to_me():
            route.want("others have swept what lay ahead")

    @property
    def _has_plan_due(self) -> bool:
        """Whether a plan is being made, or wanted."""
        return self._route.pending is not None or bool(self._route.wanted)
