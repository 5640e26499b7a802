"""Daemons of one fleet on one router share a room; from one that is killed the other takes over."""

from __future__ import annotations

import contextlib
import signal
import time

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.bus.session import BusSettings, open_bus
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.replay.cycle_replay import CycleReplay, read_turns
from fasaco_edge.replay.replay import read_run
from tests.support.outsider import TIMEOUT_S, Outsider
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import TOOL_M, cells_of, coverable_cells, map_bytes, pose_bytes, room
from tests.wire import oracle

FLOOR = room(9.0, 6.0)
STARTS = {"r1": (0.75, 0.75), "r2": (8.25, 5.25)}
STEP_S = 0.05


class Robot:
    """Drives along the newest path, a cell at a time, as an outsider at its daemon's keys."""

    def __init__(self, router: str, name: str) -> None:
        self.seat = Outsider(router, name)
        self.path = self.seat.listen("path")
        self.at = np.array(STARTS[name])
        self.seen = 0
        self.ahead: list[np.ndarray] = []
        self.swept = set()
        self.seat.put("map", map_bytes(FLOOR))
        self.go()

    def go(self) -> None:
        """Drive to the next centre of a cell, and report the pose."""
        if len(self.path.heard) > self.seen:
            self.seen = len(self.path.heard)
            message = oracle.from_bytes("nav_msgs/msg/Path", self.path.heard[-1].payload)
            xy = [(pose.pose.position.x, pose.pose.position.y) for pose in message.poses]
            self.ahead = [np.array(point) for point in xy]
        while self.ahead and np.hypot(*(self.ahead[0] - self.at)) < 0.01:
            self.ahead.pop(0)
        if self.ahead:
            way = self.ahead[0] - self.at
            self.at = self.at + way * min(TOOL_M / np.hypot(*way), 1.0)
        self.swept.update(cells_of(self.at[None]))
        self.seat.put("pose", pose_bytes(*self.at))


@pytest.fixture
def router():
    endpoint = free_endpoint()
    with open_bus(BusSettings("router", (), (endpoint,))):
        yield endpoint


def test_two_daemons_share_a_room_and_one_takes_over_when_the_other_is_killed(router, tmp_path):
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
                )
            )
        robots = {name: Robot(router, name) for name in STARTS}
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
    assert (record.gap, replay.difference, replay.lacking) == ("", None, [])
    assert replay.mission.state == "done"
    assert replay.mission.shared.cells_of("r2") > 20
