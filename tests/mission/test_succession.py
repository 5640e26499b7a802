"""A mission that goes on for another one, as after a reload or a mask: no limit begins anew."""

import pytest

from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.core.standing import STANDING_S
from fasaco_edge.mission.events import MapReceived, State
from tests.mission.test_trouble_at_rest import (
    A_MINUTE_S,
    AT_REST,
    SILENT,
    charging,
    codes,
    covering,
    live,
)
from tests.mission.world import CONFIG, Drive, building, patch, pose_at, with_policy

# Shorter than any limit.
PERIOD_S = 10


def replace(drive):
    """Let another mission go on, as the daemon does."""
    before, after = drive.mission, Mission(drive.config)
    after.restore(before.snapshot(), before.order_state)
    after.continue_from(before)
    drive.mission, drive.request, drive.walk, drive.revision = after, None, [], 0
    drive.tell(*before.newest_inputs())


def live_through(drive, seconds, without="", **battery):
    """Let a robot stand while its mission is replaced again and again."""
    for _ in range(seconds // PERIOD_S):
        live(drive, PERIOD_S, without, **battery)
        replace(drive)


@pytest.mark.parametrize("kind", SILENT)
@pytest.mark.parametrize("state", AT_REST)
def test_silence_at_rest_is_reported_within_a_minute(state, kind):
    drive = AT_REST[state]()
    live_through(drive, PERIOD_S, rise=0.001)
    assert (drive.mission.state, codes(drive)) == (state, [])
    live_through(drive, A_MINUTE_S, without=kind, rise=0.001)
    assert drive.mission.state is state
    assert codes(drive) == [SILENT[kind]]
    (trouble,) = drive.mission.troubles
    assert drive.now - trouble.since > PERIOD_S, "it is one trouble all the time"


def test_a_pose_that_never_came_is_missing():
    drive = Drive((0, 0), MapReceived(building("....")), config=with_policy(CONFIG))
    for _ in range(A_MINUTE_S // PERIOD_S):
        drive.tell(after=PERIOD_S)
        replace(drive)
    assert (drive.mission.state, codes(drive)) == (State.WAITING_FOR_POSE, ["no_pose"])


def test_a_dead_dock_is_found():
    drive = charging(power="discharging")
    live_through(drive, A_MINUTE_S)
    assert (drive.mission.state, codes(drive)) == (State.CHARGING, ["no_current"])


def test_a_charging_robot_stays_docked_and_knows_its_battery():
    drive = charging()
    level = drive.mission.charging.gauge.level
    drive.level, drive.power = None, "discharging"
    row, col = drive.cell
    drive.cell = row + 0.9, col
    drive.tell(pose_at(*drive.cell))
    assert drive.mission.state is State.CHARGING, "its base moved it within reach of the contacts"
    replace(drive)
    assert (drive.mission.state, drive.walk) == (State.CHARGING, [])
    assert drive.mission.charging.gauge.level == level


def test_a_robot_that_stands_is_found():
    drive = covering()
    for _ in range(4 * int(STANDING_S) // PERIOD_S):
        replace(drive)
        for _ in range(PERIOD_S):
            drive.tell(patch(".", at=(0, 0)), pose_at(*drive.cell))
            if drive.request is not None:
                drive.plan()
    assert (drive.mission.state, codes(drive)) == (State.DEGRADED, ["stands"])


def test_poses_that_stop_after_a_change_of_frame_are_missed():
    """The last one lay in the frame before."""
    drive = Drive((0, 0), config=with_policy(CONFIG, lost_pose_s=3.0))
    drive.tell(MapReceived(building("........", frame="a")), pose_at(0, 0, frame="a"))
    drive.plan()
    drive.tell(pose_at(0, 1, frame="a"))
    while drive.mission.grid.frame == "a":
        drive.tell(MapReceived(building("........", frame="b")), pose_at(0, 1, frame="b"), after=1)
    assert codes(drive) == []
    drive.tell(after=4.0)
    assert codes(drive) == ["no_pose"]
