"""Legal, but more than can be said or done: it costs a fault and never the daemon."""

from __future__ import annotations

import os
import signal
import sys
import time

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.security import BusConfig
from fasaco_edge.daemon.supervisor import FIRST_PAUSE_S, LONGEST_PAUSE_S, RecorderSupervisor
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.status import Recorder
from tests.support.processes import free_endpoint


def test_a_recorder_that_cannot_be_started_is_tried_again(tmp_path, monkeypatch):
    config = DaemonConfig()
    with open_bus(BusSettings("peer", (), (free_endpoint(),))) as bus:
        monkeypatch.setattr(sys, "executable", str(tmp_path / "no-python"))
        recorder = RecorderSupervisor(config, bus, tmp_path)
        state = recorder.poll(100.0)
        assert state.state == "restarting"
        assert "could not be started" in state.reason
        assert recorder.poll(100.0 + 2 * FIRST_PAUSE_S).restarts == 1
        recorder.close(1.0, 1.0)


def test_a_recorder_without_a_folder_is_not_started_again(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    config = DaemonConfig(bus=BusConfig(listen=(free_endpoint(),)))
    with open_bus(config.bus.settings(config.keys().prefix)) as bus:
        recorder, now = RecorderSupervisor(config, bus, tmp_path / "file"), time.monotonic()
        while recorder.poll(now).state == "starting":
            time.sleep(0.01)
        states = [recorder.poll(now + pause_s) for pause_s in (1.0, LONGEST_PAUSE_S, 3600.0)]
        recorder.close(1.0, 1.0)
    assert {(state.state, state.restarts) for state in states} == {("failed", 0)}


def test_a_recorder_that_keeps_dying_starts_less_and_less_often(tmp_path, monkeypatch):
    config, program, born = DaemonConfig(), tmp_path / "program", tmp_path / "born"
    program.write_text(f"#!/bin/sh\necho $$ > {born}\nexec sleep 60\n")
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    with open_bus(BusSettings("peer", (), (free_endpoint(),))) as bus:
        reports = bus.advertise(config.keys(), topics.RECORDER)
        recorder, now, pauses = RecorderSupervisor(config, bus, tmp_path), time.monotonic(), []

        def lives_for(seconds):
            nonlocal now
            while not (born.exists() and (pid := born.read_text().strip())):
                time.sleep(0.01)
            born.unlink()
            now += seconds
            while recorder.poll(now).state != "recording":
                reports.put(encode_json(Recorder(state="recording", pid=int(pid))))
                time.sleep(0.01)
            os.kill(int(pid), signal.SIGKILL)
            while (state := recorder.poll(now)).state != "restarting":
                time.sleep(0.01)
            died_at = now
            while recorder.poll(now).restarts == state.restarts:
                now += 0.5
            pauses.append(now - died_at)

        for seconds in (2.0, 2.0, 2.0, LONGEST_PAUSE_S, 2.0):
            lives_for(seconds)
        recorder.close(1.0, 1.0)
    assert pauses == [1.0, 2.0, 4.0, 1.0, 2.0]
