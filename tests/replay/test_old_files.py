"""Files that an earlier release wrote are still read, and mean the same."""

from __future__ import annotations

import hashlib
import json
import lzma
import shutil
from pathlib import Path

import msgspec
import numpy as np
import pytest
import yaml

from fasaco_edge.cli import main
from fasaco_edge.config.loading import load_config
from fasaco_edge.daemon.ledger.file import LedgerFile
from fasaco_edge.wire.documents.path_documents import digest

pytest.importorskip("rerun")

from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.replay.replay import Replay, read_run

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


def test_a_recording_of_another_search_is_repeated_as_far_as_it_is_the_same(recording, capsys):
    """The search has changed since: what differs first is named, and by which code it was made."""
    summary = printed(capsys, "replay", recording, code=1)["summary"]
    assert (summary["equal"], summary["turns"], summary["turns_equal"]) == (False, 559, 69)
    assert summary["difference"]["what"] == "plan 1"
    assert summary["kernels"]["recorded"] == "kernels-339d81898e70"
    assert summary["kernels"]["replayed"] != summary["kernels"]["recorded"]
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
    figures = ("covered_cells", "steps", "revisits", "turns_90", "paths", "replans")
    assert [review[name] for name in figures] == [63, 51, 1, 15, 30, 27]
    assert review["driven_m"] == pytest.approx(15.23)
    assert (review["state"], review["complete"]) == ("done", True)


def test_a_ledger_is_restored(tmp_path):
    shutil.copy(DATA / "robot.ledger", tmp_path)
    found = LedgerFile(tmp_path, "robot").load(cell_m=0.3)
    assert found.fault is None
    assert (found.ledger.frame, found.ledger.total) == ("map", 15)
    visits = found.ledger.tiles[0, 0]
    assert np.count_nonzero(visits) == 15
    order = json.loads(found.ledger.note)
    assert (order["stage"], order["paused"], order["home"]) == ("covering", False, [2, 2])


def test_a_configuration_is_read():
    path = DATA / "config.yaml"
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
