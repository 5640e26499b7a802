"""Kind of company of a robot that has a name in a fleet."""

from fasaco_edge.fleet.mission.kind import FleetKind, fleet_of
from fasaco_edge.mission.core.mission import Mission
from tests.mission.world import CONFIG


def test_a_name_in_a_fleet_makes_the_mission_one_of_a_fleet():
    assert fleet_of(Mission(CONFIG, kind=FleetKind("r1"))).members == {}
