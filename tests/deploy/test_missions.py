"""A mission under the service: what may happen to it, and that it goes on."""

from __future__ import annotations

import time

import pytest

from tests.deploy.recordings import recordings
from tests.deploy.robots import robot, swept_m2
from tests.deploy.service import Service, wait_for
from tests.support.processes import STOP_S

ENDLESS = {"ants": 1_000_000, "budget_s": 3600.0, "name": "fasaco"}


def test_a_hanging_daemon_is_ended_and_the_mission_continues(service: Service):
    # With the unit's own watchdog: on a slow machine a shorter one ends a daemon that only loads.
    service.start()
    with robot(service.lab):
        wait_for(lambda: swept_m2(service) >= 4, 40.0, "4 m2 swept")
        time.sleep(1.0)  # what is a second old is on the disk
        before, process = swept_m2(service), service.pid
        service.signal("STOP")
        hung = wait_for(lambda: service.pid not in (0, process), 15.0, "another process")
        wait_for(lambda: service.show("ActiveState") == "active", 10.0, "ready again")
        print(f"another process {hung:.1f} s after the hang")
        status = service.ask()
        assert status["ledger"]["restored_cells"] >= 40
        wait_for(lambda: swept_m2(service) > before, 30.0, "more swept than before")
    assert "Watchdog timeout" in service.text()
    assert service.show("NRestarts") == "1"


def test_it_ends_in_time_while_it_plans(service: Service):
    service.configure(planner=ENDLESS)
    service.start()
    service.lab.run("/opt/fasaco-edge/current/bin/python3", "-m", "tests.deploy.mapper", "hall")
    assert service.ask()["plan"]["planning"]
    seconds = service.stop()
    print(f"ended after {seconds:.2f} s, in the middle of a plan")
    assert seconds <= STOP_S
    assert (service.show("Result"), service.show("ExecMainStatus")) == ("success", "0")


def test_a_full_disk_is_reported_and_the_mission_continues(service: Service):
    lab = service.lab
    service.start()
    service.stop()  # its folders are there now
    lab.run("mount", "-t", "tmpfs", "-o", "size=16k,mode=755", "t", "/var/lib/private/fasaco-edge")
    try:
        lab.run("sh", "-c", "cat /dev/zero >/var/lib/private/fasaco-edge/ballast || true")
        service.start()
        with robot(lab):
            wait_for(lambda: swept_m2(service) >= 2, 40.0, "2 m2 swept")
            fault = service.ask()["ledger"]["fault"]
            assert "No space left on device" in fault
            assert "No space left on device" in service.show("StatusText")
            # Once for each file.
            said = [line for line in service.text().splitlines() if "cannot write" in line]
            assert sum("rooms.json" not in line for line in said) == 1
            assert sum("rooms.json" in line for line in said) <= 1
            lab.run("rm", "/var/lib/private/fasaco-edge/ballast")
            wait_for(lambda: service.ask()["ledger"]["fault"] is None, 10.0, "written again")
        assert service.show("NRestarts") == "0"
    finally:
        service.stop()
        lab.run("umount", "/var/lib/private/fasaco-edge")


def test_a_recorder_may_die(service: Service):
    pytest.importorskip("rerun")
    lab, recorder = service.lab, Service(service.lab, "fasaco-edge-recorder")
    recorder.drop_in("soon", "[Service]\nRestartSec=200ms\n")
    service.start()
    recorder.start()
    try:
        wait_for(lambda: recordings(lab) == 1, 15.0, "a recording")
        daemon, before = service.pid, recorder.pid
        recorder.signal("KILL")
        wait_for(lambda: recorder.pid not in (0, before), 10.0, "another recorder")
        wait_for(lambda: recordings(lab) == 2, 15.0, "another recording")
        assert service.pid == daemon
        assert service.ask()["state"] == "waiting for map"
    finally:
        recorder.remove()
