"""What a mission claims to be swept by a base that drives beside its line."""

import pytest

from fasaco_edge.daemon.loop.mission_reports import floor_report
from fasaco_edge.mission.events import State
from tests.mission.offset_base import bare_room, driven, small_flat

# The most that a claim may be above the truth.
CLAIM = 0.02


def test_floor_beside_a_base_off_its_line_is_not_called_swept():
    outcome = driven(bare_room(), left_m=0.12)
    assert outcome.mission.state is State.DONE
    assert outcome.claimed <= outcome.swept + CLAIM
    assert outcome.claimed <= outcome.known + CLAIM


def test_floor_left_by_the_base_is_swept_later_or_reported():
    outcome = driven(small_flat(), left_m=0.12, poses_hz=20.0, tick_s=0.05)
    assert outcome.mission.state is State.DONE
    # 85 % without; of a twentieth it is only told.
    assert outcome.swept > 0.95
    left_m2 = sum(left.m2 for left in floor_report(outcome.mission).left)
    assert 0.0 < left_m2 < 0.3
    told = floor_report(outcome.mission)
    assert outcome.claimed <= outcome.swept + CLAIM
    assert f"{told.reached_m2:.1f} of {told.reachable_m2:.1f} m2" in outcome.mission.reason


def test_strips_due_to_raster_differences_are_not_driven_to():
    outcome = driven(bare_room(0.013, 0.0088))
    assert outcome.mission.state is State.DONE
    assert outcome.swept > 0.995
    assert outcome.seconds < 120.0
    assert abs(outcome.claimed - outcome.known) < 0.005


@pytest.mark.parametrize(("poses_hz", "speed_m_s", "known"), [(1.0, 0.7, 0.98), (0.5, 0.7, 0.7)])
def test_sparse_poses_are_joined_where_the_robot_can_have_driven(poses_hz, speed_m_s, known):
    outcome = driven(bare_room(), poses_hz=poses_hz, speed_m_s=speed_m_s, most_s=400.0)
    assert outcome.mission.state is State.DONE
    assert not outcome.troubles
    assert outcome.swept > 0.99
    assert outcome.known > known
    assert outcome.false < 0.005
    assert outcome.claimed <= outcome.known + CLAIM


def test_noise_makes_no_more_be_claimed_and_takes_no_more_time():
    outcome = driven(bare_room(), noise_m=0.02)
    assert outcome.mission.state is State.DONE
    assert outcome.claimed <= outcome.swept + CLAIM
    assert outcome.false < 0.005
    assert outcome.known > 0.9
    assert outcome.seconds < 160.0


@pytest.mark.parametrize(
    ("left_m", "noise_m", "said"),
    [
        (0.08, 0.0, "drives 8 cm left of its line"),
        (-0.05, 0.02, "drives 5 cm right of its line"),
        (0.02, 0.02, None),
    ],
)
def test_a_base_that_drives_beside_its_line_is_reported(left_m, noise_m, said):
    outcome = driven(bare_room(), left_m=left_m, noise_m=noise_m, most_s=120.0)
    assert outcome.troubles.get("beside_line") == said
