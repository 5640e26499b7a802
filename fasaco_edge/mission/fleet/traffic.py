"""Traffic: robots of a fleet keep out of each other's way.

Each robot tells its disc and the next metres of its path. Where two would come too near each other
at about the same time, the one farther from that place waits; at about equal distance the one with
the later name. A waiting robot that stands on the other's path makes way for it. So a narrow
passage is given to one robot at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.fleet.split import FAR, ways_from
from fasaco_edge.mission.core.events import MemberHeard
from fasaco_edge.mission.map.reachable_area import ReachableArea

# Length of the path told and checked, spacing of the points checked, and clearance [m].
AHEAD_M, SPACING_M, CLEARANCE_M = 2.0, 0.1, 0.1
# Two robots conflict if they come too near each other within this time [s].
SLACK_S = 3.0
# Distance to a conflict from which on a robot waits; difference of two distances that counts [m].
WAIT_M, NEARER_M = 1.0, 0.5
# A robot makes way for one whose path leads over it within this length [m].
OVER_M = 1.5
# A robot is an obstacle once it has stood for this long; one that is blocked or waits for this long
# makes way, or plans around the other [s].
STANDS_S, PATIENCE_S = 5.0, 6.0
# Robots this near tell each other more often [m]; robots silent for longer do not count [s].
NEAR_M, OLD_S = 4.0, 5.0

Points = NDArray[np.float64]


class Neighbour(NamedTuple):
    """Another robot, as it was heard last.

    Attributes:
        heard: its message.
        age_s: age of the message [s].
        stands_s: how long it has stood [s].
    """

    heard: MemberHeard
    age_s: float
    stands_s: float


@dataclass(frozen=True, slots=True)
class Obstruction:
    """Why a robot may not go on.

    Attributes:
        robot: name of the other robot.
        is_on_path: whether this robot stands on the other's path, and is to make way.
        is_blocked: whether the other stands on this robot's path.
    """

    robot: str
    is_on_path: bool = False
    is_blocked: bool = False

    @property
    def reason(self) -> str:
        """The obstruction as text."""
        if self.is_blocked:
            return f"{self.robot} stands in the way"
        return f"makes way for {self.robot}" if self.is_on_path else f"waits for {self.robot}"


def spaced(points: Sequence[tuple[float, float]] | Points) -> Points:
    """Return points every SPACING_M along the first AHEAD_M of a polyline [m], float64 (n, 2)."""
    line = np.asarray(points, np.float64).reshape(-1, 2)
    lengths = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    end = min(float(lengths[-1]), AHEAD_M)
    at = np.arange(0.0, end + 1e-9, SPACING_M)
    return np.column_stack([np.interp(at, lengths, column) for column in line.T])


def obstruction(
    name: str,
    radius_m: float,
    speed_m_s: float,
    line: Points,
    neighbours: Mapping[str, Neighbour],
    waits_for: str,
) -> Obstruction | None:
    """Return what keeps a robot from going on; None for nothing.

    Args:
        name: its name.
        radius_m: of its disc [m].
        speed_m_s: its speed [m/s].
        line: points every SPACING_M from its place along its path, float64 (n, 2), n >= 1.
        neighbours: the other robots, by name.
        waits_for: name of the robot that it waits for already; "" for none.
    """
    found: Obstruction | None = None
    for other, near in sorted(neighbours.items()):
        heard, clear_m = near.heard, radius_m + near.heard.radius_m + CLEARANCE_M
        if math.dist(line[0], (heard.x, heard.y)) > NEAR_M + 2 * clear_m:
            continue
        theirs = spaced([(heard.x, heard.y), *heard.ahead])
        apart = np.hypot(*(line[:, None] - theirs[None]).transpose(2, 0, 1))
        is_close = apart < clear_m
        is_first = name < other
        over = np.flatnonzero(is_close[0, : int(OVER_M / SPACING_M) + 1])
        has_stopped = heard.waits_for != "" or len(theirs) == 1
        is_over = len(over) > 0 and len(theirs) > 1
        # The other cannot go on because of this robot, which waits or has no business of its own.
        is_for_me = heard.waits_for in ("", name)
        has_way = is_first and waits_for == other and heard.waits_for == name
        if is_over and is_for_me and (waits_for == other or len(line) == 1) and not has_way:
            return Obstruction(other, is_on_path=True)
        if has_stopped:
            # Only its disc is in the way, where this robot comes nearer to it.
            first = np.flatnonzero(is_close[:, 0])
            comes = len(first) > 0 and first[0] * SPACING_M <= WAIT_M / 2
            if comes and apart[:, 0].min() < apart[0, 0] - 1e-3:
                if heard.waits_for == name and not is_first and waits_for == other:
                    return Obstruction(other, is_on_path=is_over)
                found = found or Obstruction(other, is_blocked=True)
            continue
        at_s = np.arange(len(line)) * SPACING_M / speed_m_s
        # The other one is taken to be as fast.
        there_s = np.arange(len(theirs)) * SPACING_M / speed_m_s - near.age_s
        slack_s = 2 * SLACK_S if waits_for == other else SLACK_S
        meets = is_close & (np.abs(at_s[:, None] - there_s[None]) < slack_s) & (there_s > -1.0)
        # Robots that part from each other are too near only now.
        if not meets.any() or (meets[0, 0] and apart.min() >= apart[0, 0] - 1e-3):
            continue
        mine_m = np.flatnonzero(meets.any(axis=1))[0] * SPACING_M
        theirs_m = np.flatnonzero(meets.any(axis=0))[0] * SPACING_M
        if mine_m > WAIT_M:
            continue
        yields = mine_m > theirs_m if abs(mine_m - theirs_m) > NEARER_M else not is_first
        if yields or waits_for == other:
            return Obstruction(other, is_on_path=is_over)
    return found


def refuge(
    area: ReachableArea,
    cell: Cell,
    radius_m: float,
    neighbours: Mapping[str, Neighbour],
    places: Callable[[NDArray[np.int32]], Points],
) -> Cell | None:
    """Return the nearest cell off the discs and paths of other robots; None for none.

    The way there leads through none of their discs.

    Args:
        area: the reachable area.
        cell: the robot's cell.
        radius_m: radius of its disc [m].
        neighbours: the other robots.
        places: returns the points of cells.
    """
    lattice, window = area.lattice, area.lattice.window
    reach = math.ceil((2 * AHEAD_M + 2.0) / lattice.cell_m)
    row, col = lattice.local(cell)
    rows = slice(max(row - reach, 0), row + reach + 1)
    cols = slice(max(col - reach, 0), col + reach + 1)
    steps = lattice.steps[rows, cols].copy()
    at = np.argwhere(area.reachable[rows, cols])
    corner = np.array((window.row0 + rows.start, window.col0 + cols.start))
    points = places((at + corner).astype(np.int32))
    is_free, is_passable = np.ones(len(at), np.bool_), np.ones(len(at), np.bool_)
    here = (at == (row - rows.start, col - cols.start)).all(axis=1)
    for near in neighbours.values():
        heard = near.heard
        clear_m = radius_m + heard.radius_m + CLEARANCE_M
        theirs = spaced([(heard.x, heard.y), *heard.ahead])
        apart = np.hypot(*(points[:, None] - theirs[None]).transpose(2, 0, 1))
        is_free &= (apart >= clear_m).all(axis=1)
        is_passable &= (apart[:, 0] >= clear_m) | here
        if here.any():
            # From too near it may go where it is farther.
            is_passable |= apart[:, 0] > apart[here, 0].max() + 1e-6
    closed = np.zeros(steps.shape, np.bool_)
    closed[tuple(at[~is_passable].T)] = True
    steps = _inside(without(steps, closed))
    away = ways_from(steps, (row - rows.start) * steps.shape[1] + col - cols.start)
    away = np.where(is_free, away.reshape(steps.shape)[tuple(at.T)], FAR)
    if not len(away) or away.min() >= FAR:
        return None
    best = at[int(away.argmin())] + corner
    return int(best[0]), int(best[1])


def _inside(steps: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the step masks of a part of a lattice without those that lead out of it."""
    edges = ((EAST, np.s_[:, -1]), (WEST, np.s_[:, 0]), (NORTH, np.s_[-1]), (SOUTH, np.s_[0]))
    for direction, edge in edges:
        steps[edge] &= np.uint8(0xFF ^ (1 << direction))
    return steps


def without(steps: NDArray[np.uint8], closed: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return step masks without steps from and to closed cells, uint8 (rows, cols)."""
    steps = np.where(closed, 0, steps).astype(np.uint8)
    for direction, here, there in (
        (EAST, np.s_[:, :-1], np.s_[:, 1:]),
        (WEST, np.s_[:, 1:], np.s_[:, :-1]),
        (NORTH, np.s_[:-1], np.s_[1:]),
        (SOUTH, np.s_[1:], np.s_[:-1]),
    ):
        steps[here] &= ~(closed[there].astype(np.uint8) << direction)
    return steps
