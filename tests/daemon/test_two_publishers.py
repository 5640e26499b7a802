"""Two programs that publish the same input: one counts, and that there are two is told."""

from __future__ import annotations

import json
import time
from contextlib import contextmanager

import zenoh

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.security import BusConfig
from fasaco_edge.doctor import session
from fasaco_edge.doctor.finding import CheckContext, Level
from tests.daemon.test_mask_topic import AROUND, BLANK, MASK, driven
from tests.daemon.test_mission import planned
from tests.support.outsider import joined_daemon
from tests.support.rooms import WALL, fill, lanes, map_bytes, pose_bytes, room
from tests.support.waiting import meanwhile, until

PREFIX = "fasaco/@v1/robot/"
ROOM = room(4.0, 3.0)
WALLED = fill(ROOM, 2.0, 0.6, 2.1, 2.4, WALL)
PERIOD_S, TURNS = 0.1, 20


@contextmanager
def program(endpoint, *, stamps=True):
    text = {"mode": "client", "connect": {"endpoints": [endpoint]}}
    text["timestamping"] = {"enabled": stamps}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(text))) as opened:
        yield opened


def in_turn(one, other, name, payloads, turns=TURNS):
    """Publish, the two in turn."""
    for turn in range(turns):
        (one, other)[turn % 2].put(PREFIX + name, payloads[turn % 2])
        time.sleep(PERIOD_S)


def has_two(status):
    return any(each["code"] == "two_publishers" for each in status["troubles"])


def text_of(status):
    return next(each["text"] for each in status["troubles"] if each["code"] == "two_publishers")


def is_warned(examined, of):
    return examined.level is Level.WARN and of in examined.found


def counting(one, other):
    return f"session {one.zid()} counts, session {other.zid()} does not"


def test_two_publishers_of_maps_do_not_alternate_the_path(tmp_path):
    with (
        joined_daemon(tmp_path) as (daemon, outsider),
        program(daemon.endpoint) as one,
        program(daemon.endpoint) as other,
    ):
        paths = outsider.listen("path")
        one.put(PREFIX + "map", map_bytes(ROOM))
        outsider.put("pose", pose_bytes(*lanes(1)[0]))
        paths.wait(lambda heard: len(planned(heard)[0]) > 0)
        maps = map_bytes(ROOM, 2), map_bytes(WALLED, 3)
        in_turn(one, other, "map", maps)
        status = outsider.wait_status(has_two)
        assert status["state"] == "covering"
        assert text_of(status) == f"maps come from two publishers: {counting(one, other)}"
        reasons = [json.loads(heard.attachment)["reason"] for heard in paths.heard]
        assert not [reason for reason in reasons if reason.startswith("map:")]
        bus = BusConfig(listen=(daemon.endpoint,))
        context = CheckContext(DaemonConfig(bus=bus))
        # On a busy machine it may have no answer in time, and two that are silent are none.
        with meanwhile(lambda: in_turn(one, other, "map", maps, 2), PERIOD_S):
            until(lambda: is_warned(session.peers(context), counting(one, other)))
        # The first ends: the other counts from its next map on.
        one.close()
        with meanwhile(lambda: other.put(PREFIX + "map", map_bytes(WALLED, 99)), 1.0):
            outsider.wait_status(lambda status: status["map"]["stamp_ns"] == 99)
    assert "maps come from two publishers" in daemon.log_text()


def test_two_anonymous_publishers_are_found_by_alternating_maps(tmp_path):
    with (
        joined_daemon(tmp_path) as (daemon, outsider),
        program(daemon.endpoint, stamps=False) as one,
        program(daemon.endpoint, stamps=False) as other,
    ):
        paths = outsider.listen("path")
        outsider.put("pose", pose_bytes(*lanes(1)[0]))
        maps = map_bytes(ROOM, 2), map_bytes(WALLED, 3)
        in_turn(one, other, "map", maps)
        status = outsider.wait_status(has_two)
        assert text_of(status) == "maps alternate, as from two publishers"
        time.sleep(1.0)  # for the path of the map that counts
        before = len(paths.heard)
        assert before
        in_turn(one, other, "map", maps)
        assert len(paths.heard) == before


def test_poses_and_masks_of_a_second_publisher_do_not_count(tmp_path):
    with (
        joined_daemon(tmp_path, mission={"keep_out_topic": True}) as (daemon, outsider),
        program(daemon.endpoint) as one,
        program(daemon.endpoint) as other,
    ):
        outsider.put("map", map_bytes(ROOM))
        one.put(PREFIX + "keep_out_mask", map_bytes(MASK))
        one.put(PREFIX + "pose", pose_bytes(*lanes(1)[0]))
        paths = outsider.listen("path")
        paths.wait(lambda heard: len(planned(heard)[0]) > 0)
        in_turn(one, other, "pose", (pose_bytes(*lanes(1)[0]), pose_bytes(3.4, 2.4)))
        in_turn(one, other, "priority", (map_bytes(MASK), map_bytes(BLANK)))
        in_turn(one, other, "keep_out_mask", (map_bytes(MASK), map_bytes(BLANK)))
        status = outsider.wait_status(lambda status: has_two(status) and "masks" in text_of(status))
        assert f"poses come from two publishers: {counting(one, other)}" in text_of(status)
        assert f"priorities come from two publishers: {counting(one, other)}" in text_of(status)
        assert f"keep-out masks come from two publishers: {counting(one, other)}" in text_of(status)
        assert status["pose"]["x"] < 1.0
        assert not any(driven(heard) & AROUND for heard in paths.heard)
