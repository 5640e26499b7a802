"""What a mission hears and what it decides."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError, PlanFailed
from fasaco_edge.grid.geometry import StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.mission.orders.order import EVERYTHING_ONCE, CommandName, MissionOrder

if TYPE_CHECKING:
    # Only named here: the daemon hears events before it has loaded what plans.
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True)
class MapReceived:
    """A full map came in."""

    grid: OccupancyGrid


@dataclass(frozen=True, slots=True)
class PatchReceived:
    """New values for a part of the map came in."""

    patch: MapPatch


@dataclass(frozen=True, slots=True)
class PatchesLost:
    """Map updates were lost: the map is wrong until the next full one."""

    count: int


@dataclass(frozen=True, slots=True)
class PoseReceived:
    """The robot's pose came in."""

    pose: StampedPose


@dataclass(frozen=True, slots=True)
class PlanReady:
    """The plan asked for by request ``number`` is there, made in ``seconds``.

    ``stops`` tells where it was stopped, see ``planners.stopping.StopRecorder``.
    """

    number: int
    path: CoveragePath
    seconds: float
    stops: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class PlanBroken:
    """The planner broke on request ``number``; ``why`` says how."""

    number: int
    why: PlanFailed


@dataclass(frozen=True, slots=True)
class CommandReceived:
    """Somebody commands; ``order`` is what ``start`` is to start."""

    number: int
    command: CommandName
    order: MissionOrder = EVERYTHING_ONCE


Event = (
    MapReceived
    | PatchReceived
    | PatchesLost
    | PoseReceived
    | PlanReady
    | PlanBroken
    | CommandReceived
)


@dataclass(frozen=True, slots=True)
class PatchRun:
    """Map updates with nothing between them: laid over the map together, at one copy of it."""

    patches: tuple[MapPatch, ...]


def in_runs(events: Iterable[Event]) -> Iterator[Event | PatchRun]:
    """Yield events in order, updates of the map as runs."""
    run: list[MapPatch] = []
    for event in events:
        if isinstance(event, PatchReceived):
            run.append(event.patch)
            continue
        if run:
            yield PatchRun(tuple(run))
            run = []
        yield event
    if run:
        yield PatchRun(tuple(run))


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """A walk is wanted; ``reason`` says why.

    ``changed`` is the window of cells that have changed since the plan before; None where the
    reason is another.
    """

    number: int
    problem: CoverageProblem
    reason: str
    changed: Window | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PathUpdate:
    """A path to publish, in place of the one before.

    Attributes:
        revision: counts the published paths, from 1.
        cells: int32 (n, 2), the walk still to be driven; n = 0 tells the robot to stop.
        reason: why it replaces the one before.
        plan: the plan it comes from; None where none was needed.
        plan_s: how long that took [s].
        changed: window of the cells whose change is the reason; None where it is another.
    """

    revision: int
    cells: NDArray[np.int32]
    reason: str
    plan: CoveragePath | None = None
    plan_s: float = 0.0
    changed: Window | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to command ``number``: done, or why not.

    ``plan`` is the number of the plan request that ``replan`` leads to.
    """

    number: int
    error: FasacoError | None = None
    plan: int | None = None


@dataclass(frozen=True, slots=True)
class Decision:
    """What is to be done after some events.

    Attributes:
        plan: a plan to make; replaces none, there is one at a time.
        path: a path to publish; of several in one step the last is the one that holds.
        faults: events that were refused, and why; they changed nothing.
        answers: to the commands among the events, in order.
        forgotten: whether what was covered is to be forgotten on disk too.
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
    PAUSED = "paused"
    BLOCKED = "blocked"
    DEGRADED = "degraded"
    DONE = "done"
