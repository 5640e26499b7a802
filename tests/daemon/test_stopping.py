"""Ends in order and in time, whatever it is doing; and leaves nothing behind."""

from __future__ import annotations

import os
import re
import signal
import time
from contextlib import contextmanager

import numpy as np
import pytest

from fasaco_edge.daemon.service import RECORDER_LONGEST_S, RECORDER_STOP_S
from fasaco_edge.host.processes import cpu_seconds
from fasaco_edge.recording.read.torn import scan_recording
from tests.support.outsider import joined_daemon
from tests.support.processes import is_running
from tests.support.rooms import map_bytes, pillared_room, room, show_room
from tests.support.waiting import until

# 400 x 400 cells of the tool's width [m].
HUGE_M = 120.0
ENDLESS = {"ants": 1_000_000, "budget_s": 3600.0}


def cluttered(size_m: float) -> np.ndarray:
    pixels = room(size_m, size_m)
    for row in range(4):
        for col in range(4):
            pixels[20 + row :: 40, 20 + col :: 40] = 100
    return pixels


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_while_it_waits(tmp_path, number):
    with joined_daemon(tmp_path) as (running, outsider):
        outsider.ask_status()
        print(f"ended after {1e3 * running.stop(number):.0f} ms")
        assert "stopped" in running.log_text()


def test_a_signal_ends_it_while_it_plans(tmp_path):
    with joined_daemon(tmp_path, planner=ENDLESS) as (running, outsider):
        show_room(outsider, cluttered(HUGE_M), 0.75, 0.75)
        status = outsider.wait_status(lambda status: status["plan"]["planning"])
        assert status["coverage"]["coverable"] > 100_000
        time.sleep(0.5)
        print(f"ended after {1e3 * running.stop():.0f} ms")


def test_a_signal_ends_it_while_it_compiles(tmp_path):
    """A fresh cache takes many seconds; nobody waits for it."""
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for loading_s in (0.5, 2.0):
        with joined_daemon(tmp_path, env=cache) as (running, outsider):
            outsider.put("map", map_bytes(pillared_room()))
            outsider.wait_status(lambda status: status["state"] == "loading")
            time.sleep(loading_s)
            assert outsider.ask_status()["state"] == "loading"
            running.stop()


def test_it_answers_while_it_plans(tmp_path):
    """Statuses come once a second; on a busy machine later, but not after more work."""
    with joined_daemon(tmp_path, planner=ENDLESS) as (_, outsider):
        show_room(outsider, cluttered(HUGE_M), 0.75, 0.75)
        outsider.wait_status(lambda status: status["plan"]["planning"])
        since = outsider.ask_status()["uptime_s"]
        later = outsider.wait_status(lambda status: status["uptime_s"] > since + 2.0)
        counts = ("plans", "unchanged", "outdated", "attempts")
        assert later["plan"] == dict.fromkeys(counts, 0) | {"planning": True}
        said = sorted(
            (status["uptime_s"], status["cpu_s"])
            for status in (heard.json() for heard in outsider.status.heard)
            if status["uptime_s"] >= since
        )
        assert max(np.diff([cpu_s for _, cpu_s in said])) < 2.0


@contextmanager
def recording_into(folder):
    pytest.importorskip("rerun")
    with joined_daemon(folder, "--record", str(folder)) as (running, outsider):
        status = outsider.wait_status(
            lambda status: (status["recorder"] or {}).get("state") == "recording"
        )
        yield running, status["recorder"]["pid"]


def test_a_killed_daemon_leaves_no_recorder(tmp_path):
    with recording_into(tmp_path) as (running, recorder):
        assert is_running(recorder)
        running.kill()
        until(lambda: not is_running(recorder), why=lambda: "the recorder outlives its daemon")
    assert list(tmp_path.glob("*.rrd"))


def test_ctrl_c_leaves_its_recorder_alone(tmp_path):
    """Ended with its daemon, it missed the last messages: a replay had a cell less than a review.

    A terminal sends Ctrl-C to the process group.
    """
    with recording_into(tmp_path) as (running, recorder):
        assert os.getpgid(recorder) != os.getpgid(running.pid)


def test_a_recorder_that_hangs_does_not_hold_the_end_up(tmp_path):
    with recording_into(tmp_path) as (running, recorder):
        os.kill(recorder, signal.SIGSTOP)
        print(f"ended after {1e3 * running.stop():.0f} ms")
        assert not is_running(recorder)


def test_a_slow_recorder_gets_the_time_that_it_needs(tmp_path):
    """As on a busy computer: it runs for a moment now and then."""
    with recording_into(tmp_path) as (running, recorder):
        running.process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + 3.0
        while time.monotonic() < deadline:
            os.kill(recorder, signal.SIGSTOP)
            time.sleep(0.8)
            used_s = cpu_seconds(recorder)
            os.kill(recorder, signal.SIGCONT)
            while is_running(recorder) and cpu_seconds(recorder) < used_s + 0.02:
                time.sleep(0.001)
        assert running.process.wait(60.0) == 0
        if given_up := re.search(r"recorder did not end in (\S+) s", running.log_text()):
            # This computer is so slow that it needs more than there is.
            assert float(given_up[1]) > RECORDER_LONGEST_S - RECORDER_STOP_S
            return
    (path,) = tmp_path.glob("*.rrd")
    with path.open("rb") as recording:
        assert scan_recording(recording).has_footer
