"""Floor that other robots swept is no failure of the robot whose recording is read."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.fleet.review.tracks import swept_by_others
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.samples import SampleEncoder
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.settings import FleetSettings
from fasaco_edge.wire.documents.turns import TurnBatch
from fasaco_edge.wire.topics import FLEET, TURNS
from tests.fleet.told import CELL_M, member, tiles

# A pixel is half a cell.
GEOMETRY = GridGeometry(8, 10, CELL_M / 2, Pose2D(-CELL_M, -CELL_M))
HOUSE = FleetSettings("house")


def turns(*said):
    told = SampleEncoder(0)
    for robot, message in said:
        sample = Sample(f"fasaco/@v1/{robot}/fleet", encode_json(message))
        told.add(Arrival(FLEET.name, sample, 0, 0))
    batch = TurnBatch(1, [0.0], [], told=told.take())
    return [Arrival(TURNS.name, Sample("turns", msgspec.json.encode(batch)), 0, 0)]


def cells(mask):
    found = {((row - 2) // 2, (col - 2) // 2) for row, col in np.argwhere(mask).tolist()}
    assert np.count_nonzero(mask) == 4 * len(found)
    return found


def test_swept_cells_of_all_others_count_and_those_along_walls():
    first, second = member(cells=[(1, 1)]), member(cells=[(0, 3)])
    found = swept_by_others(turns(("r2", first), ("r3", second)), HOUSE, GEOMETRY)
    # Row -1 is out of the reach of a robot's centre: floor along the wall.
    assert cells(found) == {(1, 1), (0, 3), (-1, 2), (-1, 3)}


def test_cells_of_an_earlier_epoch_do_not_count():
    again = member(cells=[(1, 2)], epoch=2)
    found = swept_by_others(turns(("r2", member(cells=[(1, 1)])), ("r2", again)), HOUSE, GEOMETRY)
    assert cells(found) == {(1, 2)}


def test_maps_of_their_own_meet_in_the_fleets_frame():
    said = member(cells=[(1, 1)], ground=tiles([(1, 1)]), origin=(CELL_M, 0.0, 0.0))
    own = FleetSettings("house", x_m=0.0, y_m=CELL_M)
    found = swept_by_others(turns(("r2", said)), own, GEOMETRY)
    assert {(0, 2)} <= cells(found)


@pytest.mark.parametrize("said", [(), (("r2", member("garden", [(1, 1)])),)])
def test_without_a_message_of_the_fleet_nothing_is_known(said):
    assert swept_by_others(turns(*said) if said else [], HOUSE, GEOMETRY) is None
