"""A disk that is full, read-only, missing or hangs: it is told, and the mission goes on."""

from __future__ import annotations

import os
import time
from pathlib import Path

from fasaco_edge.daemon.ledger.disk_writer import RETRY_S
from tests.support.disks import disk_fixture
from tests.support.outsider import Outsider, joined_daemon
from tests.support.processes import STOP_S, Daemon
from tests.support.rooms import begin, drive, lanes, wait_written

small_disk = disk_fixture("256k")


def fill(ballast: Path) -> None:
    with ballast.open("wb", buffering=0) as file:
        try:
            while file.write(bytes(4096)):
                pass
        except OSError:
            return


def check_trouble(running: Daemon, outsider: Outsider, said: str) -> None:
    drive(outsider, lanes(40)[20:])
    status = outsider.wait_status(lambda status: status["ledger"]["fault"] is not None)
    assert said in status["ledger"]["fault"]
    assert "--state" in status["ledger"]["fault"]
    assert status["state"] == "covering"
    assert status["errors"]["by_code"]["ledger_file"] == 1
    status = drive(outsider, lanes(60)[40:])
    assert status["coverage"]["covered"] == 60
    time.sleep(1.5 * RETRY_S)
    # Of the ledger, and of the rooms that were found meanwhile.
    for what in ("progress is kept", "rooms are kept"):
        assert running.log_text().count(f"{said}: {what}") <= 1, "said once"
    errors = outsider.ask_status()["errors"]["by_code"]
    assert errors in ({"ledger_file": 1}, {"ledger_file": 1, "rooms_file": 1})


def test_a_full_disk_is_reported_and_loses_nothing(tmp_path, small_disk):
    ballast = small_disk / "ballast"
    with joined_daemon(tmp_path, "--state", str(small_disk)) as (running, outsider):
        begin(outsider)
        drive(outsider, lanes(20))
        wait_written(outsider)
        fill(ballast)
        check_trouble(running, outsider, "No space left on device")
        ballast.unlink()
        outsider.wait_status(lambda status: status["ledger"]["fault"] is None)
        running.kill()
    with joined_daemon(tmp_path, "--state", str(small_disk)) as (_, outsider):
        status = outsider.ask_status()
        assert (status["ledger"]["restored_cells"], status["ledger"]["fault"]) == (60, None)


def test_a_hanging_disk_delays_neither_mission_nor_shutdown(tmp_path):
    """Who opens a pipe to write waits for a reader, as for a disk that does not answer."""
    with joined_daemon(tmp_path) as (running, outsider):
        os.mkfifo(tmp_path / "state" / "robot.ledger.new")
        begin(outsider)
        status = drive(outsider, lanes(30))
        assert status["coverage"]["covered"] == 30
        since = status["uptime_s"]
        outsider.wait_status(lambda status: status["uptime_s"] > since + 2.0)
        assert running.stop() < STOP_S
        assert "the disk is too slow" in running.log_text()
