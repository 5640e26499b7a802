"""A frame counts by map and pose together: the daemon's part, with progress on disk."""

from __future__ import annotations

from tests.support.outsider import Outsider
from tests.support.processes import daemon_process
from tests.support.rooms import (
    HALL,
    begin,
    drive,
    lanes,
    map_bytes,
)


def aside(folder):
    return sorted(path.name for path in (folder / "state").glob("*.mismatch-*"))


def test_a_map_in_a_wrong_frame_after_a_restart_changes_nothing(tmp_path):
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
