"""Missions once more, turn by turn as the daemon took them: the same bit for bit, or told where."""

from __future__ import annotations

import json
import zlib
from zlib import crc32

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.cli import main
from fasaco_edge.daemon.ledger.rooms_file import RoomsFile, encode_rooms
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rooms import FoundRooms
from fasaco_edge.mission.events import PriorityReceived
from fasaco_edge.mission.rooms.room_book import RoomBook
from fasaco_edge.mission.rooms.room_matching import HOLD_NEW
from fasaco_edge.mission.rooms.room_watch import update
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.replay.cycle_replay import CycleReplay, inflated_sample, read_turns
from fasaco_edge.replay.replay import read_run
from fasaco_edge.review.conversion import document_of
from fasaco_edge.review.review import read_review
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.turns import EarlySample, decode_turns
from fasaco_edge.wire.limits import MAX_MESSAGE_BYTES
from fasaco_edge.wire.reasons import WORDS
from tests.replay.scenarios import changed, places, without
from tests.support.recorded_mission import record_mission
from tests.wire.schemas import check

TURNS = "turns"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("recording")


@pytest.fixture(scope="module")
def half(folder):
    """A mission that was ended half-way."""
    return record_mission(folder, "half", lambda s: (s["coverage"] or {}).get("covered", 0) > 6)


@pytest.fixture(scope="module")
def recording(folder, half):
    """The mission after it, in the same room and with the same ledger; some floor matters more."""
    dirt = np.full((9, 12), 80, np.int8)
    priorities = OccupancyGrid(GridGeometry(*dirt.shape, 0.3, Pose2D(0.0, 0.0)), dirt)
    return record_mission(folder, "whole", priorities=priorities)


@pytest.fixture(scope="module")
def samples(recording):
    return list(RecordedSamples(recording.paths))


def played(samples):
    record = read_turns(samples)
    assert record is not None
    replay = CycleReplay(read_run(samples).daemon_config(), record)
    steps = [step for step in replay.steps(samples) if step.is_news]
    return replay, record, steps


def first_uses(samples, topic):
    """Return the first turn that took each sample by its checksum; others are in the log."""
    return {
        taken.checksum: turn.number
        for place in reversed(places(samples, TURNS))
        for turn in reversed(_turns(samples[place]))
        for taken in turn.samples
        if taken.topic == topic and taken.told is None
    }


@pytest.mark.parametrize("which", ["half", "recording"])
def test_each_decision_equals_the_recorded_one(which, request):
    recording = request.getfixturevalue(which)
    samples = list(RecordedSamples(recording.paths))
    replay, record, steps = played(samples)
    assert record.gap == ""
    assert replay.difference is None
    for _, status in recording.statuses:
        check("status.json", status)
    # A busy daemon takes several poses in a turn.
    assert replay.turns == record.turns > 20
    paths = [step.as_recorded for step in steps if step.decision.path is not None]
    assert all(paths)
    recorded = read_run(samples).paths.values()
    # A mission that drives when its daemon ends has its path withdrawn after the last step.
    assert len(paths) == len([reason for reason in recorded if reason != "the daemon ends"])
    assert len(paths) == recording.status["path"]["revision"]
    assert replay.plans > 1
    assert replay.mission.state == recording.status["state"]
    assert bool(record.beginning.ledger) == (which == "recording")
    told = [
        event for event in replay.mission.newest_inputs() if isinstance(event, PriorityReceived)
    ]
    assert len(told) == (which == "recording")
    assert replay.mission.coverage().covered == recording.status["coverage"]["covered"]


def test_askew_walls_and_reported_obstacles_are_in_the_replay(tmp_path):
    """The angle follows from the maps and poses that a recording has."""
    recording = record_mission(tmp_path, line="thorough", yaw_deg=25.0, blocked_s=(6.0, 12.0))
    assert recording.status["map"]["lattice_deg"] == pytest.approx(25.0, abs=1.0)
    samples = list(RecordedSamples(recording.paths))
    assert sum(sample.topic == "blocked" for sample in samples) == 2
    # Not the reason: on a busy machine a late pose may be the first of the troubles.
    said = [one["text"] for _, status in recording.statuses for one in status["troubles"]]
    assert any("the robot stands: obstacle ahead" in text for text in said)
    replay, record, steps = played(samples)
    assert (record.gap, replay.difference) == ("", None)
    assert replay.mission.rotation.deg == pytest.approx(
        recording.status["map"]["lattice_deg"], abs=1e-3
    )
    assert all(step.as_recorded for step in steps if step.decision.path is not None)
    assert replay.mission.coverage().covered == recording.status["coverage"]["covered"]


KEEP_OUT = {"name": "crate", "polygon": [[2.4, 0.6], [2.9, 0.6], [2.9, 1.1], [2.4, 1.1]]}


def test_keep_outs_rooms_and_refusals_are_repeated(tmp_path):
    # A room of an earlier run: the whole floor.
    labels, book = np.ones((54, 72), np.int32), RoomBook()
    for _ in range(HOLD_NEW):
        update(book, FoundRooms(GridGeometry(54, 72, 0.05, Pose2D(0.0, 0.0)), labels, 1), "map")
    RoomsFile(tmp_path / "state", "robot").write(encode_rooms(book))
    hall = {"zones": [{"name": "hall"}], "return_home": True}
    commands = (
        (7.0, {"command": "room_name", "room": {"id": 1, "name": "hall"}}, ""),
        (7.5, {"command": "room_name", "room": {"id": 7, "name": "bath"}}, "bad_order"),
        (8.0, {"command": "keep_out_add", "keep_out": KEEP_OUT}, ""),
        (12.0, {"command": "start", "order": {"passes": 2}}, "would_forget"),
        (14.0, {"command": "reset"}, "would_forget"),
        (16.0, {"command": "keep_out_remove", "keep_out": {"name": "lamp"}}, "bad_order"),
        (18.0, {"command": "keep_out_remove", "keep_out": {"name": "crate"}}, ""),
        (22.0, {"command": "start", "order": hall, "discard": True}, ""),
    )
    recording = record_mission(tmp_path, commands=commands)
    samples = list(RecordedSamples(recording.paths))
    record = read_turns(samples)
    replay = CycleReplay(read_run(samples).daemon_config(), record)
    steps = list(replay.steps(samples))
    assert (record.gap, replay.difference) == ("", None)
    assert all(step.as_recorded for step in steps if step.decision.path is not None)
    answers = [answer for step in steps for answer in step.decision.answers]
    codes = [answer.error.code if answer.error else "" for answer in answers]
    assert [code for code in codes if code] == [
        *("bad_order", "would_forget", "would_forget", "bad_order")
    ]
    assert replay.mission.order_state.order.zones[0].room == 1
    assert replay.mission.coverage().covered == recording.status["coverage"]["covered"]


def test_the_turn_log_on_the_bus_matches_its_schema(samples):
    for place in places(samples, TURNS):
        check("turns.json", json.loads(samples[place].sample.payload))


@pytest.mark.parametrize("alter", ["a pixel", "missing"])
def test_a_sample_that_is_not_the_one_taken_ends_it(samples, alter):
    turns, updates = first_uses(samples, "map_update"), places(samples, "map_update")
    payloads = {samples[place].sample.payload for place in updates}
    payload = max((each for each in payloads if crc32(each) in turns), key=len)
    turn = turns[crc32(payload)]
    # Told twice, it would be found the second time.
    alike = [place for place in updates if samples[place].sample.payload == payload]
    for other in alike:
        end = bytes([payload[-1] ^ 0x64])
        samples = changed(samples, other, lambda payload, end=end: payload[:-1] + end)
    if alter == "missing":
        samples = without(samples, alike)
    replay, _, _ = played(samples)
    assert (replay.difference.turn, replay.difference.replayed) == (turn, "not in the recording")
    assert replay.turns == turn - 1


def test_a_decision_that_is_another_is_found_at_its_turn(samples):
    """The log itself says that another path was published."""
    place = next(
        place
        for place in reversed(places(samples, TURNS))
        if any(turn.decided and turn.decided.path for turn in _turns(samples[place]))
    )
    turn = next(turn for turn in _turns(samples[place]) if turn.decided and turn.decided.path)

    def lie(payload):
        batch = decode_turns(payload)
        plain = json.loads(encode_json(batch))
        told = next(t for t in plain["turns"] if t["number"] == turn.number)
        told["decided"]["path"][2] ^= 1
        return json.dumps(plain).encode()

    replay, _, _ = played(changed(samples, place, lie))
    assert (replay.difference.turn, replay.difference.what) == (turn.number, "path")
    assert replay.turns == turn.number - 1


def test_a_reworded_reason_is_no_difference(samples):
    """Each release may word reasons anew; what they are the reasons of counts."""

    def reworded(payload):
        plain = json.loads(payload)
        for turn in plain["turns"]:
            if (decided := turn.get("decided")) is not None:
                decided["reason"] = "other words"
                for name in ("asked", "path"):
                    if decided.get(name):
                        decided[name][1] = "other words"
        return json.dumps(plain).encode()

    for place in places(samples, TURNS):
        samples = changed(samples, place, reworded)
    replay, record, steps = played(samples)
    assert replay.difference is None
    assert replay.turns == record.turns
    assert all(step.as_recorded for step in steps if step.decision.path is not None)


def test_a_gap_in_the_log_ends_the_comparison(samples):
    logs = places(samples, TURNS)
    replay, record, _ = played(without(samples, [logs[len(logs) // 2]]))
    assert "not in the recording" in record.gap
    assert replay.difference is None
    assert replay.turns == record.turns > 0
    _, record, _ = played(changed(samples, logs[2], lambda payload: payload[:-9]))
    assert record.gap.startswith("turn log")
    # Without its beginning there is no log.
    assert read_turns(without(samples, logs[:1])) is None


def test_the_command_says_that_it_is_equal(recording, capsys):
    words = ["replay", *map(str, recording.paths)]
    assert main(words) == 0
    table = capsys.readouterr().out
    assert "equal bit for bit" in table
    # In the words of the review.
    assert not any(reason in table for reason in WORDS)
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    summary = told["summary"]
    assert summary["equal"] is True
    # Its times are those of the review.
    at_s = {one["path"]["revision"]: one["at_s"] for one in told["decisions"] if "path" in one}
    replans = document_of(read_review(recording.paths)).replan_list
    assert len(replans) > 2
    assert [at_s[one["revision"]] for one in replans] == [one["at_s"] for one in replans]
    assert summary["turns_equal"] == summary["turns"]
    assert summary["paths_as_recorded"] == summary["paths_recorded"] == summary["paths"]
    assert main([*words, "--work", "0", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["summary"]["equal"] is None


def _turns(arrival):
    return decode_turns(arrival.sample.payload).turns


def test_an_embedded_sample_is_inflated_whole_or_refused():
    """A megabyte of a recording may claim to be a gigabyte, and half of a sample is none."""
    assert inflated_sample(EarlySample("key", None, zlib.compress(b"pose"))).payload == b"pose"
    longer = zlib.compress(bytes(MAX_MESSAGE_BYTES + 1))
    for deflated in (longer, zlib.compress(bytes(1000))[:-1]):
        with pytest.raises(MalformedMessage, match=f"torn, or more than {MAX_MESSAGE_BYTES} bytes"):
            inflated_sample(EarlySample("key", None, deflated))
