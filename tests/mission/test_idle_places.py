"""Places that keep the robot out of nothing, or lie beside the map: they are named."""

import time

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import Dock, Place
from fasaco_edge.mission.events import MapReceived
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.orders.mask import inline_grid, inline_mask
from fasaco_edge.mission.work.idle_places import PERIOD_S, IdlePlaces
from fasaco_edge.mission.work.order_state import OrderState
from tests.mission.test_configured_zones import mask_file
from tests.mission.world import CELL, CONFIG, building, rectangle, robot_in, with_policy
from tests.support.processes import slowness

ROOM = ("#########",) * 3 + ("#.......#",) * 4 + ("#########",)


def polygon(*corners):
    return tuple(tuple(at) for at in rectangle(*corners))


INSIDE, FAR, IN_WALL = polygon(2, 2, 3, 3), polygon(500, 500, 501, 501), polygon(6, 3, 7, 4)
MILLIMETRES = tuple((1e3 * x, 1e3 * y) for x, y in INSIDE)


def drive_with(**policy):
    return robot_in(*ROOM, cell=(1, 1), config=with_policy(CONFIG, **policy))


def said(drive, after=PERIOD_S):
    drive.now += after
    return drive.mission.idle_places(drive.now)


def in_or_beside(names):
    return f"no known floor lies in or beside {names}"


@pytest.mark.parametrize("idle", [FAR, MILLIMETRES, IN_WALL])
def test_a_keep_out_that_keeps_out_of_nothing_is_named(idle):
    drive = drive_with(keep_out=(INSIDE, idle))
    assert said(drive) == in_or_beside("mission.keep_out[1]")


def test_keep_outs_of_the_operator_and_of_an_order_are_named():
    drive = drive_with()
    assert said(drive) == ""
    drive.command("keep_out_add", keep_out=KeepOut("stairs", FAR))
    assert said(drive) == in_or_beside("keep-out 'stairs'")
    drive.command("start", {"keep_out": [list(map(list, INSIDE)), list(map(list, FAR))]})
    assert said(drive) == in_or_beside("order.keep_out[1], keep-out 'stairs'")
    drive.command("keep_out_remove", keep_out=KeepOut("stairs"))
    assert said(drive) == in_or_beside("order.keep_out[1]")


def test_a_map_that_grows_ends_it():
    beyond = polygon(2, 11, 3, 12)
    drive = drive_with(keep_out=(beyond,))
    assert said(drive) == in_or_beside("mission.keep_out[0]")
    drive.tell(MapReceived(building(*(row + "......" for row in ROOM))))
    assert said(drive) == ""
    # One with an effect has it, whatever flickers.
    drive.tell(MapReceived(building(*ROOM)))
    assert said(drive) == ""


def test_a_mask_with_a_wrong_origin_or_without_a_mark_is_named(tmp_path):
    marked = np.zeros((20, 20), bool)
    marked[4:8, 4:8] = True
    away = inline_mask(mask_file(tmp_path, marked, origin=(300.0, 100.0, 0.0)), 65)
    assert said(drive_with(keep_out_mask=away)) == in_or_beside("keep_out_mask")
    there = inline_mask(mask_file(tmp_path, marked, origin=(2 * CELL, 2 * CELL, 0.0)), 65)
    assert said(drive_with(keep_out_mask=there)) == ""
    blank = inline_mask(mask_file(tmp_path, marked & False), 65)
    text = "no pixel of mission.keep_out_mask is occupied"
    assert said(drive_with(keep_out_mask=blank)) == text
    # One that came as a message may be blank for a while.
    assert said(drive_with(keep_out_mask=inline_grid(building(*ROOM), 101))) == ""


def test_home_and_dock_beside_the_map_are_named():
    home, dock = Place(x_m=400.0, y_m=0.5), Dock(x_m=0.5, y_m=-70.0)
    text = "outside of the map so far: mission.home, mission.dock"
    assert said(drive_with(home=home, dock=dock)) == text


def test_places_of_another_map_are_not_looked_for():
    assert said(drive_with(keep_out=(FAR,), map_frame="cellar")) == ""


def test_looking_takes_little_of_a_cycle():
    """The most keep-outs there may be, on a large map of which they touch nothing."""
    cells = np.full((5000, 5000), -1, np.int8)
    large = OccupancyGrid(GridGeometry(5000, 5000, 0.05, Pose2D(0, 0, 0)), cells)
    small = tuple(polygon(100 + index, 100, 103 + index, 103) for index in range(99))
    vast = polygon(0, 0, 490, 490)
    order, slow = OrderState.autostart(), slowness()
    places = IdlePlaces(with_policy(CONFIG, keep_out=(*small, vast)))
    places.find(large, 1, order, 0.0, is_theirs=True)  # kernels are loaded
    places = IdlePlaces(with_policy(CONFIG, keep_out=(*small, vast)))
    began = time.perf_counter()
    text = places.find(large, 2, order, 0.0, is_theirs=True)
    assert time.perf_counter() - began < 0.05 * slow
    assert text.endswith("mission.keep_out[4] and 94 more")
    assert places.find(large, 3, order, 0.5 * PERIOD_S, is_theirs=True) == text
