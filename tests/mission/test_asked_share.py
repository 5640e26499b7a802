"""A share of the floor that is asked for: returns for what is missing, and when they end."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.daemon.loop.mission_reports import floor_report
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import CommandReceived, MapReceived
from fasaco_edge.mission.line.asked_share import LEAST_GAIN, LEAST_M2, RAISED, AskedShare
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.planners.line import LINES
from tests.mission.offset_base import small_flat
from tests.mission.test_line import CONFIG, Robot, robot_on
from tests.mission.test_room_orders import BOTH, LOOKS, PERIOD_S
from tests.mission.world import building, with_policy

RETURNS = re.compile(r"returns for (0\.\d\d) of 4\.7 m2: (\d\d\.\d) % swept, takes \d+ s")


class Tally:
    """Figures of a tally: floor asked for, floor left, and floor passed and not swept [m2]."""

    unit_m = 0.025

    def __init__(self, left_m2, passed_m2=0.0, wanted_m2=40.0):
        self.wanted_m2, self.passed_m2 = wanted_m2, passed_m2
        self.left_m2 = self.open_m2 = left_m2


def pixels(*areas_m2):
    """Cells in a row, and the missed pixels of each."""
    cells = np.array([(0, col) for col in range(len(areas_m2))], np.int32)
    return cells, np.array([round(m2 / Tally.unit_m**2) for m2 in areas_m2])


def swept_flat(share, *events):
    """A robot that has swept the small flat, and the share that is swept, without strips."""
    line = replace(LINES["quick"], swept=share)
    robot = Robot(Mission(replace(CONFIG, sweeping=replace(CONFIG.sweeping, line=line))))
    robot.at = 0.6, 0.6
    robot.tell(MapReceived(small_flat()), *events)
    robot.finish()
    areas = robot.mission.line.left.areas
    return robot, 1.0 - areas.left_m2 / areas.asked_m2


def returns_of(robot):
    return [found for reason in robot.reasons if (found := RETURNS.fullmatch(reason))]


@pytest.fixture(scope="module")
def usual():
    return swept_flat(None)


@pytest.mark.parametrize("share", [0.95, 0.99])
def test_the_robot_returns_until_the_share_is_swept(usual, share):
    robot, swept = swept_flat(share)
    assert usual[1] < share <= swept
    assert robot.now < 1.6 * usual[0].now
    assert len(returns_of(robot)) == 1
    assert float(returns_of(robot)[0][2]) < 100 * share
    told = f"; {100 * share:.2f} % asked for: {100 * swept:.2f} % but for strips a pixel wide"
    assert told in robot.mission.reason
    assert floor_report(robot.mission).reached_m2 > floor_report(usual[0].mission).reached_m2


def test_without_a_share_it_does_not_return_and_names_none(usual):
    assert not returns_of(usual[0])
    assert "asked for" not in usual[0].mission.reason


def test_a_share_that_cannot_be_swept_ends_the_order_all_the_same():
    robot, swept = swept_flat(1.0)
    assert 0.99 < swept < 1.0
    assert len(returns_of(robot)) <= 3
    assert "; 100.00 % asked for: 99." in robot.mission.reason
    assert robot.mission.reason.startswith("every reachable cell is covered")


def test_it_returns_before_the_way_home_not_from_there():
    home = CommandReceived(1, "start", read_order({"return_home": True}))
    robot, swept = swept_flat(0.99, home)
    assert swept >= 0.99
    assert returns_of(robot)
    began = next(at for at, reason in enumerate(robot.reasons) if RETURNS.fullmatch(reason))
    assert not any("home" in reason for reason in robot.reasons[:began])
    assert np.hypot(*np.subtract(robot.at, (0.6, 0.6))) < CONFIG.footprint.cell_m


def test_an_order_out_of_time_keeps_its_covered_cells():
    ends = []
    for share in (None, 0.99):
        start = CommandReceived(1, "start", read_order({"until_min": 0.8}))
        robot, _ = swept_flat(share, start)
        assert "time is up" in robot.mission.reason
        ends.append(robot.mission.coverage().covered)
    # Its line sweeps more in passing, so it comes less far.
    assert ends[1] > 0.8 * ends[0] > 0


def test_the_same_order_given_again_begins_anew():
    start = CommandReceived(1, "start", read_order({}))
    robot, _ = swept_flat(1.0, start)
    share = robot.mission.line.left.share
    raised, least_m2 = share._raised, share._least_m2
    assert raised > RAISED
    assert least_m2 > 4.0
    robot.tell(replace(start, number=2))
    robot.drive()
    assert (share._raised, share._least_m2) == (RAISED, 0.0)


def test_rooms_in_turn_are_all_covered_before_it_returns():
    line = replace(LINES["quick"], swept=0.99)
    sweeping = replace(CONFIG.sweeping, line=line)
    config = with_policy(replace(CONFIG, sweeping=sweeping), by_room="always")
    robot = robot_on(building(*BOTH), at=(1.3, 1.3), config=config)
    for _ in range(LOOKS):
        robot.now += 1.01 * PERIOD_S
        robot.tell()
    robot.finish()
    reasons = [reason.partition(" for ")[0] for reason in robot.reasons]
    assert reasons.index("floor planned first is done: the rest") < reasons.index("returns")
    assert "99.00 % asked for: 99." in robot.mission.reason


def test_as_few_cells_are_opened_as_suffice_with_a_margin():
    share = AskedShare(0.99)
    # 0.2 m2 are missing, so cells with 0.3 m2 are opened; the last cell has too little.
    cells, counts = pixels(0.05, 0.2, 0.1, 0.5 * LEAST_M2)
    assert share.returns_to(Tally(0.6), cells, counts) == [(0, 1), (0, 2)]
    assert share.priced(71.0) == "returns for 0.60 of 40.0 m2: 98.5 % swept, takes 1 min 11 s"
    assert not share.why
    assert AskedShare(0.99).returns_to(Tally(0.4), cells, counts) == []
    assert AskedShare(0.99).returns_to(Tally(0.6), cells[3:], counts[3:]) == []
    assert AskedShare(0.99).returns_to(Tally(40.0), cells, counts) == [(0, 1), (0, 2), (0, 0)]


def test_a_return_that_gains_little_is_the_last_one_of_a_pass():
    share, found = AskedShare(0.99), pixels(0.3)
    share.begin("first pass")
    assert share.returns_to(Tally(0.6), *found)
    missing_m2 = 0.6 - 0.4
    assert not share.returns_to(Tally(0.6 - 0.5 * LEAST_GAIN * missing_m2), *found)
    assert share.returns_to(Tally(0.6 - 1.5 * LEAST_GAIN * missing_m2), *found)
    assert not share.returns_to(Tally(0.6), *found)
    assert not share.why
    share.begin("second pass")
    assert share.returns_to(Tally(0.6), *found)


def test_floor_has_a_higher_price_while_the_share_is_missing():
    share = AskedShare(0.99)
    assert share.factor(Tally(30.0, passed_m2=0.05)) == 1.0
    assert share.factor(Tally(30.0, passed_m2=0.15)) == RAISED
    for factor, left_m2 in ((RAISED, 0.7), (RAISED**2, 0.6), (RAISED**3, 0.5), (RAISED**3, 0.45)):
        assert share.returns_to(Tally(left_m2), *pixels(0.3))
        assert share.factor(Tally(left_m2)) == factor
    assert AskedShare(None).factor(Tally(30.0, passed_m2=9.0)) == 1.0
