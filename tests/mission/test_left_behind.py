"""Floor that is out of reach as the robot sets out for home, and opens while it is on its way."""

import pytest

from fasaco_edge.mission.config import Place
from fasaco_edge.mission.work.order_state import Stage
from tests.mission.world import CELL, CONFIG, idle, patch, with_policy

# Home is in the small room.
ROOMS = ("...#......", "...#......", "..........", "...#......")
DOOR = (1, 3)
START = (0, 9)
HOME = Place(x_m=0.5 * CELL, y_m=0.5 * CELL)
SHUT, OPEN = patch("#", at=DOOR), patch(".", at=DOOR)


def returning(retries=2, rows=ROOMS):
    """A robot that sets out for home while the door is shut."""
    config = with_policy(CONFIG, home=HOME, retries=retries, retry_s=5.0)
    drive = idle(*rows, cell=START, config=config)
    drive.command("start", {"return_home": True})
    drive.tell(SHUT)
    assert until(drive, lambda: drive.mission.order_state.stage is Stage.RETURNING)
    return drive


def until(drive, holds, ticks=400):
    for _ in range(ticks):
        if holds():
            return True
        drive.tick()
    return holds()


def ends(drive):
    return until(drive, lambda: drive.mission.order_state.stage is Stage.OVER)


@pytest.mark.parametrize("retries", [0, 2])
def test_a_way_home_that_opens_leads_over_the_floor_left(retries):
    drive = returning(retries)
    until(drive, lambda: drive.now > 60.0)
    assert drive.mission.reason == "no way home: waits for a map that shows one"
    drive.tell(OPEN)
    assert ends(drive)
    assert drive.mission.reason.startswith("every reachable cell is covered")
    assert drive.cell == (0, 0)


def test_a_narrow_opening_does_not_turn_the_robot_back():
    drive = returning(rows=("##########", *ROOMS))
    drive.tell(patch("......", at=(4, 4)))
    until(drive, lambda: drive.now > 60.0)
    assert drive.mission.order_state.stage is Stage.RETURNING


def test_a_door_that_opens_repeatedly_does_not_delay_the_end():
    drive = returning()
    turned = 0
    for _ in range(10):
        if not until(drive, lambda: drive.mission.order_state.stage is Stage.RETURNING):
            break
        drive.tell(OPEN, after=5.0)
        turned += drive.mission.order_state.stage is Stage.RETRYING
        drive.tell(SHUT)
    assert turned == 3
    drive.tell(OPEN)
    assert ends(drive)
    assert "left over" in drive.mission.reason
