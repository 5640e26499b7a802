"""The mission runner: owner of the mission and its planning thread, from startup to replacement.

The first map starts the loading of kernels; until then the daemon is small. Events that arrive
before the mission is loaded are held for it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from fasaco_edge.bus.claim import ClaimState
from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.ledger.writer import LedgerKeeper
from fasaco_edge.daemon.loop.loader import Loader
from fasaco_edge.errors import CommandError, FasacoError, PatchWithoutBase
from fasaco_edge.grid.occupancy import MapPatch, without_base
from fasaco_edge.mission.core.path_exit import PathExit
from fasaco_edge.mission.events import (
    Answer,
    BatteryReceived,
    CommandReceived,
    Decision,
    Event,
    MapReceived,
    PatchesLost,
    PatchRun,
    PoseReceived,
    PriorityReceived,
    in_runs,
)
from fasaco_edge.mission.map.configured_places import ConfiguredPlaces
from fasaco_edge.mission.map.placing import is_named
from fasaco_edge.mission.rooms.room_book import RoomBook
from fasaco_edge.mission.rooms.room_commands import carry_out, check_before_map
from fasaco_edge.mission.work.order_state import OrderState

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.worker import PlanningWorker
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.events import PlanRequest


class MissionRunner:
    """Starts a mission once there is a map; replaces it by another that continues its ledger.

    Attributes:
        config: the configuration in force.
        rooms: the rooms, kept from each mission to the next.
        paths: passes the paths of its missions to the bus.
        mission: the mission; None during startup.
        worker: its planning thread; None during startup.
    """

    def __init__(
        self,
        config: DaemonConfig,
        keeper: LedgerKeeper,
        mailbox: Mailbox[object],
        load: Callable[[DaemonConfig, Mailbox[object]], Loader] | None = None,
        rooms: RoomBook | None = None,
    ) -> None:
        self.config = config
        self.rooms = rooms or RoomBook()
        self.paths = PathExit()
        self.mission: Mission | None = None
        self.worker: PlanningWorker | None = None
        self._keeper = keeper
        self._mailbox = mailbox
        self._load = load or Loader
        self._loader: Loader | None = None
        self._held = HeldEvents()
        # The mission that the next mission replaces.
        self._before: Mission | None = None

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
        """Return the mission, its events, and the faults of unusable events.

        Until it is loaded and this daemon plans, the mission is None, and events are held for it.
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
            self._keeper.restore(self.mission, self.rooms)
            if self._before is not None:
                self.mission.continue_from(self._before)
            self._before = None
            if self.config.fleet:
                # Distinguishes the order from orders in ledgers that were set aside.
                self.mission.covered.shared.begin_epoch(time.time_ns() // 1_000_000)
            self._held = HeldEvents()
        return self.mission, held, faults

    def answer(self, commands: Sequence[CommandReceived], rival: str = "") -> tuple[Answer, ...]:
        """Carry out commands during startup as the mission would; return the replies.

        ``rival``: why another daemon has to be commanded; "" for none.
        """
        return tuple(Answer(asked.number, self._carry_out(asked, rival)) for asked in commands)

    def _carry_out(self, asked: CommandReceived, rival: str) -> FasacoError | None:
        """Apply a command to the stored order; return the reason of a refusal, if any."""
        try:
            if rival:
                raise CommandError(rival, hint="command the one that plans")
            if asked.room is not None:
                check_before_map(asked.command)
                carry_out(self.rooms, asked.command, asked.room)
                return None
            before = self.order_state
            places = ConfiguredPlaces(self.config.mission, self.config.mission)
            places.restore(before.places)
            if before.frame:
                places.enter(before.frame)
            command = asked.asked._replace(order=places.located(asked.order, self.rooms))
            after = before.commanded(command, has_home=places.place("home") is not None)
            if is_named(asked.order) and not after.frame:
                is_room = any(zone.room for zone in command.order.zones)
                after = replace(after, frame=self.rooms.frame if is_room else places.frame)
            if not asked.discard and before.forgets(command, after):
                self._keeper.check_loss(asked.command)
            if asked.command == "replan":
                hint = "ask again once the daemon has planned"
                raise CommandError("nothing to plan: the first plan is still to come", hint=hint)
            self._keeper.order_state = after
        except FasacoError as error:
            return error
        if asked.command == "reset":
            self._keeper.forget()
        return None

    def newest_inputs(self) -> list[Event]:
        """Return the newest map and pose as events for a new mission."""
        return self._held.events if self.mission is None else self.mission.newest_inputs()

    def step(self, mission: Mission, events: Sequence[Event], now: float) -> Decision:
        """Step the mission, and take over its path for publication."""
        decision = mission.step(events, now)
        self.paths.follow(mission, decision.path)
        return decision

    def restart(self, config: DaemonConfig, held: Sequence[Event], why: str) -> None:
        """Go back to startup with these events; coverage and order continue from the ledger.

        ``why``: why the path of the present mission is withdrawn.
        """
        self.paths.withdraw(why)
        if self.mission is not None and self.worker is not None:
            self.worker.disown()
            self._keeper.take_back(self.mission)
            self._before = self.mission
        elif self._loader is not None:
            self._loader.drop()
        self.config = config
        self.mission = self.worker = self._loader = None
        self._held = HeldEvents(held)

    def stand_by(self) -> None:
        """Stop publishing, as another daemon plans.

        The previous mission is kept only if its building is in doubt.
        """
        self.paths.forget()
        if self._before is not None and not self._before.is_in_doubt:
            self._before = None

    def submit(self, request: PlanRequest) -> None:
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


_LOST_KEY = (PatchesLost, "")


class HeldEvents:
    """The first events of a mission, bounded for any duration of loading.

    Holds the newest map, with its updates applied, and the newest pose of each of the newest two
    frames, as the mission decides which frame counts. A loss of updates is held until the next map.
    """

    def __init__(self, events: Sequence[Event] = ()) -> None:
        # Held events by type and frame, in order of arrival.
        self._held: dict[tuple[type, str], Event] = {}
        for event in events:
            self._held[type(event), _frame(event)] = event

    @property
    def events(self) -> list[Event]:
        """The events, in order of arrival."""
        return list(self._held.values())

    @property
    def has_map(self) -> bool:
        return any(kind is MapReceived for kind, _ in self._held)

    def take(self, events: Sequence[Event]) -> list[FasacoError]:
        """Hold events; return the faults of unusable ones."""
        faults: list[FasacoError] = []
        for event in in_runs(events):
            match event:
                case MapReceived():
                    self._held.pop(_LOST_KEY, None)
                    self._hold(event)
                case PoseReceived() | BatteryReceived() | PriorityReceived():
                    self._hold(event)
                case PatchRun(patches):
                    faults += self._apply(patches)
                case PatchesLost(count):
                    faults.append(PatchWithoutBase(f"{count} map updates were lost"))
                    if self.has_map:
                        self._held.setdefault(_LOST_KEY, event)
        return faults

    def _hold(self, event: Event) -> None:
        """Hold an event in place of others of its type, but keep the newest of another frame."""
        frame = _frame(event)
        before = [other for kind, other in self._held if kind is type(event)]
        kept = [other for other in before if other not in ("", frame)][-1:]
        for other in before:
            if other not in kept:
                del self._held[type(event), other]
        self._held[type(event), frame] = event

    def _apply(self, patches: Sequence[MapPatch]) -> list[FasacoError]:
        """Apply updates to the held maps; return the faults of updates that cannot be applied."""
        maps = {
            held.grid.frame: held.grid
            for held in self._held.values()
            if isinstance(held, MapReceived)
        }
        if not maps or _LOST_KEY in self._held:
            return without_base(patches, updates_lost=bool(maps))
        faults: list[FasacoError] = []
        newest = next(reversed(maps))
        for frame, grid in maps.items():
            # An update in no held frame goes to the newest map, which reports the mismatch.
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
    return ""  # other events have no frame
