"""Kind of company: the parts of a mission that handle the other robots of a fleet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from fasaco_edge.fleet.mission.giving_way import GivingWay
from fasaco_edge.fleet.mission.layer import FleetLayer
from fasaco_edge.fleet.mission.shared import MapPlace, SharedProgress
from fasaco_edge.mission.company import Company
from fasaco_edge.mission.core.company_kind import CompanyKind

if TYPE_CHECKING:
    from fasaco_edge.mission.config import MissionConfig
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
    from fasaco_edge.mission.map.map_state import MapState
    from fasaco_edge.mission.path.route import Route
    from fasaco_edge.mission.work.sequencer import Sequencer


@dataclass(frozen=True, slots=True)
class FleetKind(CompanyKind):
    """A robot of a fleet.

    Attributes:
        robot: its name in the fleet.
        map_place: pose of its map in the frame of the fleet; None without such a frame.
    """

    robot: str
    map_place: MapPlace | None = None

    def cells(self) -> SharedProgress:
        """Return the cells that others have swept."""
        return SharedProgress(self.map_place)

    def company(
        self, config: MissionConfig, map_state: MapState, ledger: MissionLedger
    ) -> FleetLayer:
        """Return the part of the mission that divides the area among the robots."""
        return FleetLayer(self.robot, config.cost, config.footprint, map_state, ledger)

    def waiting(
        self,
        config: MissionConfig,
        map_state: MapState,
        orders: Sequencer,
        route: Route,
        company: Company,
    ) -> GivingWay:
        """Return the part of the mission that decides when the robot waits for others."""
        assert isinstance(company, FleetLayer)
        return GivingWay(self.robot, config.footprint, map_state, orders, route, company)


def layer_of(mission: Mission) -> FleetLayer:
    """Return the fleet layer of a mission, which must be of ``FleetKind``."""
    assert isinstance(mission.company, FleetLayer)
    return mission.company


def giving_way_of(mission: Mission) -> GivingWay:
    """Return the ``GivingWay`` of a mission, which must be of ``FleetKind``."""
    assert isinstance(mission.giving_way, GivingWay)
    return mission.giving_way
