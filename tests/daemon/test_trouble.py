"""A trouble of a robot at rest, wherever it is looked for."""

from __future__ import annotations

import urllib.request
from dataclasses import dataclass

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.security import BusConfig
from fasaco_edge.daemon.ledger.writer import LedgerKeeper, NoDisk
from fasaco_edge.daemon.loop.inbox import make_mailbox
from fasaco_edge.daemon.loop.mission_runner import MissionRunner
from fasaco_edge.daemon.loop.status import BEGUN_S, StatusBoard
from fasaco_edge.doctor import session
from fasaco_edge.doctor.finding import CheckContext, Level
from fasaco_edge.mission.work.idle_places import PERIOD_S as LOOK_S
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.wire.messages.battery import BatteryState, encode_battery
from fasaco_edge.wire.schemas import BATTERY_STATE
from tests.mission.test_idle_places import FAR, drive_with, in_or_beside
from tests.serve.serving import looking, served
from tests.support.outsider import TIMEOUT_S, Outsider
from tests.support.processes import daemon_process, fasaco_edge, free_endpoint
from tests.support.rooms import room, show_room
from tests.support.ros_robot import DIAGNOSTICS, Naming, ros_robot
from tests.support.waiting import meanwhile
from tests.wire import oracle

DOCK = {"x_m": 0.75, "y_m": 0.75, "yaw_deg": 0.0, "approach_m": 0.0}
PERIOD_S = 0.2
OPENER = urllib.request.build_opener(urllib.request.ProxyHandler({}))


@dataclass
class Battery:
    outsider: Outsider
    level: float = 0.18
    step: float = 0.0

    def publish(self) -> None:
        self.level = min(max(self.level + self.step, 0.05), 1.0)
        payload = encode_battery(BatteryState(self.level, "charging"))
        self.outsider.put("battery", payload, BATTERY_STATE)

    def on(self):
        return meanwhile(self.publish, PERIOD_S)


def codes(status):
    return [trouble["code"] for trouble in status["troubles"]]


def test_all_outputs_report_a_dead_dock(tmp_path):
    figures = free_endpoint().removeprefix("tcp/")
    with (
        daemon_process(
            tmp_path,
            mission={"dock": DOCK},
            battery={"silent_s": 10.0},
            metrics={"listen": figures},
            ros2={"kind": "bridge"},
        ) as daemon,
        Outsider(daemon.endpoint) as outsider,
        ros_robot(daemon.endpoint, Naming(None)) as robot,
        served(tmp_path, daemon.endpoint) as page,
        looking(page) as looker,
    ):
        diagnostics = robot.listen("diagnostics", DIAGNOSTICS)
        show_room(outsider, room(3.0, 3.0), 0.75, 0.75)
        battery = Battery(outsider)
        with battery.on():
            status = outsider.wait_status(lambda status: status["state"] == "charging")
            assert codes(status) == []
            battery.step = -0.002
            status = outsider.wait_status(lambda status: bool(status["troubles"]))
            (trouble,) = status["troubles"]
            assert (status["state"], trouble["code"]) == ("charging", "no_current")
            assert trouble["text"].startswith("in the dock the battery, at 1")
            assert "does not charge: its level falls, from 18 % to 1" in trouble["text"]
            assert trouble["do"].startswith("check the dock's power and contacts")
            with OPENER.open(f"http://{figures}/metrics", timeout=TIMEOUT_S) as answer:
                lines = answer.read().decode().splitlines()
            assert 'fasaco_edge_trouble{code="no_current"} 1' in lines
            assert 'fasaco_edge_trouble{code="no_pose"} 0' in lines
            assert 'fasaco_edge_state{state="charging"} 1' in lines
            shown = fasaco_edge("watch", "--once", "--connect", daemon.endpoint).out
            assert "CHARGING  IN TROUBLE" in shown
            assert "trouble" in shown
            bus = BusConfig(listen=(daemon.endpoint,))
            examined = session.peers(CheckContext(DaemonConfig(bus=bus)))
            assert examined.level is Level.WARN
            assert "does not charge" in examined.found
            digest = looker.wait("state", lambda seen: seen.get("look") == "bad")
            assert digest["state"] == "charging"
            assert any("does not charge" in fault for fault in digest["faults"])
            told = diagnostics.wait(lambda heard: b"does not charge" in heard.payload)
            (one,) = oracle.from_bytes(DIAGNOSTICS, told.payload).status
            assert (one.level, one.message.partition(":")[0]) == (1, "charging")
        silent = outsider.wait_status(lambda status: codes(status) == ["no_battery"])
        assert silent["state"] == "charging"
        battery.step = 0.005
        with battery.on():
            outsider.wait_status(lambda status: not status["troubles"])
            looker.wait("state", lambda seen: seen.get("look") == "go")
    assert "does not charge: its level falls" in daemon.log_text()


def before_a_mission():
    config = DaemonConfig()
    keeper = LedgerKeeper(NoDisk(), config.cell_m, autostart=True)
    return StatusBoard(config), MissionRunner(config, keeper, make_mailbox(100)), keeper


def test_a_mission_that_cannot_begin_is_a_trouble_until_it_does():
    board, runner, keeper = before_a_mission()
    assert board.due(runner, 0.0).troubles == ()
    (trouble,) = board.due(runner, BEGUN_S + 1.0).troubles
    assert (trouble.code, trouble.since_s) == ("not_begun", 1.0)
    assert trouble.text == "the mission cannot begin: no map yet"
    keeper.order_state = OrderState.idle("no order yet")
    assert board.due(runner, BEGUN_S + 2.0).troubles == ()


def test_a_keep_out_beside_the_map_is_reported_without_a_stop():
    board, runner, _ = before_a_mission()
    drive = drive_with(keep_out=(FAR,))
    runner.mission = drive.mission
    status = board.due(runner, drive.now + LOOK_S)
    (trouble,) = status.troubles
    assert (trouble.code, trouble.text) == ("no_effect", in_or_beside("mission.keep_out[0]"))
    assert status.state != "blocked"
