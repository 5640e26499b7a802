"""The recording of a robot that is simulated faster than real time: reports have its seconds."""

from __future__ import annotations

import json

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.recording.read.robot_clock import RobotClock
from fasaco_edge.recording.read.timeline import open_timeline
from fasaco_edge.review.instant import instant_at
from fasaco_edge.review.review import read_review
from fasaco_edge.serve.recorded import Playback
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from tests.support.processes import fasaco_edge
from tests.support.recordings import told_recorder
from tests.support.reviews import document
from tests.support.rooms import map_bytes, room

SCALE, SPEED_M_S = 20.0, 0.25
# The robot drives for 10 s by its own clock, with a pose every half second [s].
DRIVES_S, EVERY_S = 10.0, 0.5
WORDS = "simulated at 20 times real time"
ROBOT = {"tool_width_m": 0.3, "radius_m": 0.18, "speed_m_s": SPEED_M_S, "time_scale": SCALE}


def record(folder):
    with told_recorder(folder, EVERY_S / SCALE) as told:
        told.tell("map", map_bytes(room(4.0, 3.0)))
        status = {"robot": "one", "state": "covering", "config": {"robot": ROBOT}}
        told.tell("status", encode_json(status))
        for at_s in np.arange(0.0, DRIVES_S + 0.1, EVERY_S).tolist():
            pose = Pose2D(0.5 + SPEED_M_S * at_s, 0.5)
            stamped = StampedPose(pose, "map", round(1e9 * at_s))
            told.tell("pose", encode_pose_stamped(stamped))
        told.end()
    return sorted(folder.glob("*.rrd"))


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    return record(tmp_path_factory.mktemp("simulated") / "runs")


def test_times_and_speeds_are_the_robots(parts):
    review = read_review(parts)
    told = document(review)
    assert np.diff(review.data.times) == pytest.approx(EVERY_S)
    assert told["driven_m"] / np.ptp(review.data.times) == pytest.approx(SPEED_M_S, rel=0.01)
    assert instant_at(review, review.data.pose_s[10]).instant.speed_m_s == SPEED_M_S
    assert told["time_scale"] == SCALE
    # Before and after the drive no simulated time passes.
    assert told["duration_s"] > DRIVES_S
    assert told["duration_s"] - told["recorded_s"] == pytest.approx(
        DRIVES_S - np.ptp(review.record.clock.recorder_s), abs=0.2
    )


def test_each_report_says_once_that_it_is_simulated(parts, tmp_path):
    for options in ((), ("--long",), ("--at", 3), ("--point", "1,0.5")):
        ended = fasaco_edge("review", *parts, *options)
        assert ended.code == 0, ended.err
        text = " ".join(ended.out.split())
        assert text.count(WORDS) == 1, text
    both = fasaco_edge("review", *parts, "--against", *parts)
    assert both.out.count(WORDS) == 2
    ended = fasaco_edge("review", *parts, "--at", 3, "--json", "--png", tmp_path / "at.png")
    assert json.loads(ended.out)["time_scale"] == SCALE


def test_the_page_of_it_is_in_the_robots_time(parts):
    with open_timeline(parts) as timeline:
        playback = Playback(timeline, parts)
        ((_, _, text), _) = playback.newest()
        assert json.loads(text)["clock"] == WORDS
        clock = timeline.clock
        assert json.loads(text)["seconds"] == pytest.approx(clock.seconds(timeline.ended_ns))
        half = float(clock.robot_s[0]) + DRIVES_S / 2
        pose = next(m for m in playback.at(half) if '"kind":"pose"' in str(m))
        assert json.loads(pose)["x"] == pytest.approx(0.5 + SPEED_M_S * DRIVES_S / 2, abs=0.13)


def test_a_second_simulation_counts_on_from_the_first():
    at_s, stamps = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), [10.0, 20.0, 0.0, 10.0, 1e9]
    clock = RobotClock.by_stamps(0, 10.0, at_s, np.array(stamps))
    assert clock.robot_s.tolist() == [1.0, 11.0, 12.0, 22.0, 23.0]
    assert [clock.seconds(round(1e9 * at)) for at in (0.5, 1.5, 6.0)] == [0.5, 6.0, 24.0]
    assert [clock.wall_ns(at) for at in (0.5, 6.0, 24.0)] == [500_000_000, 1_500_000_000, 6 * 10**9]
