"""deploy/drop-ins/addresses.conf: whoever is not on the list is not even heard."""

from __future__ import annotations

import pytest

from tests.deploy.service import UNITS, Service

LISTED, OTHER = "192.168.10.7", "10.20.30.40"


def answers(service: Service, address: str) -> bool:
    words = ("fasaco-edge", "ask", "status", "--connect", f"tcp/{address}:7447", "--timeout", "2")
    return service.lab.run(*words, check=False).returncode == 0


@pytest.fixture
def open_service(service: Service):
    """A daemon that listens on two more addresses of this computer, to everyone."""
    for address in (LISTED, OTHER):
        service.lab.run("ip", "address", "replace", f"{address}/32", "dev", "lo")
    listen = [f"tcp/{address}:7447" for address in ("127.0.0.1", LISTED, OTHER)]
    service.configure(bus={"listen": listen, "open_to_everyone": True})
    service.drop_in("addresses", (UNITS / "drop-ins/addresses.conf").read_text())
    return service


def test_the_list_holds(open_service: Service):
    open_service.start()
    assert answers(open_service, "127.0.0.1")
    assert answers(open_service, LISTED)
    if answers(open_service, OTHER):
        pytest.skip("this kernel does not hold IPAddressDeny=: it needs cgroup v2 with BPF")
    open_service.drop_in("addresses", "")
    open_service.lab.run("systemctl", "restart", open_service.name)
    assert answers(open_service, OTHER), "it was the list, and nothing else"
