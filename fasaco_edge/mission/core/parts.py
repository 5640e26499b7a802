"""The parts of a mission, which those that hear and those that decide have in common."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.core.route import Route, SpareTime
from fasaco_edge.mission.coverage.ledger_keeper import LedgerKeeper
from fasaco_edge.mission.map.inputs import InputMonitor
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order_state import OrderState
from fasaco_edge.mission.orders.sequencer import Sequencer


@dataclass(slots=True)
class Parts:
    """What a mission consists of.

    Attributes:
        site: the map and the robot's place in it.
        log: what is covered.
        watch: whether map and pose keep coming.
        agenda: what is still to be done.
        route: the path, and the plan under way.
        spare: time to make the path better.
        now: time of the step [s].
    """

    site: MapState
    log: LedgerKeeper
    watch: InputMonitor
    agenda: Sequencer
    route: Route
    spare: SpareTime
    now: float = 0.0

    @classmethod
    def of(cls, config: MissionConfig) -> Parts:
        """Return the parts of a mission that has heard nothing yet."""
        site, log = MapState(config), LedgerKeeper(config.footprint.cell_m)
        agenda = Sequencer(config, site, log)
        route, spare = Route(site, agenda), SpareTime(config.spare_share)
        return cls(site, log, InputMonitor(config), agenda, route, spare)

    def take_order(self, assignment: OrderState) -> None:
        """Begin with another order, or with none; a survey has to follow."""
        self.route.disown()
        self.site.keep_out(assignment.order.keep_out if assignment.order else ())
        self.agenda.take(assignment)

    def survey(self) -> None:
        """Find out what can be reached now; want a new plan if that changed."""
        before, route = self.site.ground, self.route
        self.site.survey()
        ground = self.site.ground
        if ground is None:
            return
        self.agenda.see()
        if before is None:
            again = "robot is on coverable ground again"
            route.want(again if route.revision else self.log.opening)
        elif change := ground.change_since(before):
            route.want(str(change), change.window)
