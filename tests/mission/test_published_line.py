"""The published line holds still for the next metres, and changes far ahead wait."""

import math

import numpy as np
import pytest

from fasaco_edge.daemon.loop.status import path_report
from fasaco_edge.mission.line.published_line import HELD_M, PublishedLine
from tests.campaigns.lab.path_changes import PathAhead, differs
from tests.mission.line_robot import PIXEL_M, LineRobot
from tests.support.rooms import UNKNOWN, WALL, fill, room

ZIGZAG = np.array([(0.4 * number, 0.3 * (number % 2)) for number in range(60)])
EDGE_M = 0.5


@pytest.fixture
def published():
    """The zigzag, published as a whole."""
    published = PublishedLine(0.25)
    published.record_published(ZIGZAG, len(ZIGZAG))
    return published


def look(published, line, now=0.0, *, is_settled=True, leads_on=False):
    published.compare(line)
    return published.is_due(now, is_settled, lambda points: leads_on)


def test_a_change_waits_until_the_robot_is_near(published):
    assert not look(published, ZIGZAG)
    changed = ZIGZAG.copy()
    changed[12] += 0.1
    due_at = [number for number in range(12) if look(published, changed[number:])]
    # Of the points that stay, the last is the eleventh.
    assert due_at == [number for number in range(12) if (11 - number) * EDGE_M <= 2.25]


def test_a_near_change_waits_briefly_for_a_running_plan(published):
    cut = ZIGZAG[:5]
    assert not look(published, cut, 1.0, is_settled=False)
    assert not look(published, cut, 1.9, is_settled=False)
    assert look(published, cut, 2.0, is_settled=False)
    assert look(published, cut, 1.0, is_settled=True)


@pytest.mark.parametrize("left", [1, 2, 3])
def test_a_change_just_ahead_does_not_wait(published, left):
    assert look(published, ZIGZAG[:left], is_settled=False)


def test_a_published_line_that_leads_on_waits_for_the_plan(published):
    assert not look(published, ZIGZAG[:2], 1.0, is_settled=False, leads_on=True)
    assert look(published, ZIGZAG[:2], 1.1, is_settled=False, leads_on=False)
    assert look(published, ZIGZAG[:2], 2.0, is_settled=False, leads_on=True)


def test_a_robot_without_a_line_gets_one():
    published = PublishedLine(0.25)
    assert look(published, ZIGZAG, is_settled=False)
    published.record_published(ZIGZAG, len(ZIGZAG))
    published.reset()
    assert look(published, ZIGZAG, is_settled=False)


def test_a_line_that_ends_at_the_robot_is_published_once():
    """It was published in each step, and the robot never counted as one that has waited."""
    published, here = PublishedLine(0.25), ZIGZAG[:1]
    assert look(published, here)
    published.record_published(here, 1)
    assert not look(published, here, 1.0)
    assert look(published, ZIGZAG, 2.0)


def test_the_published_line_is_held_as_far_as_it_is_polished(published):
    published.compare(ZIGZAG)
    assert (published.held - 1) * EDGE_M == pytest.approx(HELD_M, abs=EDGE_M)
    published.compare(ZIGZAG[4:])
    assert (published.held - 1) * EDGE_M == pytest.approx(HELD_M - 4 * EDGE_M, abs=EDGE_M)
    published.record_published(ZIGZAG, 3)
    published.compare(ZIGZAG)
    assert published.held == 3


def test_pixels_that_flicker_far_ahead_change_nothing_yet():
    """Each of them brought a path, and the next map another one: 71 in these two minutes."""
    assert sum(changes_nearby(seed) for seed in (1, 2)) <= 2 * 7


def changes_nearby(seed):
    """Return how often the next metres changed in two minutes of flicker."""
    pixels = room(6.0, 4.0)
    random = np.random.default_rng(seed)
    robot = LineRobot(pixels, (1.0, 1.0))
    robot.wait(3.0, lambda robot: False)
    seen, changes = len(robot.paths), 0
    for number in range(600):
        before = PathAhead(np.array([(robot.x, robot.y), *robot.path]))
        if number % 15:
            robot.step()
        else:
            robot.show(with_specks(pixels, random, (robot.x, robot.y)))
        if len(robot.paths) > seen:
            seen = len(robot.paths)
            after = PathAhead(np.array([(robot.x, robot.y), *robot.path]))
            changes += differs(before.ahead(), after.ahead())
    assert len(robot.paths) <= 24
    return changes


def test_a_robot_that_stands_gets_a_new_path_at_once():
    """On a bench, say, where somebody publishes maps and waits for paths."""
    pixels = room(6.0, 4.0)
    robot = LineRobot(pixels, (1.0, 1.0))
    robot.wait(3.0, lambda robot: False)
    robot.is_stuck = True
    robot.wait(5.0, lambda robot: False)
    before = len(robot.paths)
    shown = pixels.copy()
    shown[30:50, 90:110] = 100
    robot.show(shown)
    assert robot.wait(1.0, lambda robot: len(robot.paths) > before)


def with_specks(pixels, random, away_from):
    """Return a map with up to two pixels more that are occupied, far from the robot."""
    shown = pixels.copy()
    for row, col in random.integers(6, (74, 114), (2, 2)):
        if math.dist((PIXEL_M * col, PIXEL_M * row), away_from) > 3.0:
            shown[row, col] = 100
    return shown


def test_no_path_has_more_steps_to_go_than_it_has():
    """A longer path waits until the robot comes near its change; the status is of the one sent."""
    whole = fill(room(8.0, 5.0), 4.0, 1.5, 4.2, 5.0, WALL)
    robot = LineRobot(fill(whole, 3.0, 0.0, 8.0, 5.0, UNKNOWN), (0.6, 0.6))
    waited = 0
    for tick in range(160):
        known_m = min(3.0 + 0.5 * (tick // 40), 8.0)
        if tick % 40:
            robot.step()
        else:
            robot.show(fill(whole, known_m, 0.0, 8.0, 5.0, UNKNOWN))
        told = path_report(robot.exit.newest, robot.mission)
        if told is not None:
            assert told.remaining_steps <= told.steps
            waited += len(robot.mission.route.path.ahead) - 1 > told.steps
    assert waited
