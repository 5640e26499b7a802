"""Parts: they rotate, make room, wait for a stalled disk, and each can be read alone."""

from __future__ import annotations

import os
import shutil
import threading
import time

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.blueprint import build_blueprint
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.quota import DiskBudget, delete_oldest
from fasaco_edge.recording.write.writer import (
    FLUSH_PERIOD_NS,
    RETRY_PERIOD_NS,
    RecordingWriter,
    WriterState,
)
from tests.support.recordings import read_column, read_static, read_summary, writer_in


class Clock:
    def __init__(self) -> None:
        self.now_ns = 10**18

    def tick(self) -> int:
        self.now_ns += FLUSH_PERIOD_NS
        return self.now_ns


def noise(seed: int, size: int = 100_000) -> rr.GridMap:
    pixels = np.random.default_rng(seed).integers(0, 255, size, np.uint8)
    return rr.GridMap(
        data=pixels.tobytes(),
        format=rr.components.ImageFormat(
            width=100, height=size // 100, color_model="L", channel_datatype="U8"
        ),
        cell_size=0.1,
    )


def test_parts_rotate_and_each_begins_with_what_is_in_force(tmp_path):
    clock = Clock()
    writer = writer_in(tmp_path, part_bytes=250_000)
    writer.describe("a run")
    writer.log_static(entities.RUN_CARD, rr.TextDocument("card"))
    writer.message(clock.now_ns)
    writer.log(entities.PATH, rr.LineStrips3D([[[0, 0, 0], [1, 2, 0]]]), latched=True)
    for seed in range(7):
        writer.message(clock.now_ns)
        writer.log("noise", noise(seed))
        writer.sync(clock.tick())
    assert writer.close()
    parts = sorted(tmp_path.glob("*.rrd"))
    assert len(parts) == 4
    for part in parts:
        summary = read_summary(part)
        assert summary.complete
        assert summary.rows[entities.PATH] == 1
        assert read_static(part, entities.RUN_CARD, "TextDocument:text") == [["card"]]
    assert sum(read_summary(part).rows.get("noise", 0) for part in parts) == 7
    assert writer.lost == 0


def test_parts_leave_no_threads_behind(tmp_path):
    clock, threads = Clock(), []
    writer = writer_in(tmp_path, part_bytes=1)
    for _ in range(6):
        writer.message(clock.now_ns)
        writer.log("metrics/a", rr.Scalars(1.0))
        writer.sync(clock.tick())
        writer.show(build_blueprint(None))
        time.sleep(0.1)  # they end a moment after they were told to
        threads.append(len(os.listdir("/proc/self/task")))
    assert writer.part_number == 7
    assert threads[-1] <= threads[1]
    assert writer.close()


def test_an_old_part_gives_way_and_the_oldest_go_by_the_quota(tmp_path):
    others = [tmp_path / "20200101T000000Z-other-part1.rrd", tmp_path / "notes.rrd"]
    before = [tmp_path / f"20200101T000000Z-robot-part{number}.rrd" for number in (2, 10)]
    for path in (*others, *before):
        path.write_bytes(bytes(400_000))
    clock = Clock()
    room = DiskBudget(tmp_path, 300_000, 0, 3 * FLUSH_PERIOD_NS / 1e9, "robot", 1_000_000)
    name = "20260101T000000Z-robot"
    writer = RecordingWriter(name, room, build_blueprint(None))
    writer.sync(clock.tick())
    # With the part that is coming, one of the two that there were is too much.
    assert not before[0].exists()
    assert before[1].exists()
    for seed in range(20):
        writer.log("noise", noise(seed, 20_000))
        writer.sync(clock.tick())
    last = writer.path
    assert writer.close()
    assert all(path.exists() for path in others)
    assert not before[1].exists()
    parts = list(tmp_path.glob(f"{name}-part*.rrd"))
    assert last in parts
    assert 2 <= len(parts) < 7
    assert sum(part.stat().st_size for part in parts) < 1_000_000
    assert all(read_summary(part).complete for part in parts)


def test_a_part_that_is_written_is_not_deleted_for_the_quota(tmp_path):
    room = DiskBudget(tmp_path, 10**6, 0)
    writer = RecordingWriter("20200101T000000Z-robot", room, build_blueprint(None))
    assert not delete_oldest(tmp_path, "robot", 1)
    assert writer.close()
    assert delete_oldest(tmp_path, "robot", 1)


def test_no_part_is_written_below_the_floor_and_its_samples_keep_their_times(tmp_path, monkeypatch):
    clock = Clock()
    # One more than there is: no room, though the disk is far from full.
    writer = writer_in(tmp_path, least_free_bytes=shutil.disk_usage(tmp_path).total)
    writer.message(clock.now_ns)
    writer.sync(clock.tick())
    assert writer.state is WriterState.DISK_FULL
    assert writer.path is None
    writer.message(clock.now_ns)
    assert writer.lost == 1
    (part,) = tmp_path.glob("*.rrd")
    assert read_summary(part).complete
    came_ns = clock.now_ns
    writer.at(came_ns)
    writer.log(entities.MISSION_STATE, rr.StateChange(state="blocked"), latched=True)
    writer.at(came_ns + 10**10)
    monkeypatch.setattr(DiskBudget, "may_begin", lambda *_: True)
    writer.sync(clock.tick() + RETRY_PERIOD_NS)
    assert writer.close()
    column = read_column(tmp_path / "run-part2.rrd", entities.MISSION_STATE, "StateChange:state")
    assert column.wall_ns.tolist() == [came_ns]


@pytest.mark.parametrize("least_free_bytes", [0, 1000])
def test_a_deleted_part_is_reported_and_followed_by_another(tmp_path, caplog, least_free_bytes):
    clock, folder = Clock(), tmp_path / "runs"
    writer = writer_in(folder, least_free_bytes=least_free_bytes)

    def write_and(delete, path):
        writer.message(clock.now_ns)
        writer.log("noise", noise(1), latched=True)
        delete(path)
        writer.sync(clock.tick())

    write_and(os.unlink, writer.path)
    assert (writer.part_number, writer.lost, writer.state) == (2, 1, WriterState.RECORDING)
    assert "part1.rrd was deleted while it was written, with 1 samples" in caplog.text
    write_and(shutil.rmtree, folder)
    assert (writer.lost, writer.state) == (2, WriterState.DISK_FULL)
    assert "runs" in writer.reason
    folder.mkdir()
    writer.sync(clock.tick() + RETRY_PERIOD_NS)
    assert writer.state is WriterState.RECORDING
    assert writer.close()
    (part,) = folder.glob("*.rrd")
    assert read_summary(part).rows["noise"] == 1


def test_a_stalled_disk_is_reported_and_used_again(tmp_path):
    # A pipe that nobody empties: to rerun's writer, a disk that hangs.
    pipe = tmp_path / "run-part1.rrd"
    os.mkfifo(pipe)
    clock = Clock()
    writer = writer_in(tmp_path)
    writer.message(clock.now_ns)
    writer.log(entities.PATH, rr.LineStrips3D([[[0, 0, 0], [1, 2, 0]]]), latched=True)
    writer.log("noise", noise(1, 400_000))
    writer.sync(clock.tick())
    assert writer.state is WriterState.STALLED
    writer.message(clock.now_ns)
    assert writer.lost == 1
    assert not writer.close()
    drained = threading.Thread(target=drain, args=(pipe, tmp_path / "copy.rrd"))
    drained.start()
    deadline = time.monotonic() + 60
    while writer.state is WriterState.STALLED and time.monotonic() < deadline:
        writer.sync(clock.tick())
    assert writer.state is WriterState.RECORDING
    assert writer.close()
    drained.join()
    # What is in force was logged again after the gap.
    values = read_column(tmp_path / "copy.rrd", entities.PATH, "LineStrips3D:strips").values
    assert len(values) == 2


def test_a_disk_that_pauses_loses_nothing(tmp_path):
    """As a memory card does for a second, or a flush on a slow computer."""
    pipe = tmp_path / "run-part1.rrd"
    os.mkfifo(pipe)
    clock = Clock()
    writer = writer_in(tmp_path)
    drained = threading.Timer(1.5, drain, args=(pipe, tmp_path / "copy.rrd"))
    drained.start()
    writer.message(clock.now_ns)
    writer.log("noise", noise(1, 400_000))
    writer.sync(clock.tick())
    assert (writer.state, writer.lost) == (WriterState.RECORDING, 0)
    assert writer.close()
    drained.join()


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(BadConfiguration, match="cannot record into"):
        writer_in(tmp_path / "file" / "runs")


def drain(pipe, copy) -> None:
    with pipe.open("rb") as source, copy.open("wb") as target:
        shutil.copyfileobj(source, target)
