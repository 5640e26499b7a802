"""Events and decisions: the interface of the mission."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError, PlanFailed
from fasaco_edge.grid.geometry import Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.orders.order import EVERYTHING_ONCE, Command, CommandName, MissionOrder
from fasaco_edge.mission.orders.room_requests import RoomRequest
from fasaco_edge.states import State

if TYPE_CHECKING:
    # For types only: the daemon receives events before the planners are loaded.
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True)
class MapReceived:
    """A full map; ``at``: time of arrival [s] if a previous mission received it, else None."""

    grid: OccupancyGrid
    at: float | None = None


@dataclass(frozen=True, slots=True)
class PatchReceived:
    """An update: new values for a part of the map."""

    patch: MapPatch


@dataclass(frozen=True, slots=True)
class PriorityReceived:
    """Priorities of floor in the frame of the map, from 0 to 100; -1 for the room's priority."""

    grid: OccupancyGrid


@dataclass(frozen=True, slots=True)
class PatchesLost:
    """Map updates were lost: updates are refused until the next full map."""

    count: int


@dataclass(frozen=True, slots=True)
class PoseReceived:
    """A pose of the robot; ``at``: as in ``MapReceived``."""

    pose: StampedPose
    at: float | None = None


@dataclass(frozen=True, slots=True)
class BatteryReceived:
    """A battery message: charge from 0 to 1, None if unknown; state of the power supply, one of
    ``wire.messages.battery.POWERS``; time of measurement [ns], 0 if unknown."""

    level: float | None
    power: str = "unknown"
    stamp_ns: int = 0


@dataclass(frozen=True, slots=True)
class PlanReady:
    """The plan for request ``number``, its planning time [s], and when the search was stopped, see
    ``planners.planner.StopRecorder``."""

    number: int
    path: CoveragePath
    seconds: float
    stops: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanBroken:
    """The planner failed on request ``number``; ``why`` is the reason."""

    number: int
    why: PlanFailed


@dataclass(frozen=True, slots=True)
class CommandReceived:
    """Command ``number``; the rest as in ``Command``."""

    number: int
    command: CommandName
    order: MissionOrder = EVERYTHING_ONCE
    keep_out: KeepOut | None = None
    discard: bool = False
    room: RoomRequest | None = None

    @property
    def asked(self) -> Command:
        """The command itself."""
        return Command(self.command, self.order, self.keep_out, self.discard, self.room)


@dataclass(frozen=True, slots=True)
class Part:
    """A robot's part of a division: the cells nearest to a seed.

    Attributes:
        robot: its name.
        seed: cell (row, col).
        handicap_s: added to the travel times from the seed [s].
        step_s: its time to sweep one cell [s].
    """

    robot: str
    seed: tuple[int, int]
    handicap_s: float
    step_s: float


SAME_LATTICE = Pose2D(0.0, 0.0)
"""Pose of another robot's lattice in this robot's lattice, if both have the same map."""


@dataclass(frozen=True, slots=True)
class MemberReceived:
    """State of another robot of the fleet.

    Attributes:
        robot: its name.
        misfit: why it cannot belong to this fleet; "" if it can.
        frame: its map frame; "" if everything is given in this robot's frames.
        state: state of its mission.
        x, y: its position [m].
        step_s: its time to sweep one cell [s].
        epoch: epoch number of its tiles, see ``fleet.shared``.
        division: number of its newest division.
        tiles: cells it has swept, as places and bits of tiles; each message has some of its tiles.
        ground: cells it can reach, in the same form.
        by: name of the robot that made ``division``.
        parts: each robot's part of ``division``.
        radius_m: radius of its disc [m].
        ahead: points (x, y) of its next metres [m].
        waits_for: name of the robot that it waits for; "" for none.
        kept: the cells of ``tiles`` that it swept before this epoch; None if not known.
        lattice: pose of its lattice in this robot's lattice [m], used to place its cells.
    """

    robot: str
    misfit: str = ""
    frame: str = ""
    state: str = ""
    x: float = 0.0
    y: float = 0.0
    step_s: float = 1.0
    epoch: int = 0
    division: int = 0
    tiles: tuple[tuple[tuple[int, int], bytes], ...] = ()
    ground: tuple[tuple[tuple[int, int], bytes], ...] = ()
    by: str = ""
    parts: tuple[Part, ...] = ()
    radius_m: float = 0.0
    ahead: tuple[tuple[float, float], ...] = ()
    waits_for: str = ""
    kept: tuple[tuple[tuple[int, int], bytes], ...] | None = None
    lattice: Pose2D = SAME_LATTICE


@dataclass(frozen=True, slots=True)
class FollowerBlocked:
    """A report of the follower: what keeps the robot from driving its path.

    Attributes:
        revision: revision of the path; 0 if not known.
        detail: the obstruction, in words.
        held_s: its duration [s].
        frame: frame of the places.
        x, y: the robot's place [m].
        points: places x, y of the obstacle ahead [m], the nearest first; () for none.
    """

    revision: int
    detail: str
    held_s: float
    frame: str
    x: float
    y: float
    points: tuple[tuple[float, float], ...] = ()


Event = (
    MapReceived
    | PatchReceived
    | PatchesLost
    | PoseReceived
    | BatteryReceived
    | PriorityReceived
    | PlanReady
    | PlanBroken
    | CommandReceived
    | MemberReceived
    | FollowerBlocked
)


@dataclass(frozen=True, slots=True)
class PatchRun:
    """Consecutive map updates, applied together so that the map is copied once."""

    patches: tuple[MapPatch, ...]


def in_runs(events: Iterable[Event]) -> Iterator[Event | PatchRun]:
    """Yield events in order, with consecutive map updates merged into one run."""
    for kind, run in groupby(events, type):
        if kind is PatchReceived:
            patches = (event.patch for event in run if isinstance(event, PatchReceived))
            yield PatchRun(tuple(patches))
        else:
            yield from run


# Reason of a path that was improved in spare time.
BETTER = "better further on"


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """A plan to make.

    Attributes:
        number: counts the requests, from 1; ``PlanReady`` or ``PlanBroken`` returns it.
        problem: the problem to plan for.
        reason: why it is wanted.
        changed: window of the cells that changed since the previous plan; None if another reason
            applies.
    """

    number: int
    problem: CoverageProblem
    reason: str
    changed: Window | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PathUpdate:
    """A path to publish in place of the previous path.

    Attributes:
        revision: counts the published paths, from 1.
        cells: int32 (n, 2), the cells (row, col) still to be driven; n = 0 stops the robot.
        reason: why it replaces the previous path.
        plan: the plan that it comes from; None if none was needed.
        plan_s: planning time [s].
        changed: window of the cells that changed, if they are the reason; else None.
        xy: float64 (m, 2), x, y [m]: the line to drive; None for the centres of the cells.
        end_yaw: heading at the end [rad]; None for the heading of the last segment.
        yaw: float64 (m,), the robot's headings at ``xy`` [rad]; None for headings along the line.
        may_wait: whether it may be published later: the robot can follow the previous path up to
            the first difference.
        speed_m_s: speed to drive it at [m/s]; None for the robot's usual speed.
    """

    revision: int
    cells: NDArray[np.int32]
    reason: str
    plan: CoveragePath | None = None
    plan_s: float = 0.0
    changed: Window | None = None
    xy: NDArray[np.float64] | None = None
    end_yaw: float | None = None
    yaw: NDArray[np.float64] | None = None
    may_wait: bool = False
    speed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to command ``number``: its error, None if it was carried out; for ``replan`` the
    number of the coming plan."""

    number: int
    error: FasacoError | None = None
    plan: int | None = None


@dataclass(frozen=True, slots=True)
class Decision:
    """The result of a step, for the daemon to carry out.

    Attributes:
        plan: a plan to make; at most one is pending at a time.
        path: the path to publish, the last one of the step.
        faults: reasons for refused events, and other faults.
        answers: answers to the commands among the events, in order.
        forgotten: whether the ledger on disk is to be deleted, too.
    """

    plan: PlanRequest | None = None
    path: PathUpdate | None = None
    faults: tuple[FasacoError, ...] = ()
    answers: tuple[Answer, ...] = ()
    forgotten: bool = False


class Doing(NamedTuple):
    """The mission's activity in a step.

    Attributes:
        state: state of the mission.
        reason: its reason; "" to report the number of the path.
        path: a path to publish.
        plan: a plan to make.
    """

    state: State
    reason: str
    path: PathUpdate | None = None
    plan: PlanRequest | None = None
