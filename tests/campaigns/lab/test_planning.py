"""The lab's planner in simulated time, and its settings."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.config.config import PlannerConfig
from fasaco_edge.mission.events import MapReceived
from fasaco_edge.planners.cost import CoverageCost
from tests.campaigns.lab.planning import PIECE_S, PLAN_S, LockStepPlanning
from tests.campaigns.lab.settings import LabSettings
from tests.mission.world import CONFIG, Drive, building, pose_at

ROOM = ["." * 14] * 5 + ["....##........"] * 3 + ["." * 14] * 4


@pytest.fixture(scope="module")
def request_of():
    # With turns no walk is proven to be the best before the time is up.
    config = replace(CONFIG, cost=CoverageCost(0.8, 1.5))
    return Drive((0, 0), MapReceived(building(*ROOM)), pose_at(0, 0), config=config).request


def test_a_plan_takes_its_budget_in_simulated_time_and_repeats(request_of):
    found = []
    for _ in range(2):
        planning = LockStepPlanning(PlannerConfig(budget_s=0.05))
        planning.submit(request_of, 10.0)
        assert planning.take(10.0 + PLAN_S) == []
        assert planning.take(10.049) == []
        found += planning.take(10.05 + 10 * PIECE_S)
        assert planning.take(11.0) == []
    first, second = found
    assert first.number == request_of.number
    assert first.seconds == second.seconds
    assert first.path.work == second.path.work
    assert np.array_equal(first.path.cells, second.path.cells)


def test_an_interrupted_plan_is_there_at_once(request_of):
    planning = LockStepPlanning(PlannerConfig(budget_s=0.05))
    planning.interrupt(9.0)
    planning.submit(request_of, 10.0)
    planning.interrupt(10.01)
    assert [ready.number for ready in planning.take(10.01)] == [request_of.number]


def test_rates_are_whole_ticks_and_impossible_ones_are_refused():
    settings = LabSettings(pose_hz=10.0, scan_hz=2.5)
    assert (settings.ticks(settings.pose_hz), settings.ticks(settings.scan_hz)) == (2, 8)
    for wrong in ({"pose_hz": 0.0}, {"scan_hz": 21.0}, {"seconds": -1.0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            LabSettings(**wrong)


def test_the_lab_sets_a_clearance_only_if_given_one():
    robot = LabSettings(radius_m=0.2).config.robot
    assert (robot.radius_m, robot.clearance_m) == (0.2, 0.0)
    robot = LabSettings(radius_m=0.2, clearance_m=0.03).config.robot
    assert (robot.radius_m, robot.clearance_m) == (0.2, 0.03)
