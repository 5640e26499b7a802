"""Startup: what arrives before there is a mission, and the loading of mission and planner.

The first map starts the loading of kernels; until then the daemon is small. Importing numba costs
60 MB, and compiling on a new machine takes many seconds: a thread of its own does both, so that
the loop keeps answering.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.ledger.writer import LedgerKeeper
from fasaco_edge.errors import CommandError, FasacoError, PatchWithoutBase
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid, without_base
from fasaco_edge.host.processes import release_unused
from fasaco_edge.mission.core.events import (
    Answer,
    CommandReceived,
    Event,
    MapReceived,
    PatchesLost,
    PatchRun,
    PoseReceived,
    in_runs,
)

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.worker import PlanningWorker
    from fasaco_edge.mission.core.mission import Mission


class Startup:
    """Holds events and takes commands until the mission is loaded.

    Attributes:
        assignment: what the mission will have to do.
        held: the newest map, with its updates applied, and the newest pose of each of the newest
            two frames: which frame counts is for the mission to decide. That updates were lost
            stays until the next map. However long it takes, this does not grow.
    """

    def __init__(
        self, keeper: LedgerKeeper, load: Callable[[], Loader], held: Sequence[Event] = ()
    ) -> None:
        self.assignment = keeper.first
        self.held = list(held)
        self._keeper = keeper
        self._load = load
        self._loader: Loader | None = None

    @property
    def stage(self) -> str:
        """What is being loaded; "" for nothing, or nothing more."""
        return self._loader.stage if self._loader and not self._loader.is_done else ""

    def end(self) -> None:
        """Drop what is loaded, or being loaded: another startup follows."""
        if self._loader is not None:
            self._loader.drop()

    def take(self, events: Sequence[Event]) -> list[FasacoError]:
        """Hold events; return why some are of no use."""
        faults: list[FasacoError] = []
        for event in in_runs(events):
            match event:
                case MapReceived(grid):
                    self._drop(lambda held: not _is_pose(held), grid.frame)
                    self.held.append(event)
                case PoseReceived(pose):
                    self._drop(_is_pose, pose.frame)
                    self.held.append(event)
                case PatchRun(patches):
                    faults += self._apply(patches)
                case PatchesLost(count):
                    faults.append(PatchWithoutBase(f"{count} map updates were lost"))
                    if self._maps() and not self._has_lost:
                        self.held.append(event)
        return faults

    def _maps(self) -> dict[str, tuple[int, OccupancyGrid]]:
        """Return the map of each frame, and its index in ``held``."""
        return {
            held.grid.frame: (index, held.grid)
            for index, held in enumerate(self.held)
            if isinstance(held, MapReceived)
        }

    @property
    def _has_lost(self) -> bool:
        return any(isinstance(held, PatchesLost) for held in self.held)

    def _apply(self, patches: Sequence[MapPatch]) -> list[FasacoError]:
        """Apply updates to the maps held; return why some cannot be."""
        maps = self._maps()
        if not maps or self._has_lost:
            return without_base(patches, updates_lost=bool(maps))
        faults: list[FasacoError] = []
        newest = next(reversed(maps))
        for frame, (index, grid) in maps.items():
            # An update of neither frame is a misfit of the newest map.
            theirs = [p for p in patches if (p.frame if p.frame in maps else newest) == frame]
            updated = grid.with_updates(theirs)
            self.held[index] = MapReceived(updated.grid)
            faults += updated.faults
        return faults

    def _drop(self, kind: Callable[[Event], bool], frame: str) -> None:
        """Drop events of a kind: all of this frame, and all but the newest of the others."""
        others = [_frame(held) for held in self.held if kind(held)]
        kept = next((other for other in reversed(others) if other not in ("", frame)), None)
        self.held = [held for held in self.held if not kind(held) or _frame(held) == kept]

    def load(self) -> None:
        """Begin to load the mission, once there is a map."""
        if self._loader is None and self._maps():
            self._loader = self._load()

    def loaded(self) -> tuple[Mission, PlanningWorker] | None:
        """Return mission and worker once they are loaded, with ledger and order restored."""
        self.load()
        loaded = self._loader.poll() if self._loader else None
        if loaded is not None:
            self._keeper.restore(loaded[0], self.assignment)
        return loaded

    def answer(self, commands: Sequence[CommandReceived], rival: str = "") -> list[Answer]:
        """Take commands as the mission would, and return the answers.

        ``rival`` says why another daemon is to be commanded; "" for none.
        """
        answers = []
        for asked in commands:
            try:
                if rival:
                    raise CommandError(rival, hint="command the one that plans")
                self.assignment = self.assignment.commanded(asked.command, asked.order)
                if asked.command == "replan":
                    raise CommandError("nothing to plan: the first plan is still to come")
            except FasacoError as error:
                answers.append(Answer(asked.number, error))
                continue
            if asked.command == "reset":
                self._keeper.forget()
            answers.append(Answer(asked.number))
        return answers


def _is_pose(event: Event) -> bool:
    return isinstance(event, PoseReceived)


def _frame(event: Event) -> str:
    match event:
        case MapReceived(grid):
            return grid.frame
        case PoseReceived(pose):
            return pose.frame
    return ""  # it has none


def map_and_pose_of(mission: Mission) -> list[Event]:
    """Return the events after which another mission has the same map and pose."""
    events: list[Event] = []
    if mission.grid is not None:
        events.append(MapReceived(mission.grid))
    if mission.pose is not None:
        events.append(PoseReceived(mission.pose))
    return events


class Loader:
    """Imports the planner, warms its kernels up, and makes mission and worker, in a thread."""

    def __init__(self, config: DaemonConfig, mailbox: Mailbox[object]) -> None:
        self.stage = "importing"
        self._error: BaseException | None = None
        self._config = config
        self._mailbox = mailbox
        self._loaded: tuple[Mission, PlanningWorker] | None = None
        self._is_dropped = False
        threading.Thread(target=self._run, name="loader", daemon=True).start()

    def poll(self) -> tuple[Mission, PlanningWorker] | None:
        """Return what was loaded, None until then; raise what went wrong."""
        if self._error is not None:
            raise self._error
        return self._loaded

    @property
    def is_done(self) -> bool:
        """Whether loading has ended, well or not."""
        return self._loaded is not None or self._error is not None

    def drop(self) -> None:
        """End the worker, now or once it is loaded: nobody will ask for it."""
        self._is_dropped = True
        if self._loaded is not None:
            self._loaded[1].disown()

    def _run(self) -> None:
        try:
            self._loaded = self._load()
            if self._is_dropped:
                self._loaded[1].disown()
        except BaseException as error:
            self._error = error
        self._mailbox.post("loaded", None)

    def _load(self) -> tuple[Mission, PlanningWorker]:
        from fasaco_edge.daemon.loop.worker import PlanningWorker  # noqa: PLC0415
        from fasaco_edge.grid.lattice import Footprint  # noqa: PLC0415
        from fasaco_edge.mission.config import MissionConfig  # noqa: PLC0415
        from fasaco_edge.mission.core.mission import Mission  # noqa: PLC0415
        from fasaco_edge.mission.orders.order_state import NO_ORDER, OrderState  # noqa: PLC0415
        from fasaco_edge.planners.near_optimal import NearOptimal  # noqa: PLC0415
        from fasaco_edge.planners.registry import planner_of  # noqa: PLC0415
        from fasaco_edge.planners.warmup import warm_up  # noqa: PLC0415

        warm_up(self._report)
        release_unused()
        robot, maps, planner = self._config.robot, self._config.map, self._config.planner
        footprint = Footprint(
            robot.tool_width_m, robot.radius_m, maps.free_at_most, maps.occupied_at_least
        )
        chosen = planner_of(planner.name, planner.colony(), planner.threads, planner.local_search)
        worker = PlanningWorker(chosen, planner.budget_s, self._mailbox.post)
        mission = MissionConfig(
            footprint,
            maps.max_lattice_cells,
            robot.cost(),
            self._config.mission,
            planner.spare_share if isinstance(chosen, NearOptimal) else 0.0,
        )
        first = (
            OrderState.autostart() if self._config.mission.autostart else OrderState.idle(NO_ORDER)
        )
        return Mission(mission, first), worker

    def _report(self, stage: str) -> None:
        self.stage = f"kernels: {stage}"
