"""A mission under the service: what may happen to it, and that it goes on."""

from __future__ import annotations

import time

from tests.deploy.robots import robot, swept_m2
from tests.deploy.service import Service, wait_for


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
