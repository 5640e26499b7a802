"""Input monitor: timeouts of maps and poses, and jumps of the pose."""

from __future__ import annotations

import math
from collections import deque

from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.driven_poses import SPEED_MARGIN, DrivenPoses
from fasaco_edge.mission.coverage.ledger import JUMP_CELLS

# After a gap in the poses, the robot is searched for on its line within this driving time [s].
LOST_ON_LINE_S = 10.0
# Poses are too far apart if the track to half of the last LOOKED_BACK poses is unknown.
LOOKED_BACK = 10


class InputMonitor:
    """Timeouts of maps and poses, and jumps between poses. All times are [s].

    Attributes:
        doubt: why the robot may be off its path; "" for none. Cleared when a plan from the new
            position arrives, or the robot is found on its path.
        doubt_since: start of the doubt.
        farthest_m: longest possible drive between the last two poses, by their stamps and the
            robot's speed; 0 if unknown [m].
        on_line_m: longest possible drive along the line, also if the track between the two poses is
            unknown [m].
        pose_at, map_at: time of the last pose, and of the last map or update. Before the first
            message, the time from which it is due; None before ``start_timeouts``.
        driven: selects the poses that count for swept floor.
    """

    def __init__(self, config: MissionConfig) -> None:
        self.doubt = ""
        self.doubt_since = self.farthest_m = self.on_line_m = 0.0
        self.driven = DrivenPoses(config.speed_m_s, config.footprint.cell_m)
        self._config = config
        # For each of the newest poses: whether the track to it is unknown.
        self._gaps: deque[bool] = deque(maxlen=LOOKED_BACK)
        self._pose: StampedPose | None = None
        # Whether a pose has arrived, in any frame.
        self._has_pose = False
        self.pose_at: float | None = None
        self.map_at: float | None = None
        # Number of the plan requested from the doubtful pose.
        self._answered_by = -1

    def start_timeouts(self, now: float) -> None:
        """Count map and pose as due from ``now`` on, unless they have arrived."""
        self.pose_at = now if self.pose_at is None else self.pose_at
        self.map_at = now if self.map_at is None else self.map_at

    def continue_from(self, before: InputMonitor) -> None:
        """Take over the times of another monitor."""
        self._has_pose, self.pose_at = before._has_pose, before.pose_at
        self.map_at = before.map_at

    def receive_map(self, now: float) -> None:
        """Take in a map or an update."""
        self.map_at = now

    def receive_pose(self, stamped: StampedPose, now: float) -> bool:
        """Take in a pose; return whether the track from the last pose is unknown."""
        last, lost, pose = self._pose, self.is_pose_lost(now), stamped.pose
        self._pose, self.pose_at, self._has_pose = stamped, now, True
        self.farthest_m = self.on_line_m = 0.0
        if last is None:
            return False
        if lost:
            self.driven.break_track()
        else:
            self.farthest_m = self.driven.farthest_m(last, stamped)
        gap_s = min((stamped.stamp_ns - last.stamp_ns) * 1e-9, LOST_ON_LINE_S)
        self.on_line_m = SPEED_MARGIN * self._config.speed_m_s * max(gap_s, 0.0)
        distance = math.hypot(pose.x - last.pose.x, pose.y - last.pose.y)
        # Consecutive poses may be some cells apart, or as far as the robot could have driven; after
        # a timeout, only half a cell.
        most_m = (0.5 if lost else JUMP_CELLS) * self._config.footprint.cell_m
        jumped = distance > max(most_m, self.farthest_m)
        if jumped:
            how = f"came back {distance:.2f} m from where it was lost"
            self._answered_by = -1
            self.doubt_since = self.doubt_since if self.doubt else now
            self.doubt = f"the pose {how if lost else f'jumped {distance:.2f} m'}"
        self._gaps.append(jumped or lost)
        return jumped or lost

    @property
    def are_poses_far_apart(self) -> bool:
        """Whether most of the track is unknown, so that driving does not count."""
        return 2 * sum(self._gaps) >= LOOKED_BACK

    def forget_pose(self, now: float) -> None:
        """Forget the last pose: the next pose, due from now on, is in another frame."""
        self._pose, self.pose_at, self.doubt = None, now, ""
        self.driven.break_track()

    def clear_doubt(self) -> None:
        """Trust the robot's pose."""
        self.doubt = ""

    def record_request(self, number: int) -> None:
        """Record that plan ``number`` starts at the robot's present position."""
        self._answered_by = number

    def receive_plan(self, number: int) -> None:
        """End the doubt if plan ``number`` starts at the doubtful pose."""
        if number == self._answered_by:
            self.doubt = ""

    def pose_silent_s(self, now: float) -> float:
        """Return the time since the last pose, or since the beginning [s]."""
        return 0.0 if self.pose_at is None else now - self.pose_at

    def map_silent_s(self, now: float) -> float:
        """Return the time since the last map or update, or since the beginning [s]."""
        return 0.0 if self.map_at is None else now - self.map_at

    def is_pose_lost(self, now: float) -> bool:
        """Return whether poses have timed out."""
        limit = self._config.policy.lost_pose_s
        return self._has_pose and 0 < limit < self.pose_silent_s(now)

    def is_map_stale(self, now: float) -> bool:
        """Return whether maps and updates have timed out."""
        return 0 < self._config.policy.stale_map_s < self.map_silent_s(now)

    def is_sound(self, now: float) -> bool:
        """Return whether pose and map can be relied on."""
        return not (self.is_pose_lost(now) or self.doubt or self.is_map_stale(now))
