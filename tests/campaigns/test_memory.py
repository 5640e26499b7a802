"""The memory campaign in short: under the unit's own limit, and measured where there is none."""

from __future__ import annotations

import subprocess
import sys

import pytest

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.memory import needed_bytes
from tests.campaigns.memory import Flood, pour, run_flood, run_floods
from tests.support.outsider import Outsider
from tests.support.processes import ENVIRONMENT, daemon_process
from tests.support.rooms import map_bytes, pose_bytes, room
from tests.support.service_manager import UNIT, memory_group, unit_limit, why_not

SMALL = {"map": {"max_pixels": 4_000_000, "max_lattice_cells": 60_000}}
limited = pytest.mark.skipif(bool(why_not()), reason=why_not())
unlimited = pytest.mark.skipif(not why_not(), reason="runs under the limit of the unit")


@pytest.mark.parametrize(
    ("flood", "outcome", "error"),
    [
        pytest.param(Flood("updates", 2000, 0.02, 20.0), "taken", "", marks=unlimited),
        pytest.param(Flood("mappers", 2000, 0.03, 20.0), "taken", "", marks=unlimited),
        (Flood("maps", 3000, 0.02, 10.0), "refused", "9000104 bytes was dropped: it may have at"),
        (Flood("maps", 2000, 0.0003, 5.0), "refused", "must be 0.0012 m or larger"),
        (Flood("message", 2700, 0.02, 10.0), "refused", "a message of 7290104 bytes"),
    ],
    ids=lambda value: value.kind if isinstance(value, Flood) else None,
)
def test_a_daemon_takes_no_more_than_it_says(tmp_path, flood, outcome, error):
    row = run_flood(flood, tmp_path, 1.0, None, None, **SMALL)
    assert row.broken == ""
    assert row.outcome == outcome
    assert error in row.error


@limited
@pytest.mark.parametrize(
    "flood",
    [
        Flood("maps", 8000, 0.02, 20.0),
        Flood("updates", 5000, 0.03, 20.0),
        Flood("grey", 5900, 0.03, 20.0),
        Flood("colour", 8000, 0.03, 20.0),
        Flood("message", 2300, 0.03, 20.0),
    ],
    ids=lambda flood: flood.kind,
)
def test_a_daemon_lives_under_its_units_limit(tmp_path, flood):
    (row,) = run_floods([flood], tmp_path, 2.0, unit_limit())
    assert row.broken == ""


@limited
def test_a_smaller_memory_limit_refuses_large_maps(tmp_path):
    limit = 400 << 20
    with memory_group(limit) as group:
        flood = Flood("maps", 5000, 0.03, 10.0)
        row = run_flood(flood, tmp_path, 2.0, group, limit)
        assert group.kills == 0
    assert (row.outcome, row.broken) == ("refused", "")
    log = next(tmp_path.glob("daemon*.log")).read_text()
    assert f"may need {needed_bytes(DaemonConfig()) / 1e6:.0f} MB: they are reduced to" in log


@limited
def test_a_recorder_lives_under_its_units_limit(tmp_path):
    pytest.importorskip("rerun")
    limit = unit_limit(unit=UNIT.with_name("fasaco-edge-recorder.service"))
    program = [sys.executable, "-m", "fasaco_edge", "record", "--out", str(tmp_path / "out")]
    with (
        memory_group(limit) as group,
        daemon_process(tmp_path) as daemon,
        Outsider(daemon.endpoint) as outsider,
    ):
        words = [*group.program, *program, "--connect", daemon.endpoint]
        recorder = subprocess.Popen(words, env=ENVIRONMENT)
        try:
            told = outsider.listen("recorder")
            told.wait(lambda heard: heard.json()["state"] == "recording")
            outsider.put("map", map_bytes(room(8.0, 6.0)))
            outsider.put("pose", pose_bytes(0.75, 0.75))
            pour(Flood("updates", 5000, 0.03, 20.0), daemon, outsider, 2.0)
            told.wait(lambda heard: True, len(told.heard) + 2)  # it still speaks
            assert recorder.poll() is None
            assert group.kills == 0
        finally:
            recorder.kill()
            recorder.wait()
