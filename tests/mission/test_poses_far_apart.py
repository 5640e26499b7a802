"""Poses so seldom that the track between them is unknown: the mission ends, and says so."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.daemon.loop.mission_reports import floor_report, mission_report
from fasaco_edge.mission.events import PoseReceived
from fasaco_edge.serve import plain
from fasaco_edge.wire.documents.status import Status
from tests.mission.line_robot import CONFIG, SPEED_M_S, LineRobot
from tests.mission.world import with_policy


class SeldomKnown(LineRobot):
    """A robot whose mission gets a pose each so many ticks alone."""

    tick_s = 0.1
    every, number = 50, 0

    def arrived(self, events):
        self.number += 1
        if self.number % self.every == 1:
            return events
        return [event for event in events if not isinstance(event, PoseReceived)]


def robot(rows, cols, every_s=5.0):
    """A robot in a room of so many pixels."""
    config = replace(CONFIG, speed_m_s=SPEED_M_S)
    config = with_policy(config, retries=1, retry_s=5.0, lost_pose_s=3.0)
    room = np.pad(np.zeros((rows, cols), np.int8), 1, constant_values=100)
    found = SeldomKnown(room, (0.5, 0.5), config)
    found.every = round(every_s / found.tick_s)
    return found


def status_of(mission):
    """The mission's part of a status."""
    return Status(
        reason=mission.reason,
        floor=floor_report(mission),
        mission=mission_report(mission, mission.order_state),
    )


def test_poses_too_far_apart_are_reported():
    found = robot(40, 60)
    assert found.wait(100.0, lambda robot: "poses are too far apart" in robot.mission.reason)
    assert found.mission.state == "degraded"


@pytest.fixture(scope="module")
def seen():
    """A robot that is done, whose mission gets a pose a second."""
    seen = robot(40, 60, every_s=1.0)
    assert seen.wait(400.0, lambda robot: robot.mission.state == "done")
    return seen


def test_a_robot_that_drives_on_unseen_is_not_led_back(seen):
    found = robot(40, 60, every_s=3.5)
    assert found.wait(1500.0, lambda robot: robot.mission.state == "done")
    assert found.mission.reason.startswith("every reachable cell is covered; ")
    far_apart = "; poses are too far apart, and what lies between them does not count"
    assert far_apart in found.mission.reason
    reasons = [why for _, _, why in found.paths]
    assert not [why for why in reasons if why.startswith("the pose came back")]
    assert "too far apart" not in seen.mission.reason
    # Floor that no pose shows as swept is not called small, or not worth the way.
    owners = [part.reason for part in plain.left(status_of(found.mission))]
    assert plain.SELDOM in owners
    assert plain.SELDOM not in [part.reason for part in plain.left(status_of(seen.mission))]
    assert found.now < 4.0 * seen.now
