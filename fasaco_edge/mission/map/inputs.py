"""Which frame counts: map and pose decide together, never the one that came first.

A frame counts as soon as a map and a pose have come in it. From then on maps and poses in others
are refused, but the newest map of another one is held: where map and poses come in that for
``PATIENCE_S``, and no pose in the one that counts, it takes its place. A ledger from before a
restart has a frame, too: that counts from the beginning. So a single message in a wrong frame
changes nothing, whenever it comes.

Whether map and pose keep coming, and whether the pose can be believed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fasaco_edge.errors import FasacoError, WrongFrame
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid, fitting
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.ledger import JUMP_CELLS

# So long map and poses come in another frame alone before that counts [s].
PATIENCE_S = 10.0
# Poses further apart than this are no stream [s].
GAP_S = 3.0


class FrameSelector:
    """Hears all maps and poses; the newest map and pose of two frames are held at most.

    Attributes:
        counts: name of the frame that counts; "" as long as none does.
    """

    def __init__(self) -> None:
        self.counts = ""
        # By frame, the one that was heard last at the end.
        self._maps: dict[str, OccupancyGrid] = {}
        self._poses: dict[str, tuple[StampedPose, float]] = {}
        # The other frame that map and poses come in, since when, and until when.
        self._rival, self._rival_since = "", 0.0
        # Whether a reset has left it to what comes next.
        self._is_open = False

    def hear_map(self, grid: OccupancyGrid) -> bool:
        """Note a map; return whether its frame counts from now on, and did not before."""
        self._maps.pop(grid.frame, None)
        self._maps[grid.frame] = grid
        self._drop_strangers(self._maps)
        if grid.frame == self.counts or grid.frame not in self._poses or not self._may_change:
            return False
        self.counts, self._is_open = grid.frame, False
        return True

    def hear_patches(self, patches: Sequence[MapPatch]) -> tuple[list[MapPatch], list[FasacoError]]:
        """Lay updates over the map of a frame that does not count.

        Returns:
            Those of the frame that does; and why the others are not the mission's.
        """
        others = [frame for frame in self._maps if self.counts not in ("", frame)]
        faults: list[FasacoError] = []
        for frame in others:
            theirs = [patch for patch in patches if patch.frame == frame]
            fit, misfits = fitting(self._maps[frame], theirs)
            self._maps[frame] = self._maps[frame].patched(*fit)
            wrong = f"map update in frame {frame!r}, the mission's is {self.counts!r}"
            faults += [*misfits, *(WrongFrame(wrong) for _ in fit)]
        return [patch for patch in patches if patch.frame not in others], faults

    def hear_pose(self, stamped: StampedPose, now: float) -> bool:
        """Note a pose; return whether its frame counts from now on [s], and did not before."""
        frame = stamped.frame
        _, before = self._poses.pop(frame, (None, float("-inf")))
        self._poses[frame] = stamped, now
        self._drop_strangers(self._poses)
        if frame == self.counts:
            self._rival, self._is_open = "", self._is_open and frame not in self._maps
            return False
        if frame not in self._maps:
            return False
        if not self._may_change:
            if frame != self._rival or now - before > GAP_S:
                self._rival, self._rival_since = frame, now
            if now - self._rival_since < PATIENCE_S:
                return False
        self.counts, self._rival, self._is_open = frame, "", False
        return True

    @property
    def _may_change(self) -> bool:
        """Whether the next map and pose in another frame decide at once."""
        return self._is_open or not self.counts

    def forget(self) -> None:
        """Let the next map and pose decide; what was heard counts until then.

        Neither need come again: a latched map does not, nor the pose of a robot that stands.
        """
        self._rival, self._is_open = "", True
        agreed = [frame for frame in self._poses if frame in self._maps]
        if self.counts not in agreed:
            self.counts = agreed[-1] if agreed else ""
        self._poses = {frame: held for frame, held in self._poses.items() if frame == self.counts}

    @property
    def newest_map(self) -> OccupancyGrid | None:
        """The map in the frame that counts, as it came; the newest of all as long as none does."""
        if self.counts:
            return self._maps.get(self.counts)
        return next(reversed(self._maps.values()), None)

    @property
    def last_pose_frame(self) -> str:
        """The frame of the pose heard last; "" before there is one."""
        return next(reversed(self._poses), "")

    def pose_in(self, frame: str) -> StampedPose | None:
        """Return the newest pose in a frame."""
        held = self._poses.get(frame)
        return held[0] if held else None

    def refuse_map(self, grid: OccupancyGrid) -> None:
        """Raise WrongFrame where another frame counts than the map's."""
        if self.counts and grid.frame != self.counts:
            raise WrongFrame(f"map in frame {grid.frame!r}, the mission's is {self.counts!r}")

    def without_map(self) -> str:
        """Return why there is no map that counts."""
        others = [frame for frame in self._maps if frame != self.counts]
        if not self.counts or not others:
            return "no map yet"
        return (
            f"no map in frame {self.counts!r} yet, that of the progress kept: the newest is in "
            f"{others[-1]!r}{self._outlook(others[-1])}"
        )

    def without_pose(self, map_frame: str) -> str:
        """Return why there is no pose, or none any more, in the frame of the map."""
        heard = self.last_pose_frame
        if heard in ("", map_frame):
            return "no pose yet"
        return f"poses arrive in frame {heard!r}, the map is in {map_frame!r}{self._outlook(heard)}"

    def _outlook(self, frame: str) -> str:
        if frame != self._rival:
            return ""
        return (
            f"; that frame counts once map and poses have come in it for {PATIENCE_S:g} s and no "
            f"pose in {self.counts!r}, or at a reset"
        )

    def _drop_strangers(
        self, held: dict[str, OccupancyGrid] | dict[str, tuple[StampedPose, float]]
    ) -> None:
        """Keep the frame that counts and the newest other one."""
        others = [frame for frame in held if frame != self.counts]
        most = 1 if self.counts else 2
        for frame in others[: len(others) - most]:
            del held[frame]


class InputMonitor:
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
