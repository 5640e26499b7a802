"""Kind of company: the parts of a mission that know of the other robots of a fleet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fasaco_edge.mission.company import CompanyKind
from fasaco_edge.mission.fleet.giving_way import GivingWay
from fasaco_edge.mission.fleet.layer import FleetLayer
from fasaco_edge.mission.fleet.shared import SharedProgress

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission

FLEET = CompanyKind(lambda config: SharedProgress(config.map_place), FleetLayer.of, GivingWay.of)


def fleet_of(mission: Mission) -> FleetLayer:
    """Return the other robots of a mission that has a name in a fleet."""
    assert isinstance(mission.company, FleetLayer)
    return mission.company
