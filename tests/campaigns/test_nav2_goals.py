"""The campaign's short form: a part of a line, with all that goes wrong."""

from tests.campaigns.nav2_goals import run_mission


def test_a_line_is_driven_to_its_end_despite_faults():
    mission = run_mission("all", 6.0, speed_m_s=1.0, seed=5)
    assert mission.complete, mission
    # Goals begin where the robot is.
    assert mission.again_m < 1.0, mission
