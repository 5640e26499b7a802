"""Events and decisions: the interface of the mission."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError, PlanFailed
from fasaco_edge.grid.geometry import StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.mission.orders.order import EVERYTHING_ONCE, CommandName, MissionOrder

if TYPE_CHECKING:
    # For types only: the daemon receives events before it has loaded the planners.
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True)
class MapReceived:
    """A full map."""

    grid: OccupancyGrid


@dataclass(frozen=True, slots=True)
class PatchReceived:
    """An update: new values for a part of the map."""

    patch: MapPatch


@dataclass(frozen=True, slots=True)
class PatchesLost:
    """Map updates were lost: updates are refused until the next full map."""

    count: int


@dataclass(frozen=True, slots=True)
class PoseReceived:
    """A pose of the robot."""

    pose: StampedPose


@dataclass(frozen=True, slots=True)
class BatteryReceived:
    """What the battery says.

    Attributes:
        level: its charge from 0 to 1; None where that is not known.
        power: what the supply does, as ``wire.messages.battery.POWERS`` has it.
        stamp_ns: when that was measured [ns]; 0 where that is not known.
    """

    level: float | None
    power: str = "unknown"
    stamp_ns: int = 0


@dataclass(frozen=True, slots=True)
class PlanReady:
    """The plan for request ``number``.

    Attributes:
        number: of the request.
        path: the plan.
        seconds: how long planning took [s].
        stops: where it was stopped, see ``planners.planner.StopRecorder``.
    """

    number: int
    path: CoveragePath
    seconds: float
    stops: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanBroken:
    """The planner failed on request ``number`` by ``why``."""

    number: int
    why: PlanFailed


@dataclass(frozen=True, slots=True)
class CommandReceived:
    """Command ``number``; ``order`` goes with ``start``."""

    number: int
    command: CommandName
    order: MissionOrder = EVERYTHING_ONCE


@dataclass(frozen=True, slots=True)
class MemberHeard:
    """What another robot of the fleet says of itself.

    Attributes:
        robot: its name.
        misfit: why it cannot be of this fleet; "" where it can.
        frame: of its map.
        state: of its mission.
        x, y: where it is [m].
        step_s: what sweeping a cell takes it [s].
        epoch: of its cells, see ``fleet.shared``.
        division: number of its newest division of what is left.
        open_cells: how many cells it knows that are still to be swept.
        tiles: places and bits of what it has swept; of all tiles only some.
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
    open_cells: int = 0
    tiles: tuple[tuple[tuple[int, int], bytes], ...] = ()


Event = (
    MapReceived
    | PatchReceived
    | PatchesLost
    | PoseReceived
    | BatteryReceived
    | PlanReady
    | PlanBroken
    | CommandReceived
    | MemberHeard
)


@dataclass(frozen=True, slots=True)
class PatchRun:
    """Consecutive map updates: laid over the map together, at one copy of it."""

    patches: tuple[MapPatch, ...]


def in_runs(events: Iterable[Event]) -> Iterator[Event | PatchRun]:
    """Yield events in order, consecutive updates of the map as one."""
    for kind, run in groupby(events, type):
        if kind is PatchReceived:
            patches = (event.patch for event in run if isinstance(event, PatchReceived))
            yield PatchRun(tuple(patches))
        else:
            yield from run


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """A plan to make.

    Attributes:
        number: counts the requests, from 1; ``PlanReady`` or ``PlanBroken`` returns it.
        problem: what to plan.
        reason: why.
        changed: window of the cells that have changed since the plan before; None where that is
            not the reason.
    """

    number: int
    problem: CoverageProblem
    reason: str
    changed: Window | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PathUpdate:
    """A path to publish; it replaces the one before.

    Attributes:
        revision: counts the published paths, from 1.
        cells: int32 (n, 2), the cells (row, col) still to be driven; n = 0 stops the robot.
        reason: why it replaces the one before.
        plan: the plan it comes from; None where none was needed.
        plan_s: how long planning took [s].
        changed: window of the cells whose change is the reason; None where that is not the reason.
        xy: float64 (m, 2), x, y [m]: the line to drive; None for the centres of the cells.
        end_yaw: heading at its end [rad]; None for that of the way there.
    """

    revision: int
    cells: NDArray[np.int32]
    reason: str
    plan: CoveragePath | None = None
    plan_s: float = 0.0
    changed: Window | None = None
    xy: NDArray[np.float64] | None = None
    end_yaw: float | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to command ``number``.

    Attributes:
        number: of the command.
        error: why it was refused; None where it was carried out.
        plan: for ``replan`` the number that the new plan will have among the plans made.
    """

    number: int
    error: FasacoError | None = None
    plan: int | None = None


@dataclass(frozen=True, slots=True)
class Decision:
    """What is to be done after a step.

    Attributes:
        plan: a plan to make; there is never more than one under way.
        path: a path to publish; of several in one step only the last.
        faults: why events were refused, and faults that occurred with others.
        answers: to the commands among the events, in order.
        forgotten: whether the ledger on disk is to be deleted, too.
    """

    plan: PlanRequest | None = None
    path: PathUpdate | None = None
    faults: tuple[FasacoError, ...] = ()
    answers: tuple[Answer, ...] = ()
    forgotten: bool = False


class State(StrEnum):
    """What the mission is doing."""

    IDLE = "idle"
    WAITING_FOR_MAP = "waiting for map"
    WAITING_FOR_POSE = "waiting for pose"
    PLANNING = "planning"
    COVERING = "covering"
    RETURNING = "returning"
    CHARGING = "charging"
    PAUSED = "paused"
    BLOCKED = "blocked"
    DEGRADED = "degraded"
    DONE = "done"
