"""Traffic rules of a fleet: which of two robots waits or makes way where their paths conflict.

Each robot publishes its disc and the next metres of its path. Where two robots would come too near
each other at about the same time, the robot farther from that place waits; at about equal distance,
the robot whose name sorts last waits. A waiting robot that stands on the other's path makes way.
So one robot at a time drives through a narrow passage.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.mission.events import MemberReceived

# Length of the path that is published and checked, spacing of its points, and clearance [m].
AHEAD_M, SPACING_M, CLEARANCE_M = 2.0, 0.1, 0.1
# Two robots conflict if they come too near each other within this time [s].
SLACK_S = 3.0
# Distance to a conflict at which a robot waits; difference up to which distances are about equal
# [m].
WAIT_M, NEARER_M = 1.0, 0.5
# A robot makes way if the first OVER_M of another robot's path leads over it [m].
OVER_M = 1.5
# A robot that has stood for STANDS_S is an obstacle; a robot that is blocked or has waited for
# PATIENCE_S makes way, or plans around the other [s].
STANDS_S, PATIENCE_S = 5.0, 6.0
# Distance within which robots publish more often [m]; silence after which robots are ignored [s].
NEAR_M, OLD_S = 4.0, 5.0

Points = NDArray[np.float64]


class Neighbour(NamedTuple):
    """Another robot.

    Attributes:
        message: its last message.
        age_s: age of the message [s].
        stands_s: how long it has stood [s].
        pace_s_m: its time per metre [s/m].
        is_avoided: whether paths are planned around it where it stands.
    """

    message: MemberReceived
    age_s: float
    stands_s: float
    pace_s_m: float
    is_avoided: bool = False


@dataclass(frozen=True, slots=True)
class Obstruction:
    """Why a robot may not go on.

    Attributes:
        robot: name of the other robot.
        is_on_path: whether this robot stands on the other's path, and must make way.
        is_blocked: whether the other stands on this robot's path.
    """

    robot: str
    is_on_path: bool = False
    is_blocked: bool = False

    @property
    def reason(self) -> str:
        """The reason of the wait, for people."""
        if self.is_blocked:
            return f"{self.robot} stands in the way"
        return f"makes way for {self.robot}" if self.is_on_path else f"waits for {self.robot}"


def least_apart_m(radius_m: float, other: MemberReceived) -> float:
    """Return the least allowed distance between the centres of two robots [m]."""
    return radius_m + other.radius_m + CLEARANCE_M


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
    pace_s_m: float,
    line: Points,
    neighbours: Mapping[str, Neighbour],
    waits_for: str,
) -> Obstruction | None:
    """Return a robot's obstruction; None if there is none.

    A robot has stopped if it waits, has no path, or has stood on its path for STANDS_S. The first
    of two robots is the robot whose name sorts first. It is this robot's turn if it is the first,
    has a path, and both wait for each other. For each other robot, the first row applies in which
    both conditions hold; "is blocked" is returned only if no robot leads to another decision.

    | the other robot | this robot | decision |
    |---|---|---|
    | its path leads over this robot; waits for no third robot | waits for the other, or has no \
path; it is not this robot's turn | makes way |
    | has stopped, at most WAIT_M / 2 ahead; waits for this robot; has a path | comes nearer to \
the other; waits for it; is the second | goes on waiting |
    | has stopped, at most WAIT_M / 2 ahead | comes nearer to the other | is blocked |
    | drives; both reach a conflict within SLACK_S of each other | is at most WAIT_M from it, and \
NEARER_M farther than the other, or about as far and the second | waits |
    | drives; both reach a conflict within twice SLACK_S | is at most WAIT_M from it; waits for \
the other | goes on waiting |

    Args:
        name: this robot's name.
        radius_m: radius of its disc [m].
        pace_s_m: its time per metre [s/m].
        line: points every SPACING_M from its place along its path, float64 (n, 2), n >= 1.
        neighbours: the other robots, by name.
        waits_for: name of the robot that it waits for already; "" for none.
    """
    blocked: Obstruction | None = None
    for other, near in sorted(neighbours.items()):
        message, clear_m = near.message, least_apart_m(radius_m, near.message)
        if math.dist(line[0], (message.x, message.y)) > NEAR_M + 2 * clear_m:
            continue
        theirs = spaced([(message.x, message.y), *message.ahead])
        apart_m = np.hypot(*(line[:, None] - theirs[None]).transpose(2, 0, 1))
        is_waiting, is_first = waits_for == other, name < other
        other_waits = message.waits_for == name
        is_over = _is_over(apart_m, clear_m)
        is_its_turn = is_waiting and other_waits and is_first and len(line) > 1
        # This robot, which waits or has no path, obstructs the other.
        is_in_its_way = is_over and (other_waits or not message.waits_for)
        if is_in_its_way and (is_waiting or len(line) == 1) and not is_its_turn:
            return Obstruction(other, is_on_path=True)
        if message.waits_for or len(theirs) == 1 or near.stands_s > STANDS_S:
            # A path planned around the other robot keeps CLEARANCE_M only at the centres of cells,
            # and only to that robot's place at the time: less is accepted here.
            passes_m = clear_m - CLEARANCE_M if near.is_avoided else clear_m
            if not _comes_to(apart_m, passes_m):
                continue
            # This robot does not wait for a robot without a path, as that will not move.
            if is_waiting and other_waits and not is_first and len(theirs) > 1:
                return Obstruction(other, is_on_path=is_over)
            blocked = blocked or Obstruction(other, is_blocked=True)
            continue
        slack_s = 2 * SLACK_S if is_waiting else SLACK_S
        meeting = _meeting(apart_m, clear_m, pace_s_m, near, slack_s)
        if meeting is None or meeting[0] > WAIT_M:
            continue
        sooner_m = meeting[0] - meeting[1]
        yields = sooner_m > 0.0 if abs(sooner_m) > NEARER_M else not is_first
        if yields or is_waiting:
            return Obstruction(other, is_on_path=is_over)
    return blocked


def _is_over(apart_m: Points, clear_m: float) -> bool:
    """Return whether the first OVER_M of the other's path leads over this robot."""
    first = apart_m[0, : int(OVER_M / SPACING_M) + 1]
    return apart_m.shape[1] > 1 and bool((first < clear_m).any())


def _comes_to(apart_m: Points, clear_m: float) -> bool:
    """Return whether this robot's path soon comes too near to the other robot's place."""
    first = np.flatnonzero(apart_m[:, 0] < clear_m)
    comes = len(first) > 0 and first[0] * SPACING_M <= WAIT_M / 2
    return bool(comes and apart_m[:, 0].min() < apart_m[0, 0] - 1e-3)


def _meeting(
    apart_m: Points, clear_m: float, pace_s_m: float, near: Neighbour, slack_s: float
) -> tuple[float, float] | None:
    """Return where two driving robots come too near each other at about the same time: the length
    of each robot's path up to there [m], this robot's first."""
    mine, theirs = apart_m.shape
    at_s = np.arange(mine) * SPACING_M * pace_s_m
    there_s = np.arange(theirs) * SPACING_M * near.pace_s_m - near.age_s
    is_meeting = (apart_m < clear_m) & (np.abs(at_s[:, None] - there_s[None]) < slack_s)
    is_meeting &= there_s > -1.0
    # Robots that move apart are too near at their present places only: no conflict.
    is_parting = is_meeting[0, 0] and apart_m.min() >= apart_m[0, 0] - 1e-3
    if is_parting or not is_meeting.any():
        return None
    mine_m = float(np.flatnonzero(is_meeting.any(axis=1))[0] * SPACING_M)
    return mine_m, float(np.flatnonzero(is_meeting.any(axis=0))[0] * SPACING_M)
