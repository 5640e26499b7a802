"""Who joins late, and what becomes of everybody when the router between them is started again."""

from __future__ import annotations

import json
import time

import pytest
import zenoh
import zenoh.ext

from tests.support.outsider import Collector, Outsider
from tests.support.processes import ENVIRONMENT, daemon_process, fasaco_edge, free_endpoint
from tests.support.rooms import WALL, fill, map_bytes, pose_bytes, room
from tests.support.router import router_process
from tests.support.waiting import until

# On a quiet machine a late joiner has all after some milliseconds, and all is back after 0.3 s.
LATE_S = 30.0
BACK_S = 60.0
PREFIX = "fasaco/@v1/robot"
PATIENT = {"retry": {"period_init_ms": 200, "period_max_ms": 1000}}


def member(endpoint, connect):
    config = {"mode": "client", "connect": {"endpoints": [endpoint], **connect}}
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


@pytest.mark.parametrize(("away_s", "connect"), [(0.2, {}), (3.0, PATIENT)])
def test_when_the_router_is_back_everything_is(tmp_path, away_s, connect):
    """The subscriber does nothing but keep its session."""
    endpoint = free_endpoint()
    bus = {"mode": "peer", "listen": [], "connect": [endpoint]}
    with router_process(endpoint) as router, daemon_process(tmp_path, bus=bus):
        session = member(endpoint, connect)
        try:
            heard = _Heard(session)
            heard.wait_all(0)
            router.kill()
            router.wait()
            until(lambda: not heard.tokens[-1])
            time.sleep(away_s)
            with router_process(endpoint):
                back = heard.wait_all(1)
        finally:
            session.close()  # type: ignore[no-untyped-call]
    print(f"back after {away_s:g} s:", {name: f"{1e3 * s:.0f} ms" for name, s in back.items()})
    assert max(back.values()) < BACK_S


class _Heard:
    """What a subscriber hears, with nothing declared again."""

    def __init__(self, session):
        self.tokens = []
        self._session = session
        self._maps = 0
        history = zenoh.ext.HistoryConfig(max_samples=1, detect_late_publishers=True)
        self._subscriptions = {"path": Collector(), "status": Collector()}
        for name, receiver in self._subscriptions.items():
            zenoh.ext.declare_advanced_subscriber(
                session, f"{PREFIX}/{name}", receiver, history=history
            )
        session.liveliness().declare_subscriber(f"{PREFIX}/alive", self._note, history=True)

    def wait_all(self, losses):
        since = {name: len(receiver.heard) for name, receiver in self._subscriptions.items()}
        missing = {
            "path": lambda: self._is_new("path", since),
            "status": lambda: self._is_new("status", since),
            "liveliness": lambda: self.tokens.count(True) > losses,
            "queries": self._is_answered,
        }
        took, started = {}, time.monotonic()
        while missing:
            assert time.monotonic() - started < 150.0, f"never came: {missing.keys()}"
            self._publish()
            for name in [name for name, holds in missing.items() if holds()]:
                took[name] = time.monotonic() - started
                del missing[name]
            time.sleep(0.02)
        return took

    def _note(self, token):
        self.tokens.append(token.kind == zenoh.SampleKind.PUT)

    def _is_new(self, name, since):
        return len(self._subscriptions[name].heard) > since[name]

    def _is_answered(self):
        replies = self._session.get(f"{PREFIX}/@rpc/version", timeout=2.0)
        return any(reply.ok is not None for reply in replies)

    def _publish(self):
        self._maps += 1
        pixels = fill(room(3.0, 3.0), 1.5, 0.0, 1.6, 0.5 + 0.3 * (self._maps % 4), WALL)
        for name, payload in (("map", map_bytes(pixels)), ("pose", pose_bytes(0.75, 0.75))):
            self._session.put(f"{PREFIX}/{name}", payload)


def test_a_client_waits_for_its_router_and_logs_that(tmp_path):
    endpoint = free_endpoint()
    bus = {"mode": "client", "listen": [], "connect": [endpoint]}
    with daemon_process(tmp_path, bus=bus) as daemon:
        until(lambda: f"waiting for the bus at {endpoint}" in daemon.log_text())
        with router_process(endpoint), Outsider(endpoint) as outsider:
            assert outsider.ask_status()["state"] == "waiting for map"
    assert "ready" in daemon.log_text()


def test_a_client_waiting_for_its_router_can_be_stopped(tmp_path):
    bus = {"mode": "client", "listen": [], "connect": [free_endpoint()]}
    with daemon_process(tmp_path, bus=bus) as daemon:
        until(lambda: "waiting for the bus" in daemon.log_text())
        assert daemon.stop() < 10.0


def test_commands_find_robot_and_bus_by_file_or_environment(tmp_path, monkeypatch):
    name = {"name": "maja"}
    with daemon_process(tmp_path, robot=name) as daemon, Outsider(daemon.endpoint, "maja"):
        file = tmp_path / "daemon0.yaml"
        by_file = fasaco_edge("mission", "stop", "--config", file, "--json")
        assert json.loads(by_file.out)["robot"] == "maja"
        monkeypatch.setitem(ENVIRONMENT, "FASACO_CONNECT", daemon.endpoint)
        monkeypatch.setitem(ENVIRONMENT, "FASACO_ROBOT", "maja")
        told = fasaco_edge("mission", "status", "--json")
        assert json.loads(told.out)["robot"] == "maja"
        assert json.loads(told.out)["state"] == "idle"
        # What is said here and now counts more.
        wrong = fasaco_edge("mission", "status", "--robot", "moritz")
        assert wrong.code == 1
        assert "robots on this bus: maja" in wrong.err
