"""A stop reaches the wheels: whatever ends a mission, its path is withdrawn on the bus."""

from __future__ import annotations

import time

import pytest

from tests.daemon.test_mask_topic import MISSION, put_mask
from tests.daemon.test_mission import planned
from tests.support.outsider import TIMEOUT_S, joined_daemon
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import FREE, WALL, fill, room, show_room
from tests.support.router import router_process

ROOM = room(6.0, 4.0)
BLANK = fill(ROOM, 0.0, 0.0, 6.0, 4.0, FREE)
OVER_ROBOT = fill(BLANK, 0.3, 0.3, 2.0, 2.0, WALL)


def drive(outsider, paths):
    deadline = time.monotonic() + TIMEOUT_S
    while not any(map(is_driven, paths.heard)):
        assert time.monotonic() < deadline, outsider.ask_status()
        show_room(outsider, ROOM, 1.0, 1.0)
        time.sleep(0.2)
    outsider.wait_status(lambda status: status["state"] == "covering")
    return len(paths.heard)


def is_driven(heard):
    return len(planned(heard)[0]) > 0


def stops(heard):
    return not is_driven(heard)


@pytest.fixture
def bus():
    endpoint = free_endpoint()
    with router_process(endpoint):
        yield {"listen": [], "connect": [endpoint], "mode": "client"}


def test_a_mask_over_a_driving_robot(tmp_path):
    with joined_daemon(tmp_path, mission=dict(MISSION)) as (_, outsider):
        put_mask(outsider, BLANK)
        paths = outsider.listen("path")
        since = drive(outsider, paths)
        put_mask(outsider, OVER_ROBOT)
        paths.wait(stops, since)
        status = outsider.wait_status(lambda status: status["state"] == "blocked")
        assert status["reason"].startswith("robot is in a keep-out zone")
        assert stops(paths.heard[-1])


def test_the_end_of_the_daemon(tmp_path, bus):
    with joined_daemon(tmp_path, bus=bus) as (running, outsider):
        paths = outsider.listen("path")
        since = drive(outsider, paths)
        running.stop()
        assert b"the daemon ends" in paths.wait(stops, since).attachment


def test_a_daemon_that_was_killed_and_started_again(tmp_path, bus):
    """Its follower may still have the path of before."""
    with joined_daemon(tmp_path, bus=bus) as (running, outsider):
        drive(outsider, outsider.listen("path"))
        running.kill()
        begun = outsider.listen("path", late=False, begins=True)
        with daemon_process(tmp_path, bus=bus):
            # No map and no pose has come since.
            assert stops(begun.wait(lambda heard: True))
            assert outsider.ask_status()["state"] in ("waiting for map", "loading")
