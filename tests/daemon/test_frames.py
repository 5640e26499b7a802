"""A frame counts by map and pose together: the daemon's part, with progress on disk."""

from __future__ import annotations

import time

from tests.support.outsider import Outsider
from tests.support.processes import daemon_process
from tests.support.rooms import (
    HALL,
    WALL,
    Pixels,
    begin,
    drive,
    fill,
    lanes,
    map_bytes,
    pose_bytes,
)


def aside(folder):
    return sorted(path.name for path in (folder / "state").glob("*.mismatch-*"))


def test_one_map_in_a_wrong_frame_after_a_restart_costs_nothing(tmp_path):
    with daemon_process(tmp_path) as running, Outsider(running.endpoint) as client:
        begin(client)
        drive(client, lanes(30))
    with daemon_process(tmp_path) as running, Outsider(running.endpoint) as client:
        client.put("map", map_bytes(HALL, frame="odom"))
        status = client.wait_status(lambda status: status["errors"]["total"])
        assert status["reason"].startswith("no map in frame 'map' yet")
        status = begin(client, at=29)
        assert status["coverage"]["covered"] == 30
        assert status["map"]["frame"] == "map"
        assert status["ledger"]["fault"] is None
    assert aside(tmp_path) == []


def another_floor() -> Pixels:
    """Walls where the hall's floor is, around the same place."""
    return fill(fill(HALL, 0.0, 1.2, 100.0, 100.0, WALL), 3.0, 0.05, 3.4, 100.0, WALL)


def test_another_floor_in_the_same_frame_is_swept_from_scratch(tmp_path):
    """By a lift whose place is the same on both floors; the ledger of the first one is kept."""
    with daemon_process(tmp_path) as running, Outsider(running.endpoint) as client:
        begin(client)
        drive(client, lanes(30))
        deadline = time.monotonic() + 60.0
        states = set()
        while not client.ask_status()["errors"]["by_code"].get("ledger_mismatch"):
            assert time.monotonic() < deadline
            client.put("map", map_bytes(another_floor()))
            for _ in range(5):
                client.put("pose", pose_bytes(0.45, 0.45))
                time.sleep(0.1)
            states.add(client.ask_status()["state"])
        status = client.wait_status(lambda status: status["coverage"]["covered"] <= 1)
        assert "of another building than the map" in status["ledger"]["fault"]
        assert "blocked" in states
        assert "done" not in states
    assert aside(tmp_path) != []


def test_keep_outs_of_another_floor_still_block_after_a_restart(tmp_path):
    mission = {"keep_out": [[[1.0, 1.0], [1.5, 1.0], [1.5, 1.5]]]}

    def wait_blocked(client):
        deadline = time.monotonic() + 60.0
        while "given for the map in frame 'map'" not in client.ask_status()["reason"]:
            assert time.monotonic() < deadline
            client.put("map", map_bytes(HALL, frame="upstairs"))
            client.put("pose", pose_bytes(0.45, 0.45, frame="upstairs"))
            time.sleep(0.2)
        status = client.ask_status()
        assert status["state"] == "blocked"
        assert status["errors"]["by_code"]["places_elsewhere"] == 1

    with daemon_process(tmp_path, mission=mission) as running, Outsider(running.endpoint) as client:
        begin(client)
        wait_blocked(client)
    with daemon_process(tmp_path, mission=mission) as running, Outsider(running.endpoint) as client:
        wait_blocked(client)
