"""Another building under a robot of a fleet: what others swept before does not count."""

import numpy as np

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.fleet.mission.tiles import tile_bits
from fasaco_edge.mission.events import MemberReceived
from tests.mission.test_other_building import HERE, NEW, OLD, stand
from tests.mission.world import Drive, pose_at


def test_cells_of_others_on_the_previous_floor_do_not_count():
    """They go on telling of it, in the frame that the map here has, too."""
    everywhere = tile_bits(np.ones((64, 64), np.uint16))
    tiles = (((0, 0), everywhere),)
    other = MemberReceived("b", frame="map", state="covering", epoch=1, tiles=tiles)
    drive = Drive(HERE, OLD, pose_at(*HERE), kind=FleetKind("a"))
    drive.tell(other)
    assert drive.mission.coverage().remaining == 0
    stand(drive, 8.0, NEW)
    drive.tell(other)
    assert drive.mission.coverage().remaining == 39
    assert "another building" in drive.mission.covered.shared.why_misplaced("map")
    drive.command("reset")
    assert drive.mission.covered.shared.why_misplaced("map") == ""
