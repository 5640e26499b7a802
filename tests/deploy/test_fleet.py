"""Two daemons of a fleet under systemd on one router: one is killed, and joins again."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest

from tests.deploy.lab import ENVIRONMENT, Lab
from tests.deploy.service import QUIET, UNITS, Service, wait_for

ROUTER = "tcp/127.0.0.1:17447"
PYTHON = "/opt/fasaco-edge/current/bin/python3"
# Units that share the cache of compiled kernels have one user.
DROP_IN = "[Service]\nUser=fasaco-edge\nRestartSec=200ms\n"
STARTS = {"r1": "2.0,-2.4", "r2": "6.45,3.45"}


@pytest.fixture
def services(lab: Lab) -> Iterator[dict[str, Service]]:
    unit, found = (UNITS / "fasaco-edge.service").read_text(), {}
    with ExitStack() as stack:
        for name in STARTS:
            config = f"/etc/fasaco-edge/{name}.yaml"
            bus = {"mode": "client", "listen": [], "connect": [ROUTER]}
            sections = QUIET | {"robot": {"name": name}, "bus": bus, "fleet": {"name": "flat"}}
            lab.write(config, json.dumps(sections))
            text = unit.replace("/etc/fasaco-edge/config.yaml", config)
            # systemd removes this folder when a unit ends.
            text = text.replace("RuntimeDirectory=fasaco-edge", f"RuntimeDirectory=fasaco-{name}")
            found[name] = Service(lab, f"fasaco-edge-{name}", text)
            stack.callback(found[name].remove)
            stack.callback(lab.run, "rm", "-rf", "/var/lib/private/fasaco-edge")
            found[name].drop_in("fleet", DROP_IN)
        yield found


@contextmanager
def running(lab: Lab, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a program inside as long as this lasts."""
    with subprocess.Popen(
        lab.words(*words), env=ENVIRONMENT, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            process.terminate()
            process.wait(10.0)


def ask(lab: Lab, robot: str) -> dict[str, Any]:
    """Return the status of a robot; nothing while its daemon does not answer."""
    words = ("fasaco-edge", "ask", "status", "--json", "--robot", robot, "--connect", ROUTER)
    asked = lab.run(*words, check=False)
    answer: dict[str, Any] = json.loads(asked.stdout) if asked.returncode == 0 else {}
    return answer


def has_part(status: dict[str, Any]) -> bool:
    """Return whether a robot has a part of the floor."""
    return bool(status) and bool(status["fleet"]["part_cells"])


def has_progress(status: dict[str, Any]) -> bool:
    return bool(status) and status["ledger"]["age_s"] is not None


def is_joined(status: dict[str, Any]) -> bool:
    """Return whether a robot has another member's messages of just now."""
    members = status["fleet"]["members"] if status else ()
    return bool(members) and members[0]["heard_s"] < 1.5


def shares_and_drives(status: dict[str, Any]) -> bool:
    """Return whether a robot works on a part, or is done, and knows what the other has swept."""
    if not status or not status["fleet"]["members"]:
        return False
    fleet = status["fleet"]
    is_at_work = status["state"] == "done" or bool(fleet["part_cells"])
    return is_at_work and fleet["members"][0]["swept_cells"] > 0


def test_two_units_share_a_flat_and_a_killed_one_rejoins(
    lab: Lab, services: dict[str, Service]
) -> None:
    with ExitStack() as stack:
        router = stack.enter_context(running(lab, PYTHON, "-m", "tests.support.router", ROUTER))
        assert router.stdout is not None
        assert router.stdout.readline() == b"up\n"
        for name, service in services.items():
            service.start()
            words = ("simulate", "flat", "--speed", "20", f"--start-xy={STARTS[name]}")
            stack.enter_context(
                running(lab, "fasaco-edge", *words, "--robot", name, "--connect", ROUTER)
            )
        first, second = services.values()
        wait_for(lambda: has_part(ask(lab, "r1")), 20.0, "a part")
        wait_for(lambda: has_progress(ask(lab, "r2")), 20.0, "progress on disk")
        before = second.pid
        second.signal("KILL")
        wait_for(lambda: second.pid not in (0, before), 10.0, "another process")
        wait_for(lambda: is_joined(ask(lab, "r1")), 10.0, "joined")
        # Whether a fleet sweeps all after a kill, tests.campaigns.fleet_kills finds out.
        for name in STARTS:
            wait_for(lambda name=name: shares_and_drives(ask(lab, name)), 60.0, "one division")
        divisions = {name: ask(lab, name)["fleet"]["division"] for name in STARTS}
        assert None not in divisions.values()
        assert (first.show("NRestarts"), second.show("NRestarts")) == ("0", "1")
