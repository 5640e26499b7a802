"""Incoming maps and poses: selection of the active frame, timeouts, and jumps of the pose.

A frame becomes active once both a map and a pose have arrived in it. From then on maps and poses in
other frames are refused, but the newest map in another frame is kept. The other frame becomes
active if, for ``PATIENCE_S``, map and poses arrive in it, and no pose in the active one. So a
single message in a wrong frame changes nothing. The frame of a ledger from before a restart is
active from the start.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from fasaco_edge.errors import FasacoError, WrongFrame
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.drive_meter import SPEED_MARGIN, DrivenPoses
from fasaco_edge.mission.coverage.ledger import JUMP_CELLS

# Time for which map and poses must arrive only in another frame before it becomes active [s].
PATIENCE_S = 10.0
# Longer gaps between poses restart that time [s].
GAP_S = 3.0
# A lost robot is searched for this far ahead on its line, as driving time [s].
LOST_ON_LINE_S = 10.0
# Poses are too far apart if the track to half of the last LOOKED_BACK poses is unknown.
LOOKED_BACK = 10


class FrameSelector:
    """Selects the active frame; holds the newest map and pose of up to two frames.

    Attributes:
        active: name of the active frame; "" for none.
    """

    def __init__(self) -> None:
        self.active = ""
        # Maps, and poses with their times [s], by frame, the newest last.
        self._maps: dict[str, OccupancyGrid] = {}
        self._poses: dict[str, tuple[StampedPose, float]] = {}
        # Another frame in which map and poses arrive, and when that began [s].
        self._rival, self._rival_since = "", 0.0
        # Whether a reset lets the next map and pose select the frame.
        self._is_open = False

    def activate(self, frame: str) -> None:
        """Make a frame active unconditionally."""
        self.active = frame

    def receive_map(self, grid: OccupancyGrid) -> bool:
        """Take in a map; return whether its frame becomes active."""
        self._maps.pop(grid.frame, None)
        self._maps[grid.frame] = grid
        self._limit(self._maps)
        if grid.frame == self.active or grid.frame not in self._poses or not self._may_change:
            return False
        self.active, self._is_open = grid.frame, False
        return True

    def receive_patches(
        self, patches: Sequence[MapPatch]
    ) -> tuple[list[MapPatch], list[FasacoError]]:
        """Apply updates to maps of frames that are not active.

        Returns:
            The updates that were not applied; and the faults of those applied.
        """
        others = [frame for frame in self._maps if self.active not in ("", frame)]
        faults: list[FasacoError] = []
        for frame in others:
            updated = self._maps[frame].with_updates(p for p in patches if p.frame == frame)
            self._maps[frame] = updated.grid
            wrong = f"map update in frame {frame!r}, the mission's is {self.active!r}"
            hint = f"publish map and updates in {self.active!r}; or `mission reset` to start over"
            faults += [*updated.faults, *(WrongFrame(wrong, hint=hint) for _ in updated.windows)]
        return [patch for patch in patches if patch.frame not in others], faults

    def receive_pose(self, stamped: StampedPose, now: float) -> bool:
        """Take in a pose at ``now`` [s]; return whether its frame becomes active."""
        frame = stamped.frame
        _, before = self._poses.pop(frame, (None, float("-inf")))
        self._poses[frame] = stamped, now
        self._limit(self._poses)
        if frame == self.active:
            self._rival, self._is_open = "", self._is_open and frame not in self._maps
            return False
        if frame not in self._maps:
            return False
        if not self._may_change:
            if frame != self._rival or now - before > GAP_S:
                self._rival, self._rival_since = frame, now
            if now - self._rival_since < PATIENCE_S:
                return False
        self.active, self._rival, self._is_open = frame, "", False
        return True

    @property
    def is_settled(self) -> bool:
        """Whether a frame is active, and no reset lets the next map and pose select another."""
        return bool(self.active) and not self._is_open

    @property
    def _may_change(self) -> bool:
        """Whether the next map and pose in another frame activate it at once."""
        return self._is_open or not self.active

    def reset(self) -> None:
        """Let the next map and pose select the frame.

        The present map and pose stay in use until then, as latched maps and poses of a standing
        robot are not repeated.
        """
        self._rival, self._is_open = "", True
        agreed = [frame for frame in self._poses if frame in self._maps]
        if self.active not in agreed:
            self.active = agreed[-1] if agreed else ""
        self._poses = {frame: held for frame, held in self._poses.items() if frame == self.active}

    @property
    def newest_map(self) -> OccupancyGrid | None:
        """The map in the active frame; the newest map while no frame is active."""
        if self.active:
            return self._maps.get(self.active)
        return next(reversed(self._maps.values()), None)

    @property
    def last_pose_frame(self) -> str:
        """The frame of the newest pose; "" before there is one."""
        return next(reversed(self._poses), "")

    def pose_in(self, frame: str) -> StampedPose | None:
        """Return the newest pose in a frame."""
        held = self._poses.get(frame)
        return held[0] if held else None

    def why_no_map(self) -> str:
        """Return why there is no map in the active frame."""
        others = [frame for frame in self._maps if frame != self.active]
        if not self.active or not others:
            return "no map yet"
        return (
            f"no map in frame {self.active!r} yet, in which progress is kept: the newest is in "
            f"{others[-1]!r}{self._outlook(others[-1])}"
        )

    def why_no_pose(self, map_frame: str) -> str:
        """Return why there is no current pose in the frame of the map."""
        frame = self.last_pose_frame
        if frame in ("", map_frame):
            return "no pose yet"
        return f"poses arrive in frame {frame!r}, the map is in {map_frame!r}{self._outlook(frame)}"

    def _outlook(self, frame: str) -> str:
        if frame != self._rival:
            return ""
        return (
            "; that frame is used once map and poses have arrived only in it for "
            f"{PATIENCE_S:g} s, or after a reset"
        )

    def _limit(self, held: dict[str, OccupancyGrid] | dict[str, tuple[StampedPose, float]]) -> None:
        others = [frame for frame in held if frame != self.active]
        most = 1 if self.active else 2
        for frame in others[: len(others) - most]:
            del held[frame]


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
        """Take in a pose; return whether the track from the last one is unknown."""
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
        # Consecutive poses may be some cells apart, or as far as the robot can have driven; after a
        # timeout, only half a cell.
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
