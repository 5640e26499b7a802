"""The mission: what is covered, what changed, when to replan.

``step(events, now)`` is all there is. It opens no session, reads no clock and
touches no file, so that a mission can be tested, and repeated, with plain
values.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.core.event_handler import EventHandler
from fasaco_edge.mission.core.events import Decision, Event, PathUpdate, in_runs
from fasaco_edge.mission.core.executive import Executive
from fasaco_edge.mission.core.parts import Parts
from fasaco_edge.mission.coverage.ledger import CoverageLedger, LedgerSnapshot
from fasaco_edge.mission.coverage.progress import Coverage, DrivenPath, ZoneProgress, zone_progress
from fasaco_edge.mission.coverage.unreached import Unreached
from fasaco_edge.mission.orders.order_state import OrderState

__all__ = ["Mission", "MissionConfig"]


class Mission:
    """Covers all that is reachable, of a map that is still growing.

    Attributes:
        state, reason: what it is doing, and why.
    """

    def __init__(self, config: MissionConfig, assignment: OrderState | None = None) -> None:
        """Begin with an assignment; by default with everything that can be reached."""
        self._parts = Parts.of(config)
        self._parts.take_order(assignment or OrderState.autostart())
        self._pilot = Executive(self._parts)
        self.state, self.reason = self._pilot.told()

    def restore_ledger(self, before: LedgerSnapshot) -> None:
        """Go on where a ledger from before a restart ended, unless the map contradicts it.

        To be called before the first step. A contradiction, see ``mission.fit``, is reported
        as a fault (LedgerMismatchError) with the map that shows it; what was covered since
        the restart still counts then.
        """
        self._parts.log.resume(before)
        self._parts.site.frames.counts = before.frame

    def restore_order(self, assignment: OrderState) -> None:
        """Go on with an assignment from before a restart; to be called before the first step."""
        self._parts.take_order(assignment)
        self.state, self.reason = self._pilot.told()

    def step(self, events: Iterable[Event], now: float) -> Decision:
        """Take events in order and decide.

        Args:
            events: what has happened since the last step. An event that cannot be
                used is reported as a fault and changes nothing.
            now: time [s] of any steady clock.
        """
        self._parts.now = self._parts.route.now = now
        intake = EventHandler(self._parts)
        path: PathUpdate | None = None
        for event in in_runs(events):
            try:
                path = intake.take(event) or path
            except FasacoError as error:
                # Its traceback would hold the map until garbage is collected.
                intake.faults.append(error.with_traceback(None))
        decision = self._pilot.decide()
        paths = [update for update in (intake.stopped, path, decision.path) if update is not None]
        self.state, self.reason = self._pilot.told()
        return replace(
            decision,
            path=max(paths, key=lambda update: update.revision, default=None),
            faults=tuple(intake.faults),
            answers=tuple(intake.answers),
            forgotten=intake.forgotten,
        )

    def coverage(self) -> Coverage | None:
        """Return how far the mission is; None before there is a map."""
        return self._parts.site.coverage(self.ledger)

    def unreached(self) -> Unreached:
        """Return what of the order stays uncovered as things are."""
        return self._parts.agenda.unreached()

    def zone_progress(self) -> list[ZoneProgress]:
        """Return how far each zone of the order is."""
        return zone_progress(self.order_state, self._parts.site.ground, self.ledger)

    def snapshot(self) -> LedgerSnapshot:
        """Return all that is to outlive a restart: what is covered, and how far the order is."""
        return replace(self.ledger.snapshot(), note=self.order_state.to_json())

    @property
    def order_state(self) -> OrderState:
        """The order, and how far it is carried out."""
        return self._parts.agenda.assignment

    @property
    def grid(self) -> OccupancyGrid | None:
        """The newest map; None before there is one."""
        return self._parts.site.grid

    @property
    def map_revision(self) -> int:
        """How many maps and updates were taken in."""
        return self._parts.site.map_revision

    @property
    def pose(self) -> StampedPose | None:
        """The newest pose; None before there is one."""
        return self._parts.site.pose

    @property
    def lattice(self) -> CoverageLattice | None:
        """The lattice over the newest map; None before there is one."""
        return self._parts.site.lattice

    @property
    def ledger(self) -> CoverageLedger:
        """What is covered."""
        return self._parts.log.ledger

    @property
    def path(self) -> DrivenPath:
        """The published path, and how far the robot is on it."""
        return self._parts.route.path

    @property
    def revision(self) -> int:
        """How many paths were published."""
        return self._parts.route.revision

    @property
    def plans(self) -> int:
        """How many plans were made."""
        return self._parts.route.plans

    @property
    def attempts(self) -> int:
        """How often a better path was looked for that nothing forced to be changed."""
        return self._parts.route.attempts

    @property
    def unchanged(self) -> int:
        """How many of the plans found the path there is."""
        return self._parts.route.unchanged

    @property
    def outdated(self) -> int:
        """How many of the plans did not hold any more when they came."""
        return self._parts.route.outdated

    @property
    def planning(self) -> bool:
        """Whether a plan that is needed has been asked for and is not there yet."""
        return self._parts.route.asked is not None and not self.is_improving

    @property
    def is_improving(self) -> bool:
        """Whether the plan under way is only to make the path better."""
        return self._parts.route.is_improving

    @property
    def wants_plan(self) -> bool:
        """Whether a plan will be asked for once the one under way is there."""
        return bool(self._parts.route.wanted)
