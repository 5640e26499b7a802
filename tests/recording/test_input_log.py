"""What the mission heard comes back byte for byte: over parts, after gaps, and slowly grows."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.recording.write import input_log, recorder
from fasaco_edge.recording.write.input_log import InputLog
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.recording.write.writer import WriterState
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_document, encode_json
from fasaco_edge.wire.documents.path_documents import DIGEST_BYTES, PATH_DIGEST, digest
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.paths import encode_path
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from tests.support.recordings import TEXT, bus_on_free_port, read_column, read_summary, writer_in
from tests.support.senders import Sender

SECOND_NS = 1_000_000_000
BEGAN_NS = 1_700_000_000 * SECOND_NS


@dataclass
class Desk:
    folder: Path
    part_bytes: int = 10**9
    now_ns: int = 0
    told: list[Arrival] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.writer = writer_in(self.folder, self.part_bytes)
        self.inputs = InputLog(self.writer, BEGAN_NS)

    def hear(self, topic: str, payload: bytes, attachment: bytes = b"", after_s: float = 0.1):
        self.now_ns += round(after_s * SECOND_NS)
        sample = Sample(f"robot/{topic}", payload, "some/msg/Type", attachment)
        arrival = Arrival(topic, sample, self.now_ns, BEGAN_NS + self.now_ns)
        self.writer.message(arrival.wall_ns)
        self.inputs.add(arrival)
        self.inputs.write_if_due(self.now_ns)
        self.writer.sync(self.now_ns)
        self.told.append(arrival)
        return arrival

    def close(self) -> list[Path]:
        self.inputs.finish()
        assert self.writer.close()
        return parts(self.folder)


def parts(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.rrd"), key=lambda path: int(path.stem.rpartition("part")[2]))


def noise(seed: int, size: int = 30_000) -> bytes:
    return np.random.default_rng(seed).bytes(size)


def test_samples_are_read_back_across_parts(tmp_path):
    desk = Desk(tmp_path, part_bytes=200_000)
    for number in range(40):
        desk.hear("map", noise(number), after_s=0.5)
        desk.hear("map_update", noise(1000 + number, number))
        desk.hear("pose", b"pose %3d" % number)
    files = desk.close()
    assert len(files) >= 4
    samples = RecordedSamples(files[::-1])
    assert list(samples) == desk.told
    assert list(samples) == desk.told
    assert samples.missing == 0


def test_each_part_begins_with_the_map_in_force(tmp_path):
    # The layout alone takes more than half of it.
    desk = Desk(tmp_path, part_bytes=250_000)
    whole = desk.hear("map", noise(0))
    update = desk.hear("map_update", noise(1, 500))
    desk.hear("path", b"a path", attachment=b"{}")
    for number in range(60):
        desk.hear("pose", noise(100 + number, 9000), after_s=0.5)
    files = desk.close()
    assert len(files) >= 3
    told = RecordedSamples(files[2:])
    samples = list(told)
    assert samples[:2] == [whole, update]
    assert samples[2].topic == PATH_DIGEST
    assert {sample.topic for sample in samples[3:]} == {"pose"}
    assert samples[3:] == desk.told[-len(samples) + 3 :]
    assert told.missing == 0
    # A part in between is missed.
    begun = list(RecordedSamples(files[:1]))
    told = RecordedSamples([files[0], *files[2:]])
    assert list(told) == [*begun, *samples[3:]]
    assert told.missing == len(desk.told) - len(begun) - len(samples[3:]) > 0


def test_a_map_with_too_many_updates_is_not_repeated(tmp_path, monkeypatch):
    monkeypatch.setattr(input_log, "IN_FORCE_BYTES", 1000)
    desk = Desk(tmp_path, part_bytes=50_000)
    desk.hear("map", noise(0))
    for number in range(3):
        desk.hear("map_update", noise(number, 500))
    for number in range(30):
        desk.hear("pose", noise(100 + number, 9000), after_s=0.5)
    files = desk.close()
    assert {sample.topic for sample in RecordedSamples(files[2:])} == {"pose"}
    assert list(RecordedSamples(files)) == desk.told


def test_unwritten_samples_are_counted_and_the_rest_is_whole(tmp_path):
    desk = Desk(tmp_path)
    before = [desk.hear("map", noise(1)), desk.hear("pose", b"pose 1", after_s=1.0)]
    desk.writer.state = WriterState.STALLED
    lost = [desk.hear("map", noise(2)), desk.hear("pose", b"pose 2")]
    desk.inputs.write()
    desk.writer.state = WriterState.RECORDING
    after = [desk.hear("map", noise(2)[:-1] + b"?"), desk.hear("pose", b"pose 3")]
    desk.inputs.note_lost(Counter(pose=3, status=7))
    last = desk.hear("pose", b"pose 4")
    samples = RecordedSamples(desk.close())
    assert list(samples) == [*before, *after, last]
    assert samples.missing == len(lost) + 3


def test_paths_are_kept_as_digests_and_statuses_on_change(tmp_path):
    desk = Desk(tmp_path)
    xy = np.array([(0.15, 0.15), (0.45, 0.15)])
    desk.hear("path", encode_path(xy, np.zeros(2), "map", 7), attachment=b'{"revision": 1}')
    for state, rss_mb in (("covering", 1), ("covering", 2), ("done", 3), ("done", 4), ("done", 5)):
        desk.hear("status", encode_json({"state": state, "rss_mb": rss_mb, "config": {}}))
    desk.hear("status", b"no JSON")
    desk.hear("coverage", b"a grid")
    path, *statuses = RecordedSamples(desk.close())
    assert path.sample.attachment == b'{"revision": 1}'
    assert path.sample.payload == digest(xy.tobytes())
    assert len(path.sample.payload) == DIGEST_BYTES
    # And the last one, so that counts at the end are those of the end.
    assert [one.sample for one in statuses] == [desk.told[at].sample for at in (1, 3, 5)]


@pytest.mark.parametrize(("time_scale", "kept"), [(1.0, 3), (0.5, 3), (20.0, 20)])
def test_statuses_are_kept_once_in_15_s_of_the_robot(tmp_path, time_scale, kept):
    """At 20 times real time the page of a demo showed figures five minutes old."""
    desk, config = Desk(tmp_path), {"robot": {"time_scale": time_scale}}
    for rss_mb in range(20):
        desk.hear("status", encode_json({"rss_mb": rss_mb, "config": config}), after_s=1.0)
    assert len(list(RecordedSamples(desk.close()))) == kept


def test_changes_of_rooms_are_kept_and_shares_now_and_then(tmp_path):
    desk = Desk(tmp_path)

    def hear(revision: int, swept: float, after_s: float = 1.0) -> None:
        rooms = Rooms("map", revision, (RoomReport(1, swept=swept),))
        desk.hear("rooms", encode_json(rooms), after_s=after_s)

    hear(1, 0.1)
    hear(1, 0.2)
    hear(1, 0.3, after_s=entities.STATUS_PERIOD_S)
    hear(2, 0.4)
    hear(2, 0.5)
    desk.hear("rooms", b"no JSON")
    samples = list(RecordedSamples(desk.close()))
    kept = [decode_document(one.sample.payload, Rooms) for one in samples if one.topic == "rooms"]
    assert [(each.revision, each.rooms[0].swept) for each in kept] == [
        (1, 0.1),
        (1, 0.3),
        (2, 0.4),
        (2, 0.5),
    ]
    assert [one.at_ns for one in samples] == sorted(one.at_ns for one in samples)


def test_inputs_queued_at_the_end_are_kept_and_drawn_if_in_time(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, "LAST_DRAWN_NS", 0)
    with bus_on_free_port() as (bus, _):
        one = recorder.RobotRecorder(DaemonConfig(), bus, DiskBudget(tmp_path, 10**9, 0))
        poses = hear(one, bus, 300)
        assert one.end()
    (path,) = parts(tmp_path)
    samples = RecordedSamples([path])
    assert [each.sample.payload for each in samples if each.topic == "pose"] == poses
    assert samples.missing == 0
    assert entities.ROBOT not in read_summary(path).rows
    said = [line for (line,) in read_column(path, entities.RECORDER_LOG, TEXT).values]
    assert "the last 300 messages are not drawn: there was no time" in said


def test_a_recorder_reports_while_it_catches_up(tmp_path, monkeypatch):
    """Its supervisor takes one that is silent for one that hangs."""
    monkeypatch.setattr(recorder, "REPORT_PERIOD_NS", 0)
    reports = []
    with bus_on_free_port() as (bus, _):
        one = recorder.RobotRecorder(DaemonConfig(), bus, DiskBudget(tmp_path, 10**9, 0))
        hear(one, bus, 50)
        bus.listen(Keys(), topics.RECORDER, lambda sample: reports.append(sample.payload))
        one.step(0.0)
        deadline = time.monotonic() + 60.0
        while len(reports) <= 50 and time.monotonic() < deadline:
            time.sleep(0.01)
        assert one.end()
    assert len(reports) > 50


def hear(one, bus, count):
    one.listen()
    publisher = Sender(bus, topics.POSE)
    poses = [encode_pose_stamped(StampedPose(Pose2D(x, 0.0), "map", x)) for x in range(count)]
    for pose in poses:
        publisher.put(pose)
    while len(one._queue._waiting) < count:
        time.sleep(0.01)
    return poses


def test_a_recording_without_samples_is_named(tmp_path):
    with pytest.raises(UnreadableRecording, match="holds no samples") as raised:
        RecordedSamples(Desk(tmp_path / "silent").close())
    assert "check the robot's name" in raised.value.hint
    (tmp_path / "a.rrd").write_text("hello")
    with pytest.raises(UnreadableRecording, match="no recording"):
        RecordedSamples([tmp_path / "a.rrd"])


def test_a_part_that_had_just_begun_hides_no_samples_of_others(tmp_path):
    (empty,) = Desk(tmp_path / "killed").close()
    desk = Desk(tmp_path / "before")
    desk.hear("map", noise(0))
    assert list(RecordedSamples([*desk.close(), empty])) == desk.told
