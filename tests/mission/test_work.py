"""What a turn of the loop costs does not grow with how many things a map or an order holds.

Counted are calls of Python's, which are the same on any machine: what is done for each of many
things belongs into a kernel, or into one call over all of them.
"""

import sys

import numpy as np
import pytest

from fasaco_edge.daemon.loop.mission_reports import mission_report
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.polygons import polygon_flaw
from fasaco_edge.mission.core.mission import Mission, MissionConfig
from fasaco_edge.mission.events import CommandReceived, MapReceived, PoseReceived
from fasaco_edge.mission.orders.order import MissionOrder, Zone
from fasaco_edge.mission.work.uncovered import MOST_AREAS, MOST_VIEWPOINTS, viewpoints_beside

FOOTPRINT = Footprint(0.3, 0.14)
# Pixels of a chamber's side with one wall; it holds a few cells.
CHAMBER = 24


def calls_of(function, *arguments):
    """Return what a function returns, and how many calls of Python and C it takes."""
    count = 0

    def note(_frame, event, _argument):
        nonlocal count
        count += event in ("call", "c_call")

    function(*arguments)  # what is compiled, imported or looked up once is there now
    sys.setprofile(note)
    try:
        returned = function(*arguments)
    finally:
        sys.setprofile(None)
    return returned, count


def chambers(side):
    """Return a map of ``side`` x ``side`` chambers without doors."""
    pixels = np.zeros((side * CHAMBER + 1,) * 2, np.int8)
    pixels[::CHAMBER] = pixels[:, ::CHAMBER] = 100
    return OccupancyGrid(GridGeometry(*pixels.shape, 0.05, Pose2D(0.0, 0.0)), pixels)


def mission_in(grid, order=None):
    mission = Mission(MissionConfig(FOOTPRINT))
    pose = StampedPose(Pose2D(0.6, 0.6))
    events = [MapReceived(grid), PoseReceived(pose)]
    mission.step([*events, *([CommandReceived(1, "start", order)] if order else [])], 0.0)
    assert mission.route.path is not None
    return mission


def report(mission):
    """Return a report as of something having changed."""
    mission.covered.current.total += 1
    return mission_report(mission, mission.order_state)


@pytest.mark.parametrize("side", [5, 40])
def test_a_report_on_many_closed_chambers_takes_no_longer(side):
    few, _ = calls_of(report, mission_in(chambers(side)))
    _, least = calls_of(report, mission_in(chambers(5)))
    _, count = calls_of(report, mission_in(chambers(side)))
    assert count <= least + 5
    assert len(few.unreached.areas) == MOST_AREAS
    assert few.unreached.areas_left_out == side**2 - 1 - MOST_AREAS


@pytest.mark.parametrize("side", [5, 40])
def test_viewpoints_are_found_at_once(side):
    closed = np.zeros((4 * side, 4 * side), bool)
    for row in (0, 1):
        for col in (0, 1):
            closed[row::4, col::4] = True
    found, count = calls_of(viewpoints_beside, closed, ~closed)
    assert len(found) == min(side**2, MOST_VIEWPOINTS)
    assert count < 50


def rectangle(x0, y0, x1, y1):
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def test_a_report_counts_a_hundred_zones_in_one_call():
    def mission(zones):
        order = MissionOrder(tuple(Zone(f"z{i}", rectangle(0, 0, 2 + i, 9)) for i in range(zones)))
        return mission_in(chambers(8), order)

    (_, few), (told, many) = (calls_of(report, mission(zones)) for zones in (10, 100))
    assert len(told.zones) == 100
    # What is left is to write down each of them.
    assert many - few < 90 * 7


def test_a_polygon_is_looked_through_edge_by_edge_in_few_calls():
    def comb(teeth):
        up = [(float(tooth), float(tooth % 2) * 50.0 + 1.0) for tooth in range(teeth)]
        return (*up, (float(teeth), -1.0), (-1.0, -1.0))

    (good, few), (_, many) = (calls_of(polygon_flaw, comb(teeth)) for teeth in (100, 998))
    assert good == ""
    assert many - few < 2 * 898
