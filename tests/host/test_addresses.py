"""Addresses that are shown to people."""

import pytest

from fasaco_edge.host.addresses import Address


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_a_wildcard_address_is_shown_as_a_reachable_one(host):
    shown = Address(host, 8465).reached
    assert shown.endswith(":8465")
    assert shown not in (f"{host}:8465", f"[{host}]:8465")


@pytest.mark.parametrize(("host", "shown"), [("127.0.0.1", "127.0.0.1:1"), ("::1", "[::1]:1")])
def test_a_given_address_stays(host, shown):
    assert Address(host, 1).reached == shown
