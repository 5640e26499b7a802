"""A mission over the bus, as a program that shares no code with the daemon lives it."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from tests.support.outsider import Outsider, joined_daemon
from tests.support.rooms import (
    FREE,
    RADIUS_M,
    RESOLUTION_M,
    TOOL_M,
    cells_of,
    covariant_bytes,
    coverable_cells,
    map_bytes,
    odometry_bytes,
    pillared_room,
    pose_bytes,
    room,
)
from tests.wire import oracle

START = (0.75, 0.75)


def planned(heard):
    """Return points (n, 2) and yaws (n,) of a path, as rosbags reads it."""
    message = oracle.from_bytes("nav_msgs/msg/Path", heard.payload)
    assert message.header.frame_id == "map"
    poses = [stamped.pose for stamped in message.poses]
    yaws = [2 * math.atan2(pose.orientation.z, pose.orientation.w) for pose in poses]
    return np.array([(pose.position.x, pose.position.y) for pose in poses]), np.array(yaws)


def about(heard):
    return json.loads(heard.attachment)


def covers(heard, pixels):
    points, _ = planned(heard)
    return len(points) > 0 and set(cells_of(points)) == coverable_cells(pixels)


@pytest.fixture(scope="module")
def pixels():
    return pillared_room()


@pytest.fixture(scope="module")
def path(daemon, pixels):
    with Outsider(daemon.endpoint) as outsider:
        receiver = outsider.listen("path")
        outsider.put("map", map_bytes(pixels, stamp_ns=12_000_000_034))
        outsider.put("pose", pose_bytes(*START))
        heard = receiver.wait(lambda heard: True)
        # The robot does not move: this path stays.
        outsider.wait_status(lambda status: status["state"] == "covering")
        return heard


def test_without_a_map_the_path_is_empty_and_coverage_an_error(tmp_path):
    with joined_daemon(tmp_path) as (_, outsider):
        begins = outsider.listen("path", begins=True).wait(lambda heard: True)
        assert about(begins)["revision"] == 0
        assert len(planned(begins)[0]) == 0
        for name in ("@rpc/path", "path"):
            assert outsider.ask(name) == begins
        for name in ("@rpc/coverage", "coverage"):
            (reply,) = outsider.get(name)
            assert reply.ok is None
            error = json.loads(reply.err.payload.to_bytes())
            assert error["code"] == "not_yet"
            assert name.removeprefix("@rpc/") in error["message"]
            assert error["hint"]
            assert "json" in str(reply.err.encoding)


def test_the_path_covers_every_cell_the_robot_fits_in(path, pixels):
    assert covers(path, pixels)
    points, _ = planned(path)
    assert cells_of(points)[0] == cells_of(np.array([START]))[0]
    assert np.hypot(*np.diff(points, axis=0).T) == pytest.approx(TOOL_M)


def test_the_robot_touches_no_wall_on_the_way(path, pixels):
    points, _ = planned(path)
    rows, cols = np.nonzero(pixels != FREE)
    between = np.linspace(points[:-1], points[1:], 7).reshape(-1, 2)
    beside = np.abs(between[:, None, 0] / 0.05 - (cols + 0.5)) - 0.5
    above = np.abs(between[:, None, 1] / 0.05 - (rows + 0.5)) - 0.5
    gap = 0.05 * np.hypot(beside.clip(0), above.clip(0)).min()
    assert gap > RADIUS_M


def test_each_pose_looks_to_the_next(path):
    points, yaws = planned(path)
    ahead = np.diff(points, axis=0)
    assert np.cos(yaws[:-1]) == pytest.approx(ahead[:, 0] / TOOL_M, abs=1e-9)
    assert np.sin(yaws[:-1]) == pytest.approx(ahead[:, 1] / TOOL_M, abs=1e-9)
    assert yaws[-1] == yaws[-2]


def test_encoding_and_attachment_say_what_it_is(path):
    assert path.encoding == "application/cdr;nav_msgs/msg/Path"
    note = about(path)
    points, _ = planned(path)
    assert note["revision"] == 1
    assert note["map_revision"] == 1
    assert note["map_stamp_ns"] == 12_000_000_034
    assert note["reason"] == "first plan"
    assert note["steps"] == len(points) - 1
    assert (note["planner"], note["seed"]) == ("colony-search", 0)
    assert note["ants"] > 0
    assert note["proposals"] > 0
    least_s = note["lower_bound_cost_s"]
    assert note["gap"] == pytest.approx(note["planned_cost_s"] / least_s - 1, abs=1e-3)
    assert note["plan_ms"] > 0
    stamp = oracle.from_bytes("nav_msgs/msg/Path", path.payload).header.stamp
    assert (stamp.sec, stamp.nanosec) == (12, 34)


def test_a_query_gets_the_published_bytes(path, outsider):
    for name in ("@rpc/path", "path"):
        answer = outsider.ask(name)
        assert answer == path
    for name in ("@rpc/status", "status"):
        assert outsider.ask(name).json()["state"] == "covering"


def test_a_late_joiner_gets_the_path_at_once(path, outsider):
    receiver = outsider.listen("path")
    assert receiver.wait(lambda heard: True) == path
    assert len(receiver.heard) == 1


def test_the_coverage_tells_what_is_where(path, pixels, outsider):
    heard = outsider.listen("coverage").wait(lambda heard: True)
    assert heard.encoding == "application/cdr;nav_msgs/msg/OccupancyGrid"
    grid = oracle.from_bytes("nav_msgs/msg/OccupancyGrid", heard.payload)
    assert grid.header.frame_id == "map"
    assert grid.info.resolution == pytest.approx(TOOL_M)
    cells = grid.data.reshape(grid.info.height, grid.info.width)
    row0 = round(grid.info.origin.position.y / TOOL_M)
    col0 = round(grid.info.origin.position.x / TOOL_M)
    where = {
        value: {(int(r) + row0, int(c) + col0) for r, c in np.argwhere(cells == value)}
        for value in (-1, 0, 50, 75, 100)
    }
    start = cells_of(np.array([START]))[0]
    assert where[50] == {start}
    assert where[0] | where[50] == coverable_cells(pixels)
    assert where[75] == where[-1] == set()
    assert len(where[100]) == cells.size - len(coverable_cells(pixels))


def test_the_status_has_all_its_members(path, pixels, outsider, daemon):
    status = outsider.wait_status(lambda status: status["coverage"] is not None)
    fits = coverable_cells(pixels)
    count = len(fits)
    # A cell is six pixels wide.
    free_pixels = sum((row // 6, col // 6) not in fits for row, col in np.argwhere(pixels == FREE))
    assert set(status) == {
        *("robot", "version", "state", "reason", "uptime_s", "map", "pose", "coverage", "path"),
        "battery",
        *("plan", "latency_ms", "loop_ms", "errors", "ledger", "recorder", "rss_mb", "cpu_s"),
        *("threads", "config", "mission", "claim", "floor", "drive", "fleet", "troubles"),
    }
    assert (status["robot"], status["state"], status["reason"]) == ("robot", "covering", "path 1")
    assert status["map"] == {
        "rows": pixels.shape[0],
        "cols": pixels.shape[1],
        "resolution_m": 0.05,
        "revision": 1,
        "stamp_ns": 12_000_000_034,
        "frame": "map",
        "lattice_deg": 0.0,
    }
    assert status["pose"] == {"x": START[0], "y": START[1], "yaw": 0.0}
    assert status["coverage"] == {
        "coverable": count,
        "covered": 1,
        "recovered": 0,
        "remaining": count - 1,
        "unreachable": 0,
        "covered_m2": pytest.approx(TOOL_M**2),
        "to_cover_m2": pytest.approx((count - 1) * TOOL_M**2),
        "free_out_of_reach_m2": pytest.approx(free_pixels * RESOLUTION_M**2, abs=1e-3),
        "fraction": pytest.approx(1 / count, abs=1e-4),
    }
    # The tool's disc, in pixels of 2.5 cm.
    swept_m2 = pytest.approx(math.pi / 4 * TOOL_M**2, rel=0.05)
    unknown = dict.fromkeys(("reachable_m2", "left", "out_of_reach", "possible_m2"))
    assert status["floor"] == {"swept_m2": swept_m2} | unknown
    note = about(path)
    figures = ("planner", "seed", "ants", "kicks", "proposals", "planned_steps", "planned_cost_s")
    saved = ("saved_by_ants_s", "saved_by_local_search_s", "saved_by_velocity_s")
    assert status["path"] == {
        "revision": 1,
        "steps": note["steps"],
        "remaining_steps": note["steps"],
        "reason": "first plan",
        "line_s": pytest.approx(note["planned_cost_s"], abs=0.06),
        # Cells are counted here: there is no line.
        "line_gap": None,
        **{
            name: note[name]
            for name in (*figures, *saved, "lower_bound_steps", "lower_bound_cost_s", "gap")
        },
    }
    attempts = status["plan"].pop("attempts")
    assert attempts >= 0
    assert status["plan"] == {"plans": 1, "unchanged": 0, "outdated": 0, "planning": False}
    assert status["latency_ms"]["plan"] > 0
    assert status["errors"] == {"total": 0, "last": "", "by_code": {}}
    planned_s = status["drive"]["planned_quarter_turn_s"]
    assert planned_s > 0
    unmeasured = dict.fromkeys(("speed_m_s", "quarter_turn_s", "half_turn_s"))
    assert status["drive"] == unmeasured | {"planned_quarter_turn_s": planned_s, "turns": 0}
    assert status["ledger"]["restored_cells"] == 0
    assert status["ledger"]["fault"] is None
    assert status["recorder"] is None
    assert status["troubles"] == []
    assert 50 < status["rss_mb"] < 400
    assert status["config"]["bus"]["listen"] == [daemon.endpoint]
    assert status["config"]["planner"]["velocities"] == "8:1"


def test_the_status_comes_once_a_second(path, outsider):
    first = outsider.wait_status(lambda status: True)["uptime_s"]
    later = outsider.wait_status(lambda status: status["uptime_s"] > first + 1.5)["uptime_s"]
    said = sorted({heard.json()["uptime_s"] for heard in outsider.status.heard})
    assert later - first < 3.5
    assert max(np.diff(said)) < 1.5


# What follows changes the mission: each test brings its own daemon.


@pytest.fixture
def fresh(tmp_path):
    with joined_daemon(tmp_path) as (_, client):
        yield client


def test_poses_may_come_as_other_messages_that_say_so(fresh):
    receiver = fresh.listen("path")
    fresh.put("map", map_bytes(room(3.0, 3.0)))
    fresh.put("pose", covariant_bytes(0.75, 0.75), "geometry_msgs/msg/PoseWithCovarianceStamped")
    receiver.wait(lambda heard: True)
    fresh.put("pose", odometry_bytes(1.05, 0.75), "nav_msgs/msg/Odometry")
    status = fresh.wait_status(lambda status: (status["pose"] or {}).get("x") == 1.05)
    assert status["errors"]["total"] == 0
    # Without a schema it has to be what the configuration says, a PoseStamped.
    fresh.put("pose", odometry_bytes(1.35, 0.75), "")
    fresh.wait_status(lambda status: status["errors"]["by_code"] == {"malformed_message": 1})
    fresh.put("pose", pose_bytes(1.35, 0.75), "")
    fresh.wait_status(lambda status: status["pose"]["x"] == 1.35)
