"""The parts of a mission, which those that hear and those that decide have in common."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.core.route import Route
from fasaco_edge.mission.core.spare_time import SpareTime
from fasaco_edge.mission.coverage.ledger_owner import Logbook
from fasaco_edge.mission.map.freshness import Watch
from fasaco_edge.mission.map.map_state import Site
from fasaco_edge.mission.orders.agenda import Agenda
from fasaco_edge.mission.orders.assignment import Assignment


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

    site: Site
    log: Logbook
    watch: Watch
    agenda: Agenda
    route: Route
    spare: SpareTime
    now: float = 0.0

    @classmethod
    def of(cls, config: MissionConfig) -> Parts:
        """Return the parts of a mission that has heard nothing yet."""
        site, log = Site(config), Logbook(config.footprint.cell_m)
        agenda = Agenda(config, site, log)
        route, spare = Route(site, agenda), SpareTime(config.spare_share)
        return cls(site, log, Watch(config), agenda, route, spare)

    def take_order(self, assignment: Assignment) -> None:
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
