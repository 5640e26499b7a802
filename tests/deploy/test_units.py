"""The units: accepted without a word, shut in, and each exception still needed."""

from __future__ import annotations

import re

import pytest

from tests.deploy.lab import Lab
from tests.deploy.service import UNITS, Service, wait_for

NAMES = ("fasaco-edge", "fasaco-edge-recorder", "fasaco-edge-follow")
MOST_EXPOSED = 1.3
# What `fasaco-edge run` does first, under the unit's own rules and one more.
PYTHON = "/opt/fasaco-edge/current/bin/python3"
IMPORT = f"{PYTHON} -c 'import fasaco_edge.kernels.jit'"
FACES = f"{PYTHON} -c 'from socket import *; socket(AF_NETLINK, SOCK_RAW)'"


@pytest.mark.parametrize("name", NAMES)
def test_systemd_finds_nothing_to_say(lab: Lab, name):
    """It ends with 0 whatever it finds: an unknown key is a line, and ignored ever after."""
    Service(lab, name)
    done = lab.run("systemd-analyze", "verify", f"{name}.service")
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.parametrize("name", NAMES)
def test_the_unit_is_shut_in(lab: Lab, name):
    Service(lab, name)
    said = lab.run("systemd-analyze", "security", "--offline=true", f"{name}.service").stdout
    exposure = re.search(r"exposure level for \S+: ([\d.]+)", said)
    assert exposure is not None
    print(f"{name}: exposure {exposure[1]}")
    assert float(exposure[1]) <= MOST_EXPOSED


@pytest.mark.parametrize("path", sorted((UNITS / "drop-ins").glob("*.conf")), ids=lambda p: p.stem)
def test_systemd_finds_nothing_to_say_of_a_drop_in(service: Service, path):
    service.drop_in(path.stem, path.read_text())
    done = service.lab.run("systemd-analyze", "verify", "fasaco-edge.service")
    assert (done.stdout, done.stderr) == ("", "")


def once(service: Service, command: str, rule: str) -> tuple[str, str]:
    """Run ``command`` in place of the service, under one more rule; return how it ended."""
    service.drop_in(
        "once", f"[Service]\nType=oneshot\nRestart=no\nExecStart=\nExecStart={command}\n{rule}\n"
    )
    service.lab.run("systemctl", "start", service.name, check=False)
    return service.show("Result"), service.text()


def test_the_compiler_needs_memory_that_is_written_and_run(service: Service):
    """Once this fails, MemoryDenyWriteExecute= can be set."""
    result, said = once(service, IMPORT, "MemoryDenyWriteExecute=yes")
    assert result == "exit-code", said


def test_the_compiler_runs_under_the_unit_as_it_is(service: Service):
    result, said = once(service, IMPORT, "")
    assert result == "success", said


def test_zenoh_finds_interfaces_by_netlink(service: Service):
    """Without it nobody is found by multicast, and a warning is all that is said."""
    assert once(service, FACES, "")[0] == "success"
    result, said = once(service, FACES, "RestrictAddressFamilies=\nRestrictAddressFamilies=AF_UNIX")
    assert result == "exit-code", said
    assert "Address family not supported" in said


def test_the_follower_has_priority_and_restarts_with_the_daemon(service: Service):
    follower = Service(service.lab, "fasaco-edge-follow")
    try:
        service.start()
        follower.start()
        # The daemon begins with an empty path.
        stands = "standing, stopped by an empty path"
        wait_for(lambda: stands in follower.text(), 10.0, "what it stands for")
        before, stat = follower.pid, service.lab.run("cat", f"/proc/{follower.pid}/stat").stdout
        assert stat.rpartition(")")[2].split()[16] == "-10"
        service.lab.run("systemctl", "restart", "fasaco-edge")
        wait_for(lambda: follower.pid not in (0, before), 10.0, "the follower to start anew")
        assert follower.show("NRestarts") == "0"
    finally:
        follower.remove()
        service.lab.run("rm", "/etc/systemd/system/fasaco-edge-follow.service")
