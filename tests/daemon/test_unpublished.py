"""What cannot be told, planned or understood costs itself alone: the daemon goes on."""

from __future__ import annotations

import sys
import time

import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.wire.messages.paths import decode_path
from tests.daemon.breaking import MISSION_M, MOST_UNSENT, PHEROMONE_M, PLANNER_M, UNSENT
from tests.support import processes
from tests.support.outsider import joined_daemon
from tests.support.rooms import map_bytes, pose_bytes, room
from tests.support.waiting import until
from tests.wire import oracle

# A robot that stands says so from time to time; so long is a cycle of the daemon's and more [s].
POSE_S = 0.1


def far_map(x, y):
    """A room with its corner at (x, y) [m]."""
    pixels = room(3.0, 3.0)
    message = oracle.occupancy_grid(
        "map", 1, GridGeometry(*pixels.shape, 0.05, Pose2D(x, y)), pixels
    )
    return oracle.to_bytes("nav_msgs/msg/OccupancyGrid", message)


def stand(client, holds, x=0.75, y=0.75):
    deadline = time.monotonic() + 60.0
    while not holds(status := client.ask_status()):
        assert time.monotonic() < deadline, status
        client.put("pose", pose_bytes(x, y))
        time.sleep(POSE_S)
    return status


@pytest.fixture
def breaking(tmp_path, monkeypatch):
    program = (sys.executable, "-m", "tests.daemon.breaking")
    monkeypatch.setattr(processes, "PROGRAM", program)
    # Pheromone is of full plans by the colony alone.
    with joined_daemon(tmp_path, planner={"name": "fasaco"}) as (running, client):
        yield running, client
        # Told by its exit otherwise: a traceback is in the log here.
        running.kill()


def test_a_map_at_the_limit_is_covered(tmp_path):
    corner = 2e7 - 6.0, -2e7 + 0.3
    with joined_daemon(tmp_path) as (_, client):
        subscriptions = [client.listen(name) for name in ("path", "coverage", "pheromone")]
        client.put("map", far_map(*corner))
        x, y = corner[0] + 1.05, corner[1] + 1.05
        status = stand(client, lambda status: status["state"] == "covering", x, y)
        assert status["errors"]["total"] == 0
        assert status["coverage"]["coverable"] >= 49
        for receiver in subscriptions[:2]:
            receiver.wait(lambda heard: True)


def test_a_failing_planner_affects_only_this_map(breaking):
    running, client = breaking
    client.put("map", map_bytes(room(PLANNER_M, 3.0)))
    status = stand(client, lambda status: status["state"] == "blocked")
    assert status["reason"].startswith("plan 1 failed: IndexError: index 7 is out of bounds; tried")
    assert status["errors"]["by_code"] == {"plan_failed": 1}
    client.put("map", map_bytes(room(3.0, 3.0)))
    stand(client, lambda status: status["state"] == "covering")
    assert running.log_text().count("Traceback") == 1


def test_an_unencodable_message_affects_no_other(breaking):
    running, client = breaking
    client.listen("pheromone", late=False)
    client.put("map", map_bytes(room(PHEROMONE_M, 3.0)))
    status = stand(client, lambda status: "not_published" in status["errors"]["by_code"])
    assert status["errors"]["last"].startswith("pheromone was not published: ")
    stand(client, lambda status: status["state"] == "covering")
    assert running.log_text().count("pheromone was not published") == 1


def test_a_map_that_breaks_the_mission_is_given_up_for_the_next(breaking):
    running, client = breaking
    client.put("map", map_bytes(room(MISSION_M, 3.0)))
    status = stand(client, lambda status: status["errors"]["by_code"].get("mission_broke") == 2)
    status = stand(client, lambda status: status["state"] == "waiting for map")
    assert status["reason"] == (
        "the mission failed: ZeroDivisionError: division by zero: waits for another map"
    )
    client.put("map", map_bytes(room(3.0, 3.0)))
    stand(client, lambda status: status["state"] == "covering")
    assert running.process.poll() is None


def test_a_stop_that_fails_before_a_mission_is_sent_later(tmp_path, monkeypatch):
    """The robot may follow the path of an earlier daemon; without a map there is no mission."""
    program = (sys.executable, "-m", "tests.daemon.breaking", UNSENT)
    monkeypatch.setattr(processes, "PROGRAM", program)
    with joined_daemon(tmp_path) as (running, client):
        unsent = {"not_published": MOST_UNSENT}
        client.wait_status(lambda status: status["errors"]["by_code"] == unsent)
        reply = until(lambda: client.get("@rpc/path")[0].ok)
        assert not len(decode_path(bytes(reply.payload)).xy)
        # Told by its exit otherwise: a traceback is in the log here.
        running.kill()
