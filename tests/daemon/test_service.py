"""The daemon under a service manager: what it is told, and what SIGHUP does. No systemd needed."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import yaml
from PIL import Image

from tests.support.outsider import Outsider
from tests.support.processes import Daemon, daemon_process
from tests.support.rooms import map_bytes, pillared_room, pose_bytes, show_room, two_rooms
from tests.support.service_manager import Manager

WATCHDOG_S = 1.0


@contextmanager
def service(folder: Path, *, env=None, **sections) -> Iterator[tuple[Daemon, Manager]]:
    manager = Manager(folder)
    told = {"NOTIFY_SOCKET": manager.address, "WATCHDOG_USEC": str(int(1e6 * WATCHDOG_S))}
    try:
        with daemon_process(folder, env=told | (env or {}), **sections) as running:
            manager.wait("READY=1")
            yield running, manager
    finally:
        manager.close()


def test_ready_means_a_token_and_compiled_kernels(tmp_path):
    with service(tmp_path) as (running, manager), Outsider(running.endpoint) as outsider:
        assert outsider.alive()
        path = outsider.listen("path")
        show_room(outsider, pillared_room(), 1.0, 1.0)
        path.wait(lambda heard: len(heard.payload) > 100)
        manager.wait("STATUS=covering")
        running.stop()
        manager.wait("STOPPING=1")


def test_the_watchdog_is_fed_until_the_process_stands_still(tmp_path):
    with service(tmp_path) as (running, manager):
        began = time.monotonic()
        for _ in range(5):
            manager.wait("WATCHDOG=1")
        assert time.monotonic() - began > 0.8, "four times in a second, no more"
        os.kill(running.pid, signal.SIGSTOP)
        time.sleep(0.3)
        assert manager.count("WATCHDOG=1", 1.0) == 0
        os.kill(running.pid, signal.SIGCONT)
        before = manager.said.count("WATCHDOG=1")
        while manager.said.count("WATCHDOG=1") == before:
            manager.wait("WATCHDOG=1")


def rewritten(running: Daemon, **sections) -> None:
    (file,) = running.log.parent.glob("daemon0.yaml")
    before = yaml.safe_load(file.read_text())
    after = {**before, **{k: before.get(k, {}) | v for k, v in sections.items()}}
    file.write_text(yaml.safe_dump(after))
    running.process.send_signal(signal.SIGHUP)


def test_a_reload_is_announced_takes_effect_and_keeps_troubles(tmp_path):
    mission = {"lost_pose_s": 0.5}
    with (
        service(tmp_path, mission=mission) as (running, manager),
        Outsider(running.endpoint) as outsider,
    ):

        def since_s(status):
            return sum(one["since_s"] for one in status["troubles"] if one["code"] == "no_pose")

        show_room(outsider, pillared_room(), 1.0, 1.0)
        before = outsider.wait_status(lambda status: since_s(status) > 1.0)
        rewritten(running, planner={"seed": 7})
        assert "\nMONOTONIC_USEC=" in manager.wait("RELOADING=1")
        manager.wait("READY=1")
        assert outsider.ask("@rpc/config").json()["planner"]["seed"] == 7
        after = outsider.wait_status(
            lambda status: status["config"]["planner"]["seed"] == 7 and since_s(status)
        )
        assert since_s(after) > since_s(before)
        assert after["errors"]["total"] == 0


def test_a_large_mask_is_read_beside_the_loop(tmp_path):
    """Commands are carried out meanwhile, and maps wait: they are decoded in the same memory."""
    mask = Image.new("L", (6000, 6000), 254)
    mask.paste(0, (0, 0, 6000, 100))
    mask.save(tmp_path / "mask.png")
    text = "image: mask.png\nresolution: 0.05\norigin: [0, 50, 0]\nnegate: 0\n"
    (tmp_path / "mask.yaml").write_text(text)
    with service(tmp_path) as (running, manager), Outsider(running.endpoint) as outsider:
        show_room(outsider, pillared_room(), 1.0, 1.0)
        outsider.wait_status(lambda status: status["path"])
        rewritten(running, mission={"keep_out_mask": "mask.yaml"})
        manager.wait("RELOADING=1")
        said = len(manager.said)
        pause = json.dumps({"command": "pause"})
        (reply,) = outsider.session.get(f"{outsider.prefix}/@rpc/mission", payload=pause)
        assert json.loads(reply.ok.payload.to_bytes())["state"] == "paused"
        assert "READY=1" not in manager.said[said:]
        outsider.put("map", map_bytes(two_rooms(door=True)))
        manager.wait("READY=1")
        config = outsider.ask("@rpc/config").json()
        assert config["mission"]["keep_out_mask"].startswith("mask:")
        rows, _ = two_rooms(door=True).shape
        status = outsider.wait_status(lambda status: (status["map"] or {}).get("rows") == rows)
        assert status["state"] == "paused"
        assert status["errors"]["total"] == 0


def test_a_wrong_file_changes_nothing(tmp_path):
    with service(tmp_path) as (running, manager), Outsider(running.endpoint) as outsider:
        show_room(outsider, pillared_room(), 1.0, 1.0)
        outsider.wait_status(lambda status: status["path"])
        before = outsider.ask("@rpc/config").json()
        rewritten(running, planner={"ants": "many"})
        manager.wait("READY=1")
        assert "planner.ants" in manager.wait("STATUS=")
        status = outsider.wait_status(lambda status: status["errors"]["total"])
        assert status["errors"]["by_code"] == {"bad_configuration": 1}
        assert outsider.ask("@rpc/config").json() == before
        rewritten(running, planner={"ants": 200})
        manager.wait("READY=1")
        assert "refused" not in manager.wait("STATUS=")


def test_a_daemon_waiting_for_another_reloads_its_configuration(tmp_path):
    """It had begun to load for a latched map when it saw the other, and never said it was done."""
    with service(tmp_path) as (running, manager), Outsider(running.endpoint) as outsider:
        outsider.put("map", map_bytes(pillared_room()))
        claim = f"{outsider.prefix}/claim/0/plans"
        token = outsider.session.liveliness().declare_token(claim)
        outsider.wait_status(lambda status: status["state"] == "blocked")
        rewritten(running, planner={"seed": 7})
        manager.wait("RELOADING=1")
        manager.wait("READY=1")
        token.undeclare()
        outsider.put("pose", pose_bytes(1.0, 1.0))
        status = outsider.wait_status(lambda status: status["state"] == "covering")
        assert status["config"]["planner"]["seed"] == 7


def test_without_a_service_manager_a_closed_terminal_ends_it(tmp_path):
    with daemon_process(tmp_path) as running:
        with Outsider(running.endpoint) as outsider:
            outsider.ask_status()
        running.process.send_signal(signal.SIGHUP)
        assert running.process.wait(60.0) == -signal.SIGHUP
        running.process.returncode = 0
