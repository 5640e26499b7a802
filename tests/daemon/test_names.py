"""Two daemons of one name: one plans, the other says why it does not, and takes over."""

from __future__ import annotations

import json
import signal
import time
from contextlib import ExitStack, contextmanager
from functools import partial

import pytest
import zenoh
from msgspec import convert

from fasaco_edge.bus.claim import ClaimState, claims_in
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.security import BusConfig
from fasaco_edge.daemon.memory import needed_bytes
from fasaco_edge.doctor import session
from fasaco_edge.doctor.finding import CheckContext, Level
from fasaco_edge.host.processes import peak_mb
from tests.campaigns.memory import Flood, map_payload, update_payload
from tests.support.outsider import Collector, Outsider, joined_daemon
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pose_bytes, room
from tests.support.router import router_process
from tests.support.waiting import until

PREFIX = "fasaco/@v1/robot"
ROOM = room(4.0, 3.0)


class Robot:
    def __init__(self, endpoint):
        config = {
            "mode": "client",
            "connect": {
                "endpoints": [endpoint],
                "timeout_ms": -1,
                "exit_on_failure": False,
                "retry": {"period_init_ms": 100, "period_max_ms": 500},
            },
        }
        self.session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        self.paths, self.statuses = Collector(), Collector()
        self.session.declare_subscriber(f"{PREFIX}/path", self.paths)
        self.session.declare_subscriber(f"{PREFIX}/status", self.statuses)

    def tell(self):
        self.session.put(f"{PREFIX}/map", map_bytes(ROOM))
        self.session.put(f"{PREFIX}/pose", pose_bytes(0.75, 0.75))

    def claims(self):
        replies = self.session.liveliness().get(f"{PREFIX}/claim/*/*", timeout=2.0)
        return claims_in(str(reply.ok.key_expr) for reply in replies if reply.ok is not None)

    def wait_claims(self, planning, waiting=0):
        def holds():
            claims = self.claims()
            plan = list(claims.values()).count(ClaimState.PLANS)
            return claims if (plan, len(claims) - plan) == (planning, waiting) else None

        return until(holds)

    def wait_path(self, since=0):
        def holds():
            self.tell()
            time.sleep(0.2)
            return next((p for p in self.paths.heard[since:] if attached(p)["steps"] > 0), None)

        return until(holds)


def attached(path):
    return json.loads(path.attachment)


@contextmanager
def two_daemons(folder, *endpoints, **sections):
    with ExitStack() as stack:
        daemons = []
        for number, endpoint in enumerate(endpoints):
            place = folder / str(number)
            place.mkdir()
            bus = {"mode": "client", "listen": [], "connect": [endpoint]}
            daemons.append(stack.enter_context(daemon_process(place, bus=bus, **sections)))
        yield daemons


@pytest.fixture
def robot_at():
    with ExitStack() as stack:

        def at(endpoint):
            robot = Robot(endpoint)
            stack.callback(robot.session.close)
            return robot

        yield at


def waits(daemon):
    return "this one waits" in daemon.log_text()


def test_one_of_two_daemons_plans_and_the_other_succeeds_it(tmp_path, robot_at):
    endpoint = free_endpoint()
    with router_process(endpoint), two_daemons(tmp_path, endpoint, endpoint) as daemons:
        robot = robot_at(endpoint)
        claims = robot.wait_claims(1, 1)
        (planner,) = (own for own, stand in claims.items() if stand is ClaimState.PLANS)
        robot.wait_path()
        told = [status.json() for status in robot.statuses.heard]
        (blocked,) = {one["reason"] for one in told if one["state"] == "blocked"} or {""}
        assert planner in blocked
        # Questions are answered by the one that plans.
        with Outsider(endpoint) as outsider:
            for _ in range(5):
                assert outsider.ask("@rpc/status").json()["state"] != "blocked"
                assert outsider.ask("@rpc/path").payload
        config = DaemonConfig(bus=BusConfig(listen=(), connect=(endpoint,), mode="client"))
        seen = session.peers(CheckContext(config))
        assert seen.level is Level.WARN
        assert seen.found.startswith("2 daemons have the name 'robot', of which one plans; ")
        assert f"daemon {planner} plans" in seen.details
        second, first = sorted(daemons, key=waits, reverse=True)
        assert waits(second)
        assert not waits(first)
        assert second.log_text().count("this one waits") == 1
        assert {attached(path)["revision"] for path in robot.paths.heard} == set(
            range(1, len(robot.paths.heard) + 1)
        ), "two daemons counted"
        heard = len(robot.paths.heard)
        first.kill()
        assert list(robot.wait_claims(1)) == [own for own in claims if own != planner]
        assert attached(robot.wait_path(heard))["revision"] == 1
        assert "this daemon plans" in second.log_text()
        assert json.loads(until(lambda: robot.statuses.heard[-1:])[0].payload)["state"] != "blocked"


def test_a_command_reaches_the_daemon_that_plans(tmp_path, robot_at):
    endpoint = free_endpoint()
    with router_process(endpoint), two_daemons(tmp_path, endpoint, endpoint):
        robot = robot_at(endpoint)
        robot.wait_claims(1, 1)
        robot.wait_path()
        asked = {"payload": b'{"command":"pause"}', "timeout": 20.0}
        (reply,) = robot.session.get(f"{PREFIX}/@rpc/mission", **asked)
        assert json.loads(reply.ok.payload.to_bytes())["state"] == "paused"
        # Who insists on asking both is told so by the other.
        target = zenoh.QueryTarget.ALL
        replies = list(robot.session.get(f"{PREFIX}/@rpc/mission", target=target, **asked))
        (refused,) = (json.loads(r.err.payload.to_bytes()) for r in replies if r.err is not None)
        assert len(replies) == 2
        assert refused["code"] == "not_now"


def test_a_frozen_daemon_is_replaced_and_then_waits(tmp_path, robot_at):
    endpoint = free_endpoint()
    with router_process(endpoint), two_daemons(tmp_path, endpoint, endpoint) as daemons:
        robot = robot_at(endpoint)
        robot.wait_claims(1, 1)
        robot.wait_path()
        second, first = sorted(daemons, key=waits, reverse=True)
        heard, since = len(robot.paths.heard), Collector(begins=True)
        robot.session.declare_subscriber(f"{PREFIX}/path", since)
        first.process.send_signal(signal.SIGSTOP)
        robot.wait_claims(1)
        robot.wait_path(heard)
        # Before any path of its own it withdraws the other's.
        assert attached(since.heard[0])["reason"] == "this daemon plans from now on"
        first.process.send_signal(signal.SIGCONT)
        robot.wait_claims(1, 1)
        # Whichever goes on, the robot is left with a path to drive.
        until(lambda: attached(robot.paths.heard[-1])["steps"] > 0)
        assert second.process.poll() is None


def _stood_and_went_on(robot, before):
    goes = [attached(path)["steps"] > 0 for path in robot.paths.heard[before:]]
    return "0 steps then some" if False in goes and goes[-1] else ""


def test_after_a_partition_one_daemon_continues(tmp_path, robot_at):
    """Each had its own router and planned; then a router connects the two."""
    one, other = free_endpoint(), free_endpoint()
    with router_process(one), router_process(other), two_daemons(tmp_path, one, other) as daemons:
        robots = robot_at(one), robot_at(other)
        for robot in robots:
            robot.wait_claims(1)
            robot.wait_path()
        heard = [len(robot.paths.heard) for robot in robots]
        bridge = {"mode": "router", "connect": {"endpoints": [one, other]}}
        # By default it listens on 7447, which another test may have taken.
        bridge["listen"] = {"endpoints": [free_endpoint()]}
        bridge["scouting"] = {"multicast": {"enabled": False}}
        with zenoh.open(zenoh.Config.from_json5(json.dumps(bridge))):
            for robot, before in zip(robots, heard, strict=True):
                claims = robot.wait_claims(1, 1)
                # The robot is told to stand by one, and then where to go by the other, maybe
                # more than once: the path gets better while it stands.
                until(partial(_stood_and_went_on, robot, before))
            assert claims[min(claims)] is ClaimState.PLANS, "the smaller id goes on"
            assert sorted(map(waits, daemons)) == [False, True]
            # Who joins now gets one path, and it is one to drive.
            with Outsider(one) as late:
                receiver = late.listen("path")
                receiver.wait(lambda heard: True)
                time.sleep(0.5)
                assert [attached(path)["steps"] > 0 for path in receiver.heard] == [True]


def test_a_waiting_daemon_keeps_only_its_newest_maps(tmp_path):
    """Updates of all of a map, while it waits and while it loads: each was held."""
    side = 2000
    maps = {"max_pixels": side * side, "max_lattice_cells": 50_000}
    flood = Flood("updates", side, 0.05, 20.0)
    config = {"map": maps, "robot": {"tool_width_m": 1.0, "radius_m": 0.5}}
    with joined_daemon(tmp_path, executed=True, **config) as (running, outsider):
        claim = f"{PREFIX}/claim/0/plans"
        token = outsider.session.liveliness().declare_token(claim)
        outsider.wait_status(lambda status: status["state"] == "blocked")
        outsider.put("map", map_payload(flood, 0))
        for _ in range(60):
            outsider.put("map_update", update_payload(flood))
            time.sleep(0.02)
        outsider.ask_status()
        assert peak_mb(running.pid) < 88 + 9 * side * side / 1e6
        token.undeclare()
        outsider.put("pose", pose_bytes(20.0, 20.0))
        outsider.wait_status(lambda status: status["state"] == "covering")
        # Taken as it was held: no more maps than one.
        assert outsider.ask_status()["map"]["revision"] <= 2
        assert peak_mb(running.pid) < needed_bytes(convert(config, DaemonConfig)) / 1e6
