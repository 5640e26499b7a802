"""Files that an earlier release wrote are still read, and mean the same."""

from __future__ import annotations

import hashlib
import json
import lzma
import math
import shutil
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
from fasaco_edge.mission.work.order_state import OrderState, Stage
from fasaco_edge.wire.documents.path_documents import digest

pytest.importorskip("rerun")

from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.recording.read.timeline import open_timeline
from fasaco_edge.replay.replay import RecordedRun, Replay, read_run

SQUARE = {"polygon": [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]]}
RUG = [[1.0, 1.0], [1.5, 1.0], [1.5, 1.5]]
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
    assert config.mission.by_room == "never"
    replay = Replay(config, work=100)
    paths = [step.decision.path for step in replay.steps(samples) if step.decision.path is not None]
    digests = [digest(path.cells.astype("<i4").tobytes()).hex() for path in paths]
    assert digest_of(digests) == (30, "bff617b291125b5d")
    assert replay.mission.coverage().covered == 51


def test_a_recording_is_reviewed(recording, capsys):
    review = printed(capsys, "review", recording)
    figures = ("covered_cells", "paths", "replans")
    assert [review[name] for name in figures] == [63, 30, 27]
    assert review["driven_m"] == pytest.approx(15.23)
    assert (review["state"], review["complete"]) == ("done", True)
    assert review["config"]["planner.name"] == "colony-search"
    assert "planner.local_search" not in review["config"]


def test_moments_and_spots_of_a_recording_are_reviewed(recording, capsys):
    at = printed(capsys, "review", recording, "--at", "0:05")["at"]
    assert (at["state"], at["path"]["revision"]) == ("covering", 25)
    assert at["plan"]["planner"] == "colony-search"
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


def test_a_recording_with_a_users_planner_is_of_the_named_one():
    """Every recording of the releases that had the key has it, mostly empty."""
    for own in ("", "lab.mine:Deep"):
        run = RecordedRun({"planner": {"name": "zigzag", "own": own}})
        assert run.daemon_config().planner.name == "zigzag"


def test_a_ledger_is_restored(tmp_path):
    shutil.copy(DATA / "robot.ledger", tmp_path)
    found = LedgerFile(tmp_path, "robot").load(cell_m=0.3)
    assert found.fault is None
    assert (found.ledger.frame, found.ledger.total) == ("map", 15)
    visits = found.ledger.tiles[0, 0]
    assert np.count_nonzero(visits) == 15
    order = json.loads(found.ledger.note)
    assert (order["stage"], order["paused"], order["home"]) == ("covering", False, [2, 2])


def test_an_order_paused_in_its_second_pass_is_restored():
    """From the ledger of a build shortly before 1.0.0, without members that came later."""
    order = {"zones": [SQUARE | {"name": "hall", "passes": 2}, SQUARE | {"name": "kitchen"}]}
    order |= {"keep_out": [RUG], "return_home": True, "keep_covered": False}
    note = {"version": 1, "order": order, "standing": False, "stage": "covering", "zone": 0}
    note |= {"pass": 2, "begun": True, "tries": 0, "home": [1, 3], "paused": True, "why": ""}
    state = OrderState.from_json(json.dumps(note))
    assert (state.stage, state.paused, state.pass_number) == (Stage.COVERING, True, 2)
    assert (state.begun, state.home, state.order.return_home) == (True, (1, 3), True)
    assert [(zone.name, zone.passes) for zone in state.order.zones] == [("hall", 2), ("kitchen", 1)]
    assert [list(map(list, polygon)) for polygon in state.order.keep_out] == [RUG]


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


def test_a_configuration_is_read_but_for_a_removed_key(tmp_path):
    old, path = DATA / "config.yaml", tmp_path / "config.yaml"
    with pytest.raises(BadConfiguration, match=r"line 23: planner\.local_search: was removed"):
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
