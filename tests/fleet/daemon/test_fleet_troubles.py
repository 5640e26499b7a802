"""A clock an hour off, two daemons of one name, a router that restarts: the fleet goes on."""

from __future__ import annotations

import contextlib
import time

import pytest

from tests.campaigns.shifted_clock import ShiftedClock, why_not
from tests.fleet.robots import FleetRobot
from tests.support.outsider import TIMEOUT_S
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import coverable_cells, room
from tests.support.router import router_process

FLOOR = room(7.5, 5.1)
STARTS = {"r1": (0.75, 0.75), "r2": (6.75, 4.35)}
STEP_S, AWAY_S = 0.05, 2.0
HOUR_S = 3_600.0


def test_robots_share_a_room_despite_clocks_and_a_router_restart(tmp_path):
    if why := why_not():
        pytest.skip(why)
    endpoint = free_endpoint()
    clock = ShiftedClock(tmp_path)
    clock.shift(HOUR_S)
    with contextlib.ExitStack() as stack:
        router = stack.enter_context(router_process(endpoint))

        def start(name, folder, env=None):
            folder.mkdir()
            bus = {"mode": "client", "listen": [], "connect": [endpoint]}
            sections = {"bus": bus, "robot": {"name": name}, "fleet": {"name": "hall"}}
            return stack.enter_context(daemon_process(folder, env=env, **sections))

        start("r1", tmp_path / "r1")
        start("r2", tmp_path / "r2", clock.environment)
        robots = {name: FleetRobot(endpoint, name, FLOOR, at) for name, at in STARTS.items()}
        for robot in robots.values():
            stack.enter_context(robot.seat)
            robot.seat.wait_status(lambda status: status["state"] == "covering")
        deadline = time.monotonic() + TIMEOUT_S

        def drive_until(holds):
            while not holds():
                assert time.monotonic() < deadline, [newest(robot) for robot in robots.values()]
                for robot in robots.values():
                    robot.go()
                time.sleep(STEP_S)

        def newest(robot):
            return robot.seat.status.heard[-1].json()

        drive_until(lambda: min(len(robot.swept) for robot in robots.values()) > 15)
        for name, other in (("r1", "r2"), ("r2", "r1")):
            (member,) = newest(robots[name])["fleet"]["members"]
            assert (member["name"], member["away"]) == (other, None)
        # A second one of the name waits, and says nothing to the fleet.
        second = start("r1", tmp_path / "second")
        drive_until(lambda: "waits" in second.log_text() or "another" in second.log_text())
        router.kill()
        router.wait()
        time.sleep(AWAY_S)
        stack.enter_context(router_process(endpoint))
        drive_until(lambda: all(newest(robot)["state"] == "done" for robot in robots.values()))
        swept = [robot.swept for robot in robots.values()]
        assert swept[0] | swept[1] >= coverable_cells(FLOOR)
        for robot in robots.values():
            assert newest(robot)["errors"]["total"] == 0
            assert [one["name"] for one in newest(robot)["fleet"]["members"]] == [
                name for name in STARTS if name != robot.name
            ]
