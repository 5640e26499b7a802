"""The path exit: what is published when a mission rests, ends, fails or is replaced."""

import pytest

from fasaco_edge.mission.core.path_exit import PathExit
from tests.mission.world import started

ROOM = ["......"] * 4


class Sent:
    """Publishes all, or fails while it is told to.

    Attributes:
        paths: what was published, in order.
    """

    def __init__(self):
        self.paths, self.fails = [], 0

    def __call__(self, path):
        if self.fails:
            self.fails -= 1
            return False
        self.paths.append(path)
        return True


def driving():
    """A mission that drives, the exit with its path published, and what was sent."""
    drive = started(*ROOM)
    exit_, sent = PathExit(), Sent()
    exit_.follow(drive.mission, drive.updates[-1])
    exit_.send(sent)
    assert not sent.paths[-1].stops
    return drive, exit_, sent


def step(drive, exit_, sent, *events):
    exit_.follow(drive.mission, drive.tell(*events).path)
    exit_.send(sent)


def test_a_mission_that_ends_has_its_path_withdrawn_once():
    _, exit_, sent = driving()
    for _ in range(2):
        exit_.withdraw("the configuration has changed")
        exit_.send(sent)
    driven, empty = sent.paths
    assert empty.stops
    assert (empty.reason, empty.revision) == ("the configuration has changed", driven.revision + 1)
    assert (empty.frame, empty.map_stamp_ns) == (driven.frame, driven.map_stamp_ns)


def test_a_path_decided_on_but_not_sent_is_withdrawn_too():
    drive, exit_, sent = driving()
    exit_.follow(drive.mission, drive.mission.route.publish_anew("again", 1.0))
    exit_.withdraw("the mission failed")
    exit_.send(sent)
    assert sent.paths[-1].stops


def test_a_path_of_another_daemon_or_process_is_voided():
    exit_, sent = PathExit(), Sent()
    exit_.void("this daemon plans from now on", "map")
    exit_.send(sent)
    (empty,) = sent.paths
    assert empty.stops
    assert (empty.frame, empty.revision) == ("map", 0)


def test_another_daemons_path_is_voided_after_an_own_empty_path():
    _, exit_, sent = driving()
    exit_.withdraw("stop")
    exit_.send(sent)
    exit_.void("another daemon planned, too", "map")
    exit_.send(sent)
    assert [path.reason for path in sent.paths[-2:]] == ["stop", "another daemon planned, too"]


@pytest.mark.parametrize("fails", [1, 2, 5])
def test_a_stop_that_cannot_be_sent_is_tried_until_it_is(fails):
    _, exit_, sent = driving()
    sent.fails = fails
    exit_.withdraw("stop")
    for _ in range(fails + 1):
        exit_.send(sent)
    assert len(sent.paths) == 2
    assert sent.paths[-1].stops
    assert exit_.send(sent) is None


def test_a_path_that_cannot_be_sent_becomes_a_stop():
    drive, exit_, sent = driving()
    sent.fails = 1
    exit_.follow(drive.mission, drive.mission.route.publish_anew("again", 1.0))
    exit_.send(sent)
    assert [path.stops for path in sent.paths] == [False, True]


def test_a_daemon_that_waits_for_another_sends_nothing():
    _, exit_, sent = driving()
    sent.fails = 1
    exit_.withdraw("stop")
    exit_.send(sent)
    exit_.forget()
    assert exit_.send(sent) is None
    assert len(sent.paths) == 1


def test_without_a_change_no_path_is_sent():
    drive, exit_, sent = driving()
    for _ in range(3):
        step(drive, exit_, sent)
    assert len(sent.paths) == 1
