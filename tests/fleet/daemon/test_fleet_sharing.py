"""Daemons of one fleet share a room, an hour apart by their clocks; one takes over from another."""

from __future__ import annotations

import contextlib
import signal
import time

import pytest

pytest.importorskip("rerun")

from fasaco_edge.bus.session import BusSettings, open_bus
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.replay.cycle_replay import CycleReplay, read_turns
from fasaco_edge.replay.replay import read_run
from tests.campaigns.shifted_clock import ShiftedClock, why_not
from tests.fleet.robots import FleetRobot
from tests.support.outsider import TIMEOUT_S
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import coverable_cells, room

FLOOR = room(9.0, 6.0)
STARTS = {"r1": (0.75, 0.75), "r2": (8.25, 5.25)}
STEP_S = 0.05
HOUR_S = 3_600.0


@pytest.fixture
def router():
    endpoint = free_endpoint()
    with open_bus(BusSettings("router", (), (endpoint,))):
        yield endpoint


def test_a_daemon_takes_over_the_room_when_the_other_is_killed(router, tmp_path):
    if why := why_not():
        pytest.skip(why)
    clock = ShiftedClock(tmp_path)
    clock.shift(HOUR_S)
    with contextlib.ExitStack() as stack:
        daemons = {}
        for name in STARTS:
            (tmp_path / name).mkdir()
            daemons[name] = stack.enter_context(
                daemon_process(
                    tmp_path / name,
                    *(["--record", str(tmp_path / "runs")] if name == "r1" else []),
                    bus={"mode": "client", "listen": [], "connect": [router]},
                    robot={"name": name},
                    fleet={"name": "hall"},
                    env=clock.environment if name == "r2" else None,
                )
            )
        robots = {name: FleetRobot(router, name, FLOOR, at) for name, at in STARTS.items()}
        for robot in robots.values():
            stack.enter_context(robot.seat)
            robot.seat.wait_status(lambda status: status["state"] == "covering")
        first = robots["r1"]
        first.seat.wait_status(lambda s: (s["recorder"] or {}).get("state") == "recording")
        deadline = time.monotonic() + TIMEOUT_S
        other = robots["r2"]
        while len(other.swept) < 40:
            assert time.monotonic() < deadline
            for robot in robots.values():
                robot.go()
            time.sleep(STEP_S)
        told = first.seat.wait_status(
            lambda status: (
                bool(status["fleet"]["part_cells"])
                and status["fleet"]["members"][0]["swept_cells"] > 20
            )
        )
        assert [member["name"] for member in told["fleet"]["members"]] == ["r2"]
        assert len(first.swept & other.swept) < 30
        daemons["r2"].process.send_signal(signal.SIGKILL)
        is_gone = False
        while (status := first.seat.status.heard[-1].json())["state"] != "done":
            assert time.monotonic() < deadline, status
            is_gone |= status["fleet"]["members"][0]["away"] == "gone"
            first.go()
            time.sleep(STEP_S)
        assert is_gone
        assert first.swept | other.swept >= coverable_cells(FLOOR)
        assert status["fleet"]["part_cells"] is None
        assert status["errors"]["total"] == 0
    # What the other said is an input like any other.
    samples = list(RecordedSamples(sorted((tmp_path / "runs").glob("*.rrd"))))
    record = read_turns(samples)
    replay = CycleReplay(read_run(samples).daemon_config(), record)
    for _ in replay.steps(samples):
        pass
    assert (record.gap, replay.difference) == ("", None)
    assert replay.mission.state == "done"
    assert replay.mission.covered.shared.cells_of("r2") > 20
