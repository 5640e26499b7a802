"""The semantic fuzz in its short form, and that it finds what there is to be found."""

from __future__ import annotations

import json
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.wire.messages.paths import encode_path
from tests.campaigns.path_in_force import PathInForce
from tests.campaigns.semantic_fuzz import (
    Findings,
    fuzz_daemon,
    fuzz_missions,
    replay_mission,
)
from tests.campaigns.senseless import CONTENTS, SILENT, Senseless
from tests.campaigns.senseless_daemon import BrokenPromiseError, Judge, unit_memory_mb
from tests.campaigns.senseless_mission import MissionTrial

HASTE = {"check_every": 600, "restart_every": 1_100, "reload_every": 500, "router_every": 1_300}
ROBOT = {"tool_width_m": 0.3, "radius_m": 0.18}
FREE_MAP = {"do": "map", "rows": 60, "cols": 60, "resolution": 0.05, "x": 0.0, "y": 0.0, "yaw": 0.0}
FREE_MAP |= {"frame": "map", "stamp": 7, "kind": "free", "seed": 1, "topic": "map"}


def test_a_daemon_outlives_them(tmp_path):
    findings = Findings(tmp_path)
    (tmp_path / "daemon").mkdir()
    stream = Senseless(2, most_pixels=200_000, **HASTE)
    figures = fuzz_daemon(tmp_path / "daemon", stream, 2_500, 2, findings, pace_hz=2_000.0)
    assert findings.texts == []
    assert figures["events"] == 2_500
    assert figures["lives"] == 1 + figures["restart"] >= 2
    assert figures["router"] >= 1
    assert figures["heard: path"] > 0
    judged = (f"{what} judged on their map" for what in ("paths", "lines"))
    assert sum(figures.get(each, 0) for each in judged) > 0
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


def test_the_same_events_make_the_same_turns():
    counts = []
    for _ in range(2):
        trial = MissionTrial(3)
        for event in islice(Senseless(3, 90_000, **HASTE), 1_200):
            trial.perform(event)
        counts.append(trial.counts)
    assert counts[0] == counts[1]


@pytest.mark.parametrize(
    ("xy", "holds"),
    [
        ([(0.45, 0.45), (0.75, 0.45)], True),
        ([(0.45, 0.45), (1.05, 0.45)], False),
        ([(0.15, 0.15), (0.45, 0.15)], False),
        ([(9.15, 9.15)], False),
    ],
    ids=["on the map", "with a gap", "beside a wall", "beside the map"],
)
def test_a_path_is_judged_on_the_map_it_names(xy, holds):
    judge = Judge()
    judge.configs.append({"robot": ROBOT, "map": {"free_at_most": 25}})
    judge.expect(FREE_MAP)
    points = np.array(xy)
    payload = encode_path(points, np.zeros(len(points)), "map", 7)
    about = {
        "daemon": "a1",
        "revision": 1,
        "map_stamp_ns": 7,
        "map_revision": 1,
        "reason": "so",
        "changed": None,
        "speed_m_s": None,
    }
    about |= {"steps": len(points) - 1, "plan_ms": 1.0}
    figures = ("planner", "seed", "ants", "kicks", "proposals", "planned_steps")
    about |= dict.fromkeys([*figures, "planned_cost_s", "lower_bound_steps", "gap"])
    saved = ("saved_by_ants_s", "saved_by_local_search_s", "saved_by_velocity_s")
    about |= dict.fromkeys(("lower_bound_cost_s", *saved))
    if holds:
        judge.see_path(payload, about)
        assert judge.counts["paths judged on their map"] == 1
        assert judge.walk.tolist() == points.tolist()
        return
    with pytest.raises(BrokenPromiseError):
        judge.see_path(payload, about)


def status(state, path=None, stand="plans"):
    return {
        "state": state,
        "reason": "so",
        "claim": {"id": "a1", "stand": stand},
        "path": None if path is None else {"revision": path},
    }


@pytest.mark.parametrize(
    ("path", "said", "holds"),
    [
        ((5, 2), status("blocked", 2), False),
        ((5, 2), status("covering", 3), False),
        ((5, 2), status("loading"), False),
        ((5, 2), status("covering", 2), True),
        ((0, 3), status("blocked", 3), True),
        ((0, 0), status("waiting for map"), True),
        ((5, 2), status("blocked", stand="waits"), True),
    ],
    ids=["rests", "another path", "no mission", "drives", "stopped", "begins", "another daemon"],
)
def test_a_path_is_judged_by_the_planners_state(path, said, holds):
    judge = PathInForce()
    judge.see_path(*path)
    assert judge.why_broken(said, 1.0) == ""
    assert bool(judge.why_broken(said, 2.0)) is not holds
    # The path may be a moment late.
    judge.see_path(0, path[1] + 1)
    assert judge.why_broken(status("blocked", path[1] + 1), 3.0) == ""
