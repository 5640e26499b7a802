"""Progress outlives the daemon: whatever ends it, the next one goes on where it stopped."""

from __future__ import annotations

import contextlib
import json
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from fasaco_edge.daemon.ledger.codec import decode_ledger
from fasaco_edge.daemon.ledger.writer import PERIOD_S
from fasaco_edge.wire.messages.pheromone import PheromoneMessage, decode_pheromone
from tests.campaigns.kill_daemon import MOST_LOST_S, run_campaign
from tests.support.ledgers import CELL_M
from tests.support.outsider import Outsider, joined_daemon
from tests.support.processes import daemon_process
from tests.support.rooms import (
    HALL,
    begin,
    drive,
    lanes,
    map_bytes,
    pillars,
    pose_bytes,
    wait_written,
)

# The full campaign, two hundred, is a command: see kill_campaign.py.
KILLS = 3
# Cells of the hall.
COVERED = 100


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ended")
    with joined_daemon(folder) as (_, outsider):
        begin(outsider)
        assert drive(outsider, lanes(COVERED))["coverage"]["covered"] == COVERED
    return folder / "state"


@pytest.fixture
def covered(ended: Path, tmp_path: Path) -> Path:
    shutil.copytree(ended, tmp_path / "state")
    return tmp_path


def state_files(folder: Path) -> list[str]:
    return sorted(path.name for path in (folder / "state").iterdir() if path.suffix != ".lock")


def wait_cells(folder: Path, cells: int) -> None:
    newest, written = folder / "state" / "robot.ledger", 0
    while written < cells:
        time.sleep(0.05)
        with contextlib.suppress(FileNotFoundError):
            written = decode_ledger(newest.read_bytes(), CELL_M).cells


def test_a_daemon_killed_at_random_moments_continues(tmp_path):
    figures = run_campaign(tmp_path, KILLS, "office")
    print(figures)
    assert figures["resumed"] == KILLS
    # On a quiet machine a second: the campaign measures it.
    assert figures["lost_s_max"] <= 10 * MOST_LOST_S


def test_it_continues_where_sigterm_ended_it(covered):
    """SIGTERM loses nothing at all."""
    with joined_daemon(covered) as (running, outsider):
        status = outsider.ask_status()
        assert status["state"] == "waiting for map"
        assert status["ledger"] == {
            "path": str(covered / "state" / "robot.ledger"),
            "age_s": None,
            "restored_cells": COVERED,
            "fault": None,
        }
        assert f"{COVERED} cells covered before" in running.log_text()
        status = begin(outsider, at=COVERED - 1)
        assert status["coverage"]["covered"] == COVERED
        assert status["coverage"]["recovered"] == 0
        assert status["path"]["reason"] == f"first plan, {COVERED} cells were covered before"
        assert status["path"]["steps"] < 13 * 18 - COVERED + 30
        status = drive(outsider, lanes(COVERED + 10)[COVERED:])
        assert status["coverage"]["covered"] == COVERED + 10


def trail_of(outsider: Outsider) -> tuple[PheromoneMessage, int]:
    """Return the living trail, once there is one, and the revision of the path in force."""
    deadline = time.monotonic() + 150
    while outsider.get("@rpc/pheromone")[0].ok is None and time.monotonic() < deadline:
        time.sleep(0.05)
    told = outsider.ask("@rpc/pheromone")
    return decode_pheromone(told.payload), json.loads(told.attachment)["revision"]


def test_the_trail_survives_a_kill(tmp_path):
    with joined_daemon(tmp_path) as (running, outsider):
        begin(outsider)
        drive(outsider, lanes(30))
        wait_cells(tmp_path, 30)
        time.sleep(2 * PERIOD_S)  # it is written once more, and told
        told, _ = trail_of(outsider)
        running.kill()
    with joined_daemon(tmp_path) as (_, outsider):
        # Before it knows where the robot is there is no path to strengthen it.
        outsider.put("map", map_bytes(HALL))
        again, revision = trail_of(outsider)
        assert revision == 0
    # To the last half step of the scale, and of the ledger's 16 bits.
    np.testing.assert_array_equal(again.levels > 0, told.levels > 0)
    np.testing.assert_allclose(again.trail(), told.trail(), rtol=0.03)
    assert told.trail_max > 2 * told.trail_min


def test_a_fresh_start_covers_everything_and_throws_nothing_away(covered):
    with joined_daemon(covered, "--fresh") as (_, outsider):
        status = begin(outsider)
        assert status["ledger"]["restored_cells"] == 0
        assert status["ledger"]["fault"] is None
        assert status["coverage"]["covered"] == 1
    assert [name for name in state_files(covered) if name.startswith("robot.ledger.fresh-")]


def test_another_tool_width_keeps_the_swept_floor(covered):
    robot = {"tool_width_m": 0.25}
    with joined_daemon(covered, robot=robot) as (_, outsider):
        status = begin(outsider)
        assert status["errors"]["total"] == 0
        assert status["ledger"]["fault"] is None
        # The same floor in more cells.
        assert status["coverage"]["covered"] > COVERED
    with joined_daemon(covered) as (_, outsider):
        assert begin(outsider)["coverage"]["covered"] >= COVERED - 1


def test_another_building_is_reported_and_covered_from_zero(covered):
    with joined_daemon(covered) as (_, outsider):
        outsider.put("pose", pose_bytes(0.45, 0.45))
        outsider.put("map", map_bytes(pillars()))
        outsider.wait_status(lambda status: status["state"] == "covering")
        # A pose that came before the map may have counted for the ledger of the other building.
        outsider.put("pose", pose_bytes(0.45, 0.45))
        status = outsider.wait_status(lambda status: status["coverage"]["covered"])
        said = f"the ledger of {COVERED} covered cells is of another building than the map"
        assert status["path"]["reason"] == f"{said}: begun anew"
        assert status["ledger"]["fault"].startswith(said)
        assert status["ledger"]["restored_cells"] == 0
        assert status["errors"]["by_code"] == {"ledger_mismatch": 1}
        assert status["coverage"]["covered"] == 1
        wait_written(outsider)
    assert [name for name in state_files(covered) if ".mismatch-" in name]
    with joined_daemon(covered) as (_, outsider):
        assert outsider.ask_status()["ledger"]["restored_cells"] == 1


def test_a_second_daemon_for_the_robot_is_refused(tmp_path):
    with joined_daemon(tmp_path) as (_, outsider):
        outsider.ask_status()
        with daemon_process(tmp_path) as second:
            assert second.process.wait(120) == 1
            assert "another daemon uses the ledger" in second.log_text()
            assert "hint: stop it, or give this one another robot.name" in second.log_text()
            second.process.returncode = 0
