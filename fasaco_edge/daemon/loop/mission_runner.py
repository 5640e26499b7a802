"""The mission runner: owner of the mission and its planning thread, from startup to replacement.

The first map starts the loading of kernels; until then the daemon is small. Importing numba costs
60 MB, and compiling on a new machine takes many seconds: a separate thread does both, so that
the loop keeps replying. Events that arrive meanwhile are held.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.claim import ClaimState
from fasaco_edge.daemon.ledger.writer import LedgerKeeper
from fasaco_edge.daemon.loop.inbox import PlannerFault
from fasaco_edge.daemon.memory import floor_pixels
from fasaco_edge.errors import CommandError, FasacoError, PatchWithoutBase
from fasaco_edge.grid.occupancy import MapPatch, without_base
from fasaco_edge.host.processes import release_unused
from fasaco_edge.mission.config import MissionConfig, Sweeping
from fasaco_edge.mission.core.events import (
    Answer,
    BatteryReceived,
    CommandReceived,
    Event,
    MapReceived,
    PatchesLost,
    PatchRun,
    PoseReceived,
    in_runs,
)
from fasaco_edge.mission.orders.order import located
from fasaco_edge.mission.orders.order_state import NO_ORDER, OrderState

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.worker import PlanningWorker
    from fasaco_edge.mission.core.events import PlanRequest
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.planners.planner import CoveragePlanner

_LOST = (PatchesLost, "")


class HeldEvents:
    """The first events of a mission; bounded, however long loading takes.

    Holds the newest map, with its updates applied, and the newest pose of each of the newest
    two frames: the mission decides which frame counts. A loss of updates is noted until the next
    map.
    """

    def __init__(self, events: Sequence[Event] = ()) -> None:
        # By type and frame, in order of arrival.
        self._held: dict[tuple[type, str], Event] = {}
        for event in events:
            self._held[type(event), _frame(event)] = event

    @property
    def events(self) -> list[Event]:
        """The events, in order of arrival."""
        return list(self._held.values())

    @property
    def has_map(self) -> bool:
        """Whether there is a map."""
        return any(kind is MapReceived for kind, _ in self._held)

    def take(self, events: Sequence[Event]) -> list[FasacoError]:
        """Hold events; return the faults of unusable ones."""
        faults: list[FasacoError] = []
        for event in in_runs(events):
            match event:
                case MapReceived():
                    self._held.pop(_LOST, None)
                    self._hold(event)
                case PoseReceived() | BatteryReceived():
                    self._hold(event)
                case PatchRun(patches):
                    faults += self._apply(patches)
                case PatchesLost(count):
                    faults.append(PatchWithoutBase(f"{count} map updates were lost"))
                    if self.has_map:
                        self._held.setdefault(_LOST, event)
        return faults

    def _hold(self, event: Event) -> None:
        """Hold an event; it replaces those of its type, except the newest in another frame."""
        frame = _frame(event)
        before = [other for kind, other in self._held if kind is type(event)]
        kept = [other for other in before if other not in ("", frame)][-1:]
        for other in before:
            if other not in kept:
                del self._held[type(event), other]
        self._held[type(event), frame] = event

    def _apply(self, patches: Sequence[MapPatch]) -> list[FasacoError]:
        """Apply updates to the held maps; return the faults of those that cannot be applied."""
        maps = {
            held.grid.frame: held.grid
            for held in self._held.values()
            if isinstance(held, MapReceived)
        }
        if not maps or _LOST in self._held:
            return without_base(patches, updates_lost=bool(maps))
        faults: list[FasacoError] = []
        newest = next(reversed(maps))
        for frame, grid in maps.items():
            # An update of neither frame is a mismatch with the newest map.
            theirs = [p for p in patches if (p.frame if p.frame in maps else newest) == frame]
            updated = grid.with_updates(theirs)
            self._held[MapReceived, frame] = MapReceived(updated.grid)
            faults += updated.faults
        return faults


def _frame(event: Event) -> str:
    match event:
        case MapReceived(grid):
            return grid.frame
        case PoseReceived(pose):
            return pose.frame
    return ""  # it has none


class MissionRunner:
    """Starts a mission once there is a map, and replaces it by one that continues from the ledger.

    Attributes:
        config: the configuration in force.
        mission: the mission; None during startup.
        worker: its planning thread; None during startup.
    """

    def __init__(
        self,
        config: DaemonConfig,
        keeper: LedgerKeeper,
        mailbox: Mailbox[object],
        load: Callable[[DaemonConfig, Mailbox[object]], Loader] | None = None,
    ) -> None:
        self.config = config
        self.mission: Mission | None = None
        self.worker: PlanningWorker | None = None
        self._keeper = keeper
        self._mailbox = mailbox
        self._load = load or Loader
        self._loader: Loader | None = None
        self._held = HeldEvents()

    @property
    def order_state(self) -> OrderState:
        """The present or future order of the mission."""
        return self.mission.order_state if self.mission else self._keeper.order_state

    @property
    def map_frame(self) -> str:
        """The frame of the map, "" before there is one."""
        if self.mission is not None:
            return self.mission.grid.frame if self.mission.grid is not None else ""
        frames = [event.grid.frame for event in self._held.events if isinstance(event, MapReceived)]
        return frames[-1] if frames else ""

    @property
    def loading(self) -> str:
        """The stage that startup is loading; "" for none."""
        return self._loader.stage if self._loader else ""

    def mission_for(
        self, events: list[Event], claim: ClaimState
    ) -> tuple[Mission | None, list[Event], list[FasacoError]]:
        """Return the mission, once it is loaded and this daemon plans, and the events for it.

        Until then events are held; a new mission gets all of them. The faults are of unusable
        events.
        """
        if self.mission is not None:
            return self.mission, events, []
        faults = self._held.take(events)
        may_load = not claim.is_waiting and not self.config.mission.waits_for_mask
        if self._loader is None and self._held.has_map and may_load:
            self._loader = self._load(self.config, self._mailbox)
        loaded = self._loader.poll() if self._loader and claim is ClaimState.PLANS else None
        held = self._held.events
        if loaded is not None:
            self.mission, self.worker = loaded
            self._keeper.restore(self.mission)
            if self.config.fleet:
                # No ledger that was set aside has this order.
                self.mission.shared.begin(time.time_ns() // 1_000_000)
            self._held = HeldEvents()
        return self.mission, held, faults

    def answer(self, commands: Sequence[CommandReceived], rival: str = "") -> tuple[Answer, ...]:
        """Take commands during startup as the mission would, and return the replies.

        ``rival`` is the reason to command another daemon; "" for none.
        """
        return tuple(Answer(asked.number, self._carry_out(asked, rival)) for asked in commands)

    def _carry_out(self, asked: CommandReceived, rival: str) -> FasacoError | None:
        """Apply a command to the stored order; return the reason of a refusal, if any."""
        try:
            if rival:
                raise CommandError(rival, hint="command the one that plans")
            order = located(asked.order, self.config.mission.zones)
            has_home = self.config.mission.place("home") is not None
            self._keeper.order_state = self.order_state.commanded(
                asked.command, order, has_home=has_home
            )
            if asked.command == "replan":
                raise CommandError("nothing to plan: the first plan is still to come")
        except FasacoError as error:
            return error
        if asked.command == "reset":
            self._keeper.forget()
        return None

    def held(self) -> list[Event]:
        """Return newest map and pose as events, for a new mission."""
        if self.mission is None:
            return self._held.events
        grid, pose = self.mission.grid, self.mission.pose
        return [
            *([MapReceived(grid)] if grid is not None else []),
            *([PoseReceived(pose)] if pose is not None else []),
        ]

    def restart(self, config: DaemonConfig, held: Sequence[Event]) -> None:
        """Go back to startup, with these events; coverage and order continue from the ledger."""
        if self.mission is not None and self.worker is not None:
            self.worker.disown()
            self._keeper.take_back(self.mission)
        elif self._loader is not None:
            self._loader.drop()
        self.config = config
        self.mission = self.worker = self._loader = None
        self._held = HeldEvents(held)

    def submit(self, request: PlanRequest) -> None:
        """Submit a plan request."""
        assert self.worker is not None
        self.worker.submit(request)

    def interrupt(self) -> None:
        """End the search under way, if there is one."""
        if self.worker is not None:
            self.worker.interrupt()

    def close(self, timeout_s: float) -> None:
        """End the planning thread."""
        if self.worker is not None:
            self.worker.close(timeout_s)


class Loader:
    """Imports the planner, warms its kernels up, and makes mission and worker, in a thread.

    Attributes:
        stage: the stage being loaded; "" once loading has ended, successful or not.
    """

    def __init__(self, config: DaemonConfig, mailbox: Mailbox[object]) -> None:
        self.stage = "importing"
        self._error: BaseException | None = None
        self._config = config
        self._mailbox = mailbox
        self._loaded: tuple[Mission, PlanningWorker] | None = None
        self._is_dropped = False
        threading.Thread(target=self._run, name="loader", daemon=True).start()

    def poll(self) -> tuple[Mission, PlanningWorker] | None:
        """Return the loaded mission and worker, None until then; raise the error of a failure."""
        if self._error is not None:
            raise self._error
        return self._loaded

    def drop(self) -> None:
        """End the worker, now or once it is loaded: it is not needed."""
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
        self.stage = ""
        self._mailbox.post("loaded", None)

    def _load(self) -> tuple[Mission, PlanningWorker]:
        from fasaco_edge.daemon.loop.worker import PlanningWorker  # noqa: PLC0415
        from fasaco_edge.mission.core.mission import Mission  # noqa: PLC0415
        from fasaco_edge.planners.registry import planner_of  # noqa: PLC0415
        from fasaco_edge.planners.warmup import warm_up  # noqa: PLC0415

        warm_up(self._report)
        release_unused()
        planner = self._config.planner
        chosen = planner_of(planner.name, planner.colony(), planner.threads, planner.local_search)
        if planner.own:
            from fasaco_edge.planners.own.process import OwnProcess  # noqa: PLC0415

            chosen = OwnProcess(planner.own, planner.seed, chosen, self._tell)
        worker = PlanningWorker(chosen, planner.budget_s, self._mailbox.post)
        first = (
            OrderState.autostart() if self._config.mission.autostart else OrderState.idle(NO_ORDER)
        )
        return Mission(mission_config(self._config, chosen), first), worker

    def _tell(self, error: FasacoError) -> None:
        self._mailbox.post("planner_fault", PlannerFault(error))

    def _report(self, stage: str) -> None:
        self.stage = f"kernels: {stage}"


def mission_config(config: DaemonConfig, chosen: CoveragePlanner) -> MissionConfig:
    """Return the configuration of a daemon's mission that ``chosen`` plans for."""
    from fasaco_edge.grid.lattice import Footprint  # noqa: PLC0415
    from fasaco_edge.planners.living_trail import TrailRules  # noqa: PLC0415
    from fasaco_edge.planners.paper.fasaco import Fasaco  # noqa: PLC0415
    from fasaco_edge.planners.search.near_optimal import NearOptimal  # noqa: PLC0415

    robot, maps, planner, cell_m = config.robot, config.map, config.planner, config.cell_m
    return MissionConfig(
        Footprint(cell_m, robot.radius_m, maps.free_at_most, maps.occupied_at_least),
        maps.max_lattice_cells,
        robot.cost(cell_m),
        config.mission,
        planner.spare_share if isinstance(chosen, NearOptimal) else 0.0,
        _sweeping(config),
        TrailRules(planner.alpha, planner.tau0),
        isinstance(chosen, Fasaco),
        robot.name if config.fleet else "",
        config.battery or None,
        config.lattice_deg,
    )


def _sweeping(config: DaemonConfig) -> Sweeping | None:
    from fasaco_edge.planners.line import LINES  # noqa: PLC0415

    robot, line = config.robot, LINES.get(config.planner.line)
    if line is None:
        return None
    line = replace(line, speed_m_s=robot.speed_m_s, turning=robot.turning())
    most_pixels = floor_pixels(config.map.max_pixels)
    return Sweeping(robot.tool_width_m, most_pixels, line, robot.tool_ahead_m)
