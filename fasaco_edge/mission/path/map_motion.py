"""Map motion: coverage, reached cells, trail and path move with the map after a loop closure.

The moved map arrives first, and only the next pose shows how it moved. Until that pose
comes, the state on the previous map is kept, as the moved map changes reach, trail and path.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.coverage.loop_closure import Motion
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.events import PathUpdate
from fasaco_edge.mission.path.route import Route
from fasaco_edge.mission.path.trail_layer import TrailLayer
from fasaco_edge.mission.work.order_reach import CellsOn
from fasaco_edge.mission.work.sequencer import Sequencer
from fasaco_edge.planners.living_trail import TrailSnapshot


class _Before(NamedTuple):
    """The previous map's state: the robot's pose, reached cells, trail, path, int32 (n, 2)."""

    pose: Pose2D | None = None
    reached: CellsOn | None = None
    trail: TrailSnapshot | None = None
    path: NDArray[np.int32] | None = None


@dataclass(slots=True, eq=False)
class MapMotion:
    _ledger: MissionLedger
    _orders: Sequencer
    _trail: TrailLayer
    _route: Route
    _before: _Before = field(default=_Before(), init=False)
    # The motion that the newest pose has shown, the path before the motion, and the number of cells
    # whose coverage the motion makes uncertain; None once the path has moved.
    _shown: tuple[Motion, NDArray[np.int32] | None, int] | None = field(default=None, init=False)

    def receive_map(self, pose: Pose2D) -> None:
        """Keep the state on the previous map: the newest map has moved under a robot at ``pose``.

        If the map moves again before a pose shows how, the state before the first motion counts.
        """
        before = self._before
        self._before = _Before(
            pose,
            before.reached or self._orders.reach.reached,
            self._trail.trail.snapshot() if before.trail is None else before.trail,
            self._route.path_to_keep if before.path is None else before.path,
        )
        self._ledger.lift_tool()

    def receive_pose(self, pose: Pose2D) -> Motion | None:
        """Return the motion that a pose shows, and move all but the path with it; None for none."""
        before, self._before, self._shown = self._before, _Before(), None
        if before.pose is None:
            return None
        motion, uncertain = Motion(before.pose, pose), 0
        if not motion.is_still:
            assert before.trail is not None
            self._trail.move(before.trail, motion)
            uncertain = self._ledger.forget_uncertain(motion)
        self._orders.move_reached(before.reached, motion)
        self._shown = motion, before.path, uncertain
        return motion

    def move_path(self, now: float) -> PathUpdate | None:
        """Move the path, once the reachable area on the moved map is known.

        Ask for a plan if the motion made coverage uncertain.

        Returns:
            The path to publish at ``now`` [s]; None for none.
        """
        shown, self._shown = self._shown, None
        if shown is None:
            return None
        motion, path, uncertain = shown
        update = None
        if path is not None and len(path) and not motion.is_still:
            update = self._route.move(path, motion, now)
        if uncertain:
            self._route.requests.want(f"map and pose moved: {uncertain} cells to be covered again")
        return update

    def forget_order(self) -> None:
        """Forget reached cells and path: another order begins."""
        self._before = self._before._replace(reached=None, path=None)

    def leave_map(self) -> None:
        """Forget the trail and the state to be moved: they belong to another map."""
        self._trail.reset()
        self._before, self._shown = _Before(), None
