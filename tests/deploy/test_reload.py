"""systemctl reload, while a robot drives."""

from __future__ import annotations

from tests.deploy.robots import robot, swept_m2
from tests.deploy.service import Service, wait_for


def reload(service: Service) -> None:
    """Reload as an operator does; systemd waits for READY=1."""
    service.lab.run("systemctl", "reload", service.name)
    wait_for(lambda: service.show("ActiveState") == "active", 5.0, "reloaded")


def test_a_valid_reload_takes_effect_during_a_mission(service: Service):
    service.start()
    process = service.pid
    with robot(service.lab):
        wait_for(lambda: swept_m2(service) >= 3, 40.0, "3 m2 swept")
        before = swept_m2(service)
        service.configure(planner={"ants": 77, "spare_share": 0.0}, robot={"name": "other"})
        reload(service)
        wait_for(lambda: service.ask("config")["planner"]["ants"] == 77, 5.0, "taken")
        status = service.ask()
        assert status["robot"] == "robot"
        assert status["floor"]["swept_m2"] > before - 0.5  # it is told rounded
        wait_for(lambda: swept_m2(service) > before, 30.0, "more swept than before")
    assert service.pid == process
    assert "robot.name: needs a restart" in service.text()
    assert "configuration read again: planner.ants" in service.text()
