"""Whether map and pose keep coming, and whether the pose can be believed."""

from __future__ import annotations

import math

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.ledger import JUMP_CELLS


class Watch:
    """Notes when maps and poses come. All times are [s], of the mission's clock.

    Attributes:
        doubt: why the robot may be elsewhere than its path says; "" where it is not. Stays
            until a plan was made anew, or the robot turned out to be on its path.
        doubt_since: when that began.
    """

    def __init__(self, config: MissionConfig) -> None:
        self.doubt = ""
        self.doubt_since = 0.0
        self._config = config
        self._pose: Pose2D | None = None
        self._pose_at = 0.0
        self._map_at = 0.0
        # The plan that was asked for from where the doubtful pose is.
        self._answered_by = -1

    def map_came(self, now: float) -> None:
        """Note a map or an update."""
        self._map_at = now

    def pose_came(self, pose: Pose2D, now: float) -> bool:
        """Note a pose; return whether nobody knows how the robot came there from the last one."""
        last, lost = self._pose, self.pose_lost(now)
        self._pose, self._pose_at = pose, now
        if last is None:
            return False
        distance = math.hypot(pose.x - last.x, pose.y - last.y)
        # Poses close in time may lie some cells apart; of one lost, half a cell is a hole.
        jumped = distance > (0.5 if lost else JUMP_CELLS) * self._config.footprint.cell_m
        if jumped:
            how = f"came back {distance:.2f} m from where it was lost"
            self._answered_by = -1
            self.doubt_since = self.doubt_since if self.doubt else now
            self.doubt = f"the pose {how if lost else f'jumped {distance:.2f} m'}"
        return jumped or lost

    def forget_pose(self) -> None:
        """Forget the last pose: the next one is in another frame."""
        self._pose, self.doubt = None, ""

    def plan_asked(self, number: int) -> None:
        """Note that plan ``number`` is made from where the robot is now."""
        self._answered_by = number

    def plan_made(self, number: int) -> None:
        """Note that plan ``number`` is there."""
        if number == self._answered_by:
            self.doubt = ""

    def pose_lost(self, now: float) -> bool:
        """Tell whether poses have stopped coming."""
        limit = self._config.lost_pose_s
        return self._pose is not None and 0 < limit < now - self._pose_at

    def trouble(self, now: float) -> str:
        """Return what is not as it should be, "" for nothing."""
        if self.pose_lost(now):
            return (
                f"no pose for {self._config.lost_pose_s:g} s: the path is kept, but nothing "
                "counts as covered until one comes"
            )
        if self.doubt:
            return self.doubt
        limit = self._config.stale_map_s
        if 0 < limit < now - self._map_at:
            return f"no map or update for {limit:g} s: going on with the last one"
        return ""
