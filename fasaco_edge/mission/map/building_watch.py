"""Building watch: whether the newest map still shows the building of the ledger.

A new map in the same frame may show another floor, another building, or the same building rotated.
Then the cells known to both maps are equal (blocked or free) no more often than by chance: Cohen's
kappa, 1 for equal maps, is about 0. After a loop closure the maps agree if the previous map is
moved in the same way as the robot's pose. If they still disagree, the robot stands still. If they
disagree for some seconds, the map shows another building. If a mapper alternates between two
buildings, the robot stands until one of them stays.

Each map is compared with a reference some seconds old, not with the previous map: maps sent in
parts, and the first maps of a restarted mapper, differ from the previous map in any building.

Measured on 5 buildings, cells of 0.3 m: the highest kappa of two buildings is 0.22, and 0.35 for
the first 2 m that a scanner sees in another building. The lowest kappa in one building is 0.59 for
maps shifted by 0.3 m, and 0.32 by 0.6 m; 0.67 if furniture moves on 10 % of the coverable cells,
and 0.34 on 30 %. Floors with equal walls count as one building, so each floor needs its own frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.lattice import BLOCKED, UNKNOWN, CoverageLattice
from fasaco_edge.mission.coverage.loop_closure import LEAST_CELLS, Motion

# Two maps are alike if less than this share of the cells known to both differs.
LEAST_SHARE = 0.05
# Two maps show different buildings if kappa is below FOREIGN. Above ALIKE they show the same
# building, even if covered cells are blocked.
FOREIGN, ALIKE = 0.3, 0.7
# A motion of the map explains the difference of two maps if it raises kappa by this much.
BETTER = 0.1
# Limit on the cells compared.
MOST_CELLS = 20_000
# Longest time from a map to the pose that shows its motion, before the robot stops [s].
GRACE_S = 0.5
# Maps must show another building for PATIENCE_S before it is accepted, and the previous building
# for SETTLED_S before the robot drives again [s]. PATIENCE_S doubles with each change of building
# within SOON_S, up to LONGEST-fold.
PATIENCE_S, SETTLED_S, SOON_S, LONGEST = 5.0, 5.0, 600.0, 16
# The reference is replaced at age AGE_S [s], if the new map knows KNOWN_SHARE of its cells.
AGE_S, KNOWN_SHARE = 5.0, 0.5
# Longest time from a jump of the pose to the map that has moved with it [s].
JUMP_S = 6.0

# The motion of a map that has not moved.
STILL = Motion(Pose2D(0.0, 0.0), Pose2D(0.0, 0.0))


@dataclass(frozen=True, slots=True)
class Agreement:
    """Counts of the cells that two maps know.

    Attributes:
        known: number of cells known to both.
        blocked: number of known cells blocked on the first map, and on the second.
        both: number of known cells blocked on both.
    """

    known: int
    blocked: tuple[int, int]
    both: int

    @classmethod
    def of(cls, before: CoverageLattice, after: CoverageLattice, motion: Motion = STILL) -> Self:
        """Compare two lattices, the first one moved by ``motion``; large ones by a sample."""
        places = np.flatnonzero(after.states != UNKNOWN)
        stride = 1 + len(places) // MOST_CELLS
        places = places[::stride]
        rows, cols = np.divmod(places, max(after.window.cols, 1))
        y, x = (
            (cells + first + 0.5) * after.cell_m
            for cells, first in ((rows, after.window.row0), (cols, after.window.col0))
        )
        x, y = motion.back(1.0, x, y)
        cells = np.floor(np.stack((y, x), axis=1) / before.cell_m).astype(np.int32)
        then = before.window.values_at(before.states, cells, UNKNOWN)
        is_known = then != UNKNOWN
        was_blocked = then[is_known] == BLOCKED
        is_blocked = after.states.ravel()[places][is_known] == BLOCKED
        first, second, both = (
            stride * int(np.count_nonzero(blocked))
            for blocked in (was_blocked, is_blocked, was_blocked & is_blocked)
        )
        return cls(stride * len(was_blocked), (first, second), both)

    @property
    def changed(self) -> int:
        """Number of cells that are blocked on one of the maps and free on the other."""
        return sum(self.blocked) - 2 * self.both

    @property
    def is_close(self) -> bool:
        """Whether too few cells differ for a decision."""
        return self.changed < max(LEAST_CELLS, LEAST_SHARE * self.known)

    @property
    def kappa(self) -> float:
        """Cohen's kappa: 1 for equal maps, 0 for agreement by chance."""
        if not self.known:
            return 1.0
        first, second = (count / self.known for count in self.blocked)
        by_chance = first * second + (1.0 - first) * (1.0 - second)
        alike = 1.0 - self.changed / self.known
        return 1.0 if by_chance >= 1.0 else (alike - by_chance) / (1.0 - by_chance)


class BuildingWatch:
    """Compares each map with the previous building. Times are [s], lattices of cell centres.

    Attributes:
        why: why the robot has to stand; "" if it may drive.
    """

    def __init__(self) -> None:
        self.why = ""
        self._reference: CoverageLattice | None = None
        self._reference_at = 0.0
        self._newest: CoverageLattice | None = None
        # Time of the first map that disagrees with the reference, its agreement, and the pose at
        # that time; None while the newest map agrees.
        self._foreign: tuple[float, Agreement, Pose2D | None] | None = None
        self._agreed_at = 0.0
        # Whether the newest map shows no floor, so that nothing is decided.
        self._is_blind = False
        # Number of changes of building, and the time of the last change.
        self._changes, self._changed_at = 0, float("-inf")
        # If the newest map shows the same building with changes: its agreement with the reference,
        # and the pose at that time; None after the next pose.
        self._shifted: tuple[Agreement, Pose2D] | None = None
        # Whether a loop closure was found since the last ``pop_closure``.
        self._has_closed = False
        self._jump: tuple[Motion, float] | None = None

    @property
    def is_foreign(self) -> bool:
        """Whether the newest map shows another building, judged by the poses received."""
        return self._foreign is not None

    def reset(self) -> None:
        """Take the next map as the first map."""
        self.why, self._reference, self._newest = "", None, None
        self._foreign = self._jump = self._shifted = None
        self._has_closed = self._is_blind = False

    def accept_building(self, now: float) -> None:
        """Accept the newest map's building as the robot's."""
        self._changes = 1 + (self._changes if now - self._changed_at < SOON_S else 0)
        self._changed_at = now
        self._end(now)
        self.why = ""

    def record_jump(self, start: Pose2D, end: Pose2D, now: float) -> None:
        """Record a jump of the pose: a map that has moved with it may follow."""
        self._jump = Motion(start, end), now

    def receive_blank_map(self) -> None:
        """Take in a map without floor: it shows no building, and time with it does not count."""
        self._is_blind = True

    def receive_map(
        self,
        lattice: CoverageLattice,
        pose: Pose2D | None,
        now: float,
        contradicts: Callable[[], bool],
    ) -> Pose2D | None:
        """Compare a map with the previous building.

        Args:
            lattice: cell centres of the map.
            pose: the robot's pose on the previous map.
            now: time.
            contradicts: returns whether the covered cells contradict the map; called if the walls
                do not decide.

        Returns:
            The robot's pose on the previous map; not ``pose`` if the pose moved before the map.
        """
        self._newest, before = lattice, self._reference
        if self._is_blind and self._foreign is not None:
            self._foreign = now, *self._foreign[1:]
        self._is_blind = False
        if before is None:
            self._reference, self._reference_at, self._agreed_at = lattice, now, now
            return pose
        seen = Agreement.of(before, lattice)
        if seen.is_close:
            self._agree(lattice, now)
            return pose
        jump, self._jump = self._jump, None
        is_recent = jump is not None and now - jump[1] <= JUMP_S
        if jump is not None and is_recent and pose is not None and self._explains(jump[0], seen):
            self._end(now)
            self._has_closed = True
            return _before(jump[0], pose)
        if seen.kappa >= ALIKE or not (seen.kappa < FOREIGN or contradicts()):
            self._agree(lattice, now)
            self._shifted = None if pose is None else (seen, pose)
        elif self._foreign is None:
            self._foreign = now, seen, pose
        return pose

    def receive_pose(self, pose: Pose2D, now: float) -> bool:
        """Take in a pose; return whether the newest map shows the building, perhaps moved."""
        shifted, self._shifted = self._shifted, None
        if self._foreign is not None:
            _, seen, before = self._foreign
        elif shifted is not None:
            seen, before = shifted
        else:
            return True
        if before is None or not self._explains(Motion(before, pose), seen):
            return self._foreign is None
        self._end(now)
        self.why, self._has_closed = "", True
        return True

    def pop_closure(self) -> bool:
        """Return whether a loop closure has been found since the last call."""
        has_closed, self._has_closed = self._has_closed, False
        return has_closed

    def update(self, now: float) -> bool:
        """Update ``why``; return whether the map has shown another building for long enough."""
        if self._is_blind:
            return False
        if self._foreign is None:
            if now - self._agreed_at >= SETTLED_S:
                self.why = ""
            return False
        for_s = now - self._foreign[0]
        is_soon = now - self._changed_at < SOON_S
        patience_s = PATIENCE_S * min(2**self._changes, LONGEST) if is_soon else PATIENCE_S
        if for_s >= GRACE_S:
            self.why = (
                "the map shows another building, or another floor, and the pose has not moved "
                f"with it: waits until maps have shown that for {patience_s:g} s, or the previous "
                f"building for {SETTLED_S:g} s"
            )
        return for_s >= patience_s

    def _explains(self, motion: Motion, seen: Agreement) -> bool:
        """Return whether the newest map shows the previous building, moved as the poses show."""
        if motion.is_still or self._reference is None or self._newest is None:
            return False
        moved = Agreement.of(self._reference, self._newest, motion)
        is_known = moved.known >= KNOWN_SHARE * seen.known
        return is_known and moved.kappa >= max(FOREIGN, seen.kappa + BETTER)

    def _agree(self, lattice: CoverageLattice, now: float) -> None:
        assert self._reference is not None
        if self._foreign is not None:
            self._foreign, self._agreed_at = None, now
        if now - self._reference_at < AGE_S or self.why:
            return
        known, before = (
            int(np.count_nonzero(one.states != UNKNOWN)) for one in (lattice, self._reference)
        )
        if known >= KNOWN_SHARE * before:
            self._reference, self._reference_at = lattice, now

    def _end(self, now: float) -> None:
        self._reference, self._reference_at, self._agreed_at = self._newest, now, now
        self._foreign = self._jump = self._shifted = None


def _before(motion: Motion, pose: Pose2D) -> Pose2D:
    """Return where a pose was before a motion of the map."""
    (x,), (y,) = motion.back(1.0, np.array([pose.x]), np.array([pose.y]))
    return Pose2D(float(x), float(y), pose.yaw - motion.end.yaw + motion.start.yaw)
