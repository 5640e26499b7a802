"""What is made of samples as they come."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.feed import SUBSCRIBED
from fasaco_edge.client.phrases import KEPT, EventLog
from fasaco_edge.client.robot_state import WatchedPath
from fasaco_edge.grid.geometry import Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch
from fasaco_edge.watch.picture import RobotView
from fasaco_edge.wire.messages.maps import encode_map_update
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from tests.watch.grids import NOW, mid_mission, status, tell


def texts(view: RobotView) -> list[str]:
    return [entry.text for entry in view.events.entries]


def at(x: float, y: float) -> bytes:
    return encode_pose_stamped(StampedPose(Pose2D(x, y)))


def test_the_path_ahead_begins_at_the_robot():
    view = mid_mission()
    assert len(view.path_ahead) == 12
    tell(view, "pose", at(2.3, 1.2))
    assert view.path_ahead[0].tolist() == [2.3, 1.2]
    assert view.path_ahead[1].tolist() == [2.75, 1.25]


def test_progress_on_a_long_piece_is_between_its_points():
    """As of a way home, whose end is nearer to the robot than its next corner."""
    walk = WatchedPath([(0.0, 0.0), (0.0, 5.0), (1.0, 5.0), (1.0, 2.0), (0.6, 2.0)])
    walk.note_position(Pose2D(0.05, 1.5))
    assert (walk.at, walk.beyond_m) == (0, 1.5)
    walk.note_position(Pose2D(0.05, 4.0))
    assert (walk.at, walk.beyond_m) == (0, 4.0)
    walk.note_position(Pose2D(1.0, 5.0))
    assert (walk.at, walk.beyond_m) == (2, 0.0)
    # A path that passes a place again is not cut there.
    out = [(float(step), 0.0) for step in range(20)]
    again = WatchedPath(np.array(out + out[::-1]))
    for x, _ in out[:6]:
        again.note_position(Pose2D(x, 0.1))
    assert again.at == 5
    later = WatchedPath(walk.xy)
    later.join(Pose2D(1.0, 3.0))
    assert (later.at, later.beyond_m) == (2, 2.0)


def test_the_daemon_knows_how_much_is_left():
    view = mid_mission()
    view.pose = None
    path = {"revision": 7, "remaining_steps": 2, "steps": 11}
    tell(view, "status", status(path=path))
    assert view.path_ahead.tolist() == [[5.25, 1.25], [5.25, 1.75], [5.25, 2.25]]
    tell(view, "status", status(path=path | {"revision": 8, "remaining_steps": 0}))
    assert len(view.path_ahead) == 3
    # A new daemon has no path yet.
    tell(view, "status", status(path=None))
    assert len(view.path_ahead) == 0
    # The steps of a line are not its points; an unknown member is ignored.
    view = mid_mission()
    view.pose = None
    tell(view, "status", status(path=path | {"steps": 40}, weather={"rain": True}))
    assert len(view.path_ahead) == 12


def test_a_second_daemon_is_noted_and_changes_nothing():
    view = mid_mission()
    before = view.status
    for stand, reason in (("looks", "no map yet"), ("waits", "another daemon plans: 2f")):
        claim = {"id": "1f", "stand": stand}
        tell(view, "status", status(state="blocked", reason=reason, path=None, claim=claim))
    assert view.status is before
    assert len(view.path_ahead) == 12
    assert view.events.entries[-1].text == ("a second daemon is blocked: another daemon plans: 2f")
    tell(view, "status", status(state="paused", claim={"id": "2f", "stand": "plans"}))
    assert view.status.state == "paused"


# When floor came into reach in a mission of 19 minutes in an unknown flat, at its first, and at the
# beginning and end of each quiet time above 45 s.
GREW_S = (1, 9, 72, 86, 160, 195, 247, 261, 408, 427, 469, 691, 797, 811, 862, 888, 972, 1009)


@pytest.mark.parametrize("scale", [1.0, 20.0])
def test_a_map_grows_until_it_has_been_complete_for_a_while(scale):
    """The end of the work is "not before" a time all the while, and does not become "done at"."""
    view, cells, said = RobotView("robot"), 400, []
    config = {"robot": {"time_scale": scale}}
    for second in range(2000):
        cells += second in GREW_S
        now = NOW + second / scale
        payload = status(config=config, coverage={"coverable": cells, "covered": 10})
        view.take("status", Sample("status", payload), now)
        said.append(view.grows(now))
    assert [second for second in range(1, 2000) if said[second] != said[second - 1]] == [1, 1514]
    # Another order has other floor to sweep: nothing has grown.
    zones = {"ordered": "command", "zones": [{"name": "hall"}]}
    more = status(config=config, coverage={"coverable": 900, "covered": 0}, mission=zones)
    view.take("status", Sample("status", more), now + 1.0)
    assert not view.grows(now + 1.0)


def test_updates_are_laid_over_the_map():
    view = mid_mission()
    patch = MapPatch(Window(10, 20, 12, 22), np.full((2, 2), 100, np.int8))
    tell(view, "map_update", encode_map_update(patch))
    assert view.map is not None
    assert (view.map.cells == 100).sum() == 2 * 60 + 2 * 38 + 4
    tell(RobotView("robot"), "map_update", encode_map_update(patch))


def test_without_poses_the_pose_of_the_status_is_used():
    view = RobotView("robot")
    tell(view, "status", status(pose={"x": 1.0, "y": 2.0, "yaw": 0.5}))
    assert view.pose == Pose2D(1.0, 2.0, 0.5)
    tell(view, "pose", at(3.0, 3.0))
    tell(view, "status", status(pose={"x": 1.0, "y": 2.0}))
    assert view.pose == Pose2D(3.0, 3.0)
    tell(view, "status", status(pose={"x": 1e15, "y": 2.0}))
    assert view.pose == Pose2D(3.0, 3.0)


@pytest.mark.parametrize(
    ("topic", "payload"),
    [
        ("map", b"no map"),
        ("map_update", b""),
        ("pose", b"\x00\x01"),
        ("path", b"no path"),
        ("coverage", b"\xff" * 99),
        ("status", b"[]"),
        ("status", b"{}"),
        ("status", json.dumps({"state": 5}).encode()),
        ("status", json.dumps({"state": "done", "coverage": {"covered": "all"}}).encode()),
        ("command", b"\xff"),
    ],
)
def test_an_unreadable_sample_changes_nothing_else(topic, payload):
    view = mid_mission()
    before = view.map, view.coverage, view.pose, view.status
    for _ in range(9):
        tell(view, topic, payload)
    assert (view.map, view.coverage, view.pose, view.status) == before
    assert [text for text in texts(view) if "cannot be read" in text][-1].startswith(
        f"{topic} cannot be read (8 so far): "
    )
    tell(view, "status", status(state="done"))
    assert view.status is not None
    assert view.status.state == "done"


@pytest.mark.parametrize("topic", SUBSCRIBED, ids=lambda topic: topic.name)
def test_every_topic_subscribed_is_read(topic):
    view = RobotView("robot")
    view.take(topic.name, Sample("key", b"broken"), NOW)  # a KeyError where nothing reads it


def test_each_event_is_reported_once():
    view = mid_mission()
    tell(view, "status", status())
    assert texts(view) == [
        "the daemon is there",
        "covering: path 7",
        "path 7, 11 steps: map: 2 cells more",
    ]
    errors = {"total": 3, "last": "no map", "by_code": {"malformed_message": 3}}
    for _ in range(2):
        blocked = status(state="blocked", reason="in an occupied cell", errors=errors)
        tell(view, "status", blocked)
    order = {"zones": [{"name": "kitchen"}, {"name": "hall"}]}
    tell(view, "command", json.dumps({"command": "start", "order": order}).encode())
    recorder = {"state": "disk full", "reason": "no room"}
    tell(view, "status", status(errors=errors, recorder=recorder, ledger={"fault": "torn"}))
    assert texts(view)[3:] == [
        "blocked: in an occupied cell",
        "refused: 3 x malformed_message, no map",
        "command start with kitchen, hall",
        "covering: path 7",
        "ledger: torn",
        "recorder disk full: no room",
    ]


def test_a_journal_keeps_the_newest():
    events = EventLog()
    for number in range(KEPT + 5):
        events.add(NOW, str(number))
    assert events.entries[0].text == "5"
    assert [entry.text for entry in events.since(KEPT + 3)] == [str(KEPT + 3), str(KEPT + 4)]
    assert len(events.since(0)) == KEPT
    assert events.since(events.count) == []


def test_a_trouble_of_a_robot_at_rest_begins_and_ends():
    view = RobotView("robot")
    dead = {"code": "no_current", "text": "the dock gives no current", "since_s": 3.0}
    resting = {"state": "charging", "reason": "battery at 15 %"}
    for troubles in ([], [dead], [dead | {"since_s": 4.0}], []):
        tell(view, "status", status(**resting, troubles=troubles))
    assert texts(view).count("trouble: the dock gives no current") == 1
    assert texts(view)[-1] == "trouble is over: the dock gives no current"
    # A degraded mission has its trouble as its reason.
    lost = {"code": "no_pose", "text": "no pose for 3 s"}
    tell(view, "status", status(state="degraded", reason=lost["text"], troubles=[lost]))
    assert [text for text in texts(view) if "no pose" in text] == ["degraded: no pose for 3 s"]
