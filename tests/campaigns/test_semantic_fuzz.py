"""The semantic fuzz in its short form, and that it finds what there is to be found."""

from __future__ import annotations

import json
from itertools import islice
from pathlib import Path

from fasaco_edge.grid.reachable_area import ReachableArea
from tests.campaigns.semantic_fuzz import (
    Findings,
    fuzz_daemon,
    fuzz_missions,
    replay_mission,
)
from tests.campaigns.senseless import CONTENTS, SILENT, Senseless
from tests.campaigns.senseless_daemon import unit_memory_mb

HASTE = {"check_every": 600, "restart_every": 1_100, "reload_every": 500}


def test_a_daemon_outlives_them(tmp_path):
    findings = Findings(tmp_path)
    (tmp_path / "daemon").mkdir()
    stream = Senseless(2, most_pixels=200_000, **HASTE)
    figures = fuzz_daemon(tmp_path / "daemon", stream, 2_500, 2, findings, pace_hz=2_000.0)
    assert findings.texts == []
    assert figures["events"] == 2_500
    assert figures["lives"] == 1 + figures["restart"] >= 2
    assert figures["heard: path"] > 0
    assert 0 < figures["peak_mb"] < unit_memory_mb()
    assert figures["loop: turns"] > 0


def test_a_mission_outlives_them(tmp_path):
    findings = Findings(tmp_path)
    figures = fuzz_missions(3_000, 1, findings)
    assert findings.texts == []
    assert figures["events"] == 3_000
    seen = "paths", "honest again", "ledgers read again", "rooms read again"
    assert min(figures[each] for each in seen) > 0


def test_a_seed_says_the_same_again():
    first, again, other = (list(islice(Senseless(seed), 8_000)) for seed in (5, 5, 6))
    assert first == again != other
    assert json.loads(json.dumps(first)) == first
    assert {"map", "update", "pose", "drive", "command", "ask"} <= {each["do"] for each in first}
    assert {each["kind"] for each in first if each["do"] == "map"} <= set(CONTENTS)
    assert sum(each["do"] in SILENT for each in first) < len(first) / 10


def test_a_finding_is_written_down_and_repeats(tmp_path, monkeypatch):
    """With the fault that the fuzz found first: a path cut off at a cell that is lost."""
    prefix = ReachableArea.drivable_prefix
    monkeypatch.setattr(
        ReachableArea,
        "drivable_prefix",
        lambda on, cells: max(prefix(on, cells), min(1, len(cells))),
    )
    findings = Findings(tmp_path)
    fuzz_missions(8_000, 2, findings)
    assert "BrokenInvariantError" in findings.texts[0]
    document = json.loads(next(Path(tmp_path).glob("semantic_fuzz-*.json")).read_text())
    replayed = Findings(tmp_path)
    replay_mission(document["events"], document["seed"], replayed)
    assert len(replayed.texts) == 1
    monkeypatch.undo()
    mended = Findings(tmp_path)
    replay_mission(document["events"], document["seed"], mended)
    assert mended.texts == []
