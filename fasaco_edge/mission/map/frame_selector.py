"""Frame selector: which frame of maps and poses is active.

A frame becomes active once both a map and a pose have arrived in it. From then on maps and poses in
other frames are refused, but the newest map in another frame is kept. The other frame becomes
active if, for ``PATIENCE_S``, map and poses arrive in it, and no pose in the active frame. So a
single message in a wrong frame changes nothing. The frame of a ledger from before a restart is
active from the start.
"""

from __future__ import annotations

from collections.abc import Sequence

from fasaco_edge.errors import FasacoError, WrongFrame
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid

# Time for which map and poses must arrive only in another frame before it becomes active [s].
PATIENCE_S = 10.0
# Longer gaps between poses restart that time [s].
GAP_S = 3.0


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
            The updates that were not applied; and the faults of the applied updates.
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
