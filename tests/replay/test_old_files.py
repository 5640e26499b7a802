"""Files that an earlier release wrote are still read, and mean the same."""

from __future__ import annotations

import hashlib
import json
import lzma
import math
import shutil
import signal
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
import yaml

from fasaco_edge.cli import main
from fasaco_edge.config.loading import load_config
from fasaco_edge.config.reading import renamed
from fasaco_edge.daemon.ledger.file import LedgerFile
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.wire.documents.path_documents import digest

pytest.importorskip("rerun")

from fasaco_edge.daemon.loop.answers import config_document
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.recording.read.timeline import open_timeline
from fasaco_edge.replay.replay import RecordedRun, Replay, read_run
from tests.support.recordings import bus_on_free_port, recorder_process
from tests.support.scripted_mission import CONFIG, Mission

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "mission.rrd"
    path.write_bytes(lzma.decompress((DATA / "mission.rrd.xz").read_bytes()))
    return str(path)


def printed(capsys, *words, code=0):
    assert main([*words, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def digest_of(digests):
    """Return how many paths there are, and the SHA-256 of all their cells."""
    return len(digests), hashlib.sha256("".join(digests).encode()).hexdigest()[:16]


def test_a_recording_of_another_search_replays_its_equal_part(recording, capsys):
    """The search has changed since: what differs first is named, and by which code it was made."""
    summary = printed(capsys, "replay", recording, code=1)["summary"]
    assert (summary["equal"], summary["turns"], summary["turns_equal"]) == (False, 559, 69)
    assert summary["difference"]["what"] == "plan 1"
    assert summary["kernels"]["recorded"] == "kernels-339d81898e70"
    assert summary["kernels"]["replayed"] != summary["kernels"]["recorded"]
    assert main(["replay", recording]) == 1
    assert "other kernels may plan other paths" in capsys.readouterr().out
    # The first path is the same all the same.
    assert (summary["paths"], summary["paths_as_recorded"]) == (1, 1)


def test_samples_lead_to_the_same_paths(recording):
    """By the times of the samples alone, and with the same work for each plan."""
    samples = RecordedSamples([Path(recording)])
    config = read_run(samples).daemon_config()
    # What there was no setting for is as it was.
    assert (config.planner.line, config.planner.align) == ("cells", "axes")
    replay = Replay(config, work=100)
    paths = [step.decision.path for step in replay.steps(samples) if step.decision.path is not None]
    digests = [digest(path.cells.astype("<i4").tobytes()).hex() for path in paths]
    assert digest_of(digests) == (31, "3ddc418cb75f7d5c")
    assert replay.mission.coverage().covered == 51


def test_a_recording_is_reviewed(recording, capsys):
    review = printed(capsys, "review", recording)
    figures = ("covered_cells", "paths", "replans")
    assert [review[name] for name in figures] == [63, 30, 27]
    assert review["driven_m"] == pytest.approx(15.23)
    assert (review["state"], review["complete"]) == ("done", True)


def test_moments_and_spots_of_a_recording_are_reviewed(recording, capsys):
    at = printed(capsys, "review", recording, "--at", "0:05")["at"]
    assert (at["state"], at["path"]["revision"]) == ("covering", 25)
    assert (at["x"], at["y"]) == pytest.approx((3.15, 1.64), abs=0.01)
    (spot,) = printed(capsys, "review", recording, "--point", "1,1")["points"]
    assert (spot["swept"], spot["why"]) == (None, "not known")


def test_a_recording_is_shown_in_the_page(recording):
    """Its poses are drawn as a turn about an axis, later ones as a quaternion."""
    with open_timeline([Path(recording)]) as timeline:
        assert len(timeline.poses) == len(timeline.pose_ns) > 100
        at_ns = timeline.began_ns + 5_000_000_000
        x, y, yaw = timeline.poses_between(0, at_ns)[-1]
        assert (x, y, yaw) == pytest.approx((3.15, 1.64, -math.pi / 2), abs=0.01)
        grid = timeline.grid(timeline.newest(entities.MAP, at_ns))
        assert grid.geometry.resolution == pytest.approx(0.05)
        assert len(timeline.line(timeline.newest(entities.PATH, at_ns)).xy) > 2


@pytest.fixture(scope="module")
def of_own_planner(tmp_path_factory):
    """Return a recording of a daemon that planned with a planner of its user's."""
    config = config_document(CONFIG)
    config["planner"] = {**config["planner"], "own": "lab.mine:Deep"}
    out = tmp_path_factory.mktemp("own")
    with bus_on_free_port() as (bus, endpoint), recorder_process(bus, endpoint, out) as recorder:
        mission = Mission(bus)
        mission.publish_status("waiting for map", 0.0, planning=False, config=config)
        for _ in mission.frames(20):
            time.sleep(0.04)
        mission.publish_status("covering", 1.0, planning=False, config=config)
        report = recorder.written(mission.sent)
        recorder.process.send_signal(signal.SIGTERM)
        assert recorder.process.wait(60) == 0
    return report["file"]


def test_a_recording_of_a_users_planner_replays_with_another(of_own_planner, capsys):
    told = printed(capsys, "replay", of_own_planner)
    assert told["summary"]["own_planner_missing"] == "lab.mine:Deep"
    assert told["summary"]["equal"] is None
    assert told["summary"]["paths"] >= 1
    assert main(["replay", of_own_planner]) == 0
    assert "'lab.mine:Deep': its plans cannot be repeated" in capsys.readouterr().out
    assert printed(capsys, "review", of_own_planner)["config"]["planner.own"] == "lab.mine:Deep"


def test_a_recording_without_such_a_planner_is_none_of_one(recording, capsys):
    """Every recording of the releases that had the key has it, mostly empty."""
    empty = RecordedRun({"planner": {"name": "zigzag", "own": ""}})
    assert empty.daemon_config().planner.name == "zigzag"
    assert empty.own_planner == ""
    assert printed(capsys, "replay", recording, code=1)["summary"]["own_planner_missing"] == ""


def test_a_ledger_is_restored(tmp_path):
    shutil.copy(DATA / "robot.ledger", tmp_path)
    found = LedgerFile(tmp_path, "robot").load(cell_m=0.3)
    assert found.fault is None
    assert (found.ledger.frame, found.ledger.total) == ("map", 15)
    visits = found.ledger.tiles[0, 0]
    assert np.count_nonzero(visits) == 15
    order = json.loads(found.ledger.note)
    assert (order["stage"], order["paused"], order["home"]) == ("covering", False, [2, 2])


@pytest.mark.parametrize(
    ("name", "flag", "now"),
    [
        ("fasaco", True, "colony-search"),
        ("fasaco", False, "fasaco"),
        ("fasaco", None, "fasaco"),
        ("zigzag", True, "zigzag"),
    ],
)
def test_a_recorded_planner_has_its_present_name(name, flag, now):
    planner = {"name": name, "seed": 3} | ({} if flag is None else {"local_search": flag})
    config = {"robot": {"name": "r1"}, "planner": planner}
    assert renamed(config) == {"robot": {"name": "r1"}, "planner": {"name": now, "seed": 3}}
    assert RecordedRun(config).daemon_config().planner.name == now


def test_a_recording_names_the_planner_of_its_mission(recording, capsys):
    samples = RecordedSamples([Path(recording)])
    run = read_run(samples)
    assert (run.config["planner"]["name"], run.config["planner"]["local_search"]) == (
        "fasaco",
        True,
    )
    assert run.daemon_config().planner.name == "colony-search"
    config = printed(capsys, "review", recording)["config"]
    assert config["planner.name"] == "colony-search"
    assert "planner.local_search" not in config


def test_a_configuration_is_read_but_for_a_removed_key(tmp_path):
    old, path = DATA / "config.yaml", tmp_path / "config.yaml"
    with pytest.raises(BadConfiguration, match=r"line 23: planner\.local_search was removed"):
        load_config(old)
    text = old.read_text(encoding="utf-8")
    path.write_text(text.replace("name: fasaco, local_search: true", "name: colony-search"))
    written = yaml.safe_load(path.read_text(encoding="utf-8"))
    read = msgspec.json.decode(msgspec.json.encode(load_config(path)))
    assert missing_in(read, written) == []


def missing_in(read, written):
    """Return the keys whose value is another one, or that are no longer there."""
    if not isinstance(written, dict):
        return [] if read == written else [f"{read!r} in place of {written!r}"]
    return [
        f"{key}: {fault}"
        for key, value in written.items()
        for fault in missing_in(read.get(key), value)
    ]
