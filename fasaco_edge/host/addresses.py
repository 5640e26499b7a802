"""Addresses of this package's servers."""

from __future__ import annotations

import ipaddress
import re
import socket
from typing import NamedTuple

from fasaco_edge.errors import BadConfiguration

_ADDRESS = re.compile(r"(?:\[(?P<six>[0-9a-fA-F:]+)\]|(?P<four>[\w.]+)):(?P<port>\d{1,5})")

# Addresses for documentation (RFC 5737, RFC 3849), which no host has.
_ELSEWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}


class Address(NamedTuple):
    """Address of a server: host, an address as text, and port."""

    host: str
    port: int

    @property
    def is_loopback(self) -> bool:
        """Whether only this computer can reach it."""
        return ipaddress.ip_address(self.host).is_loopback

    @property
    def shown(self) -> str:
        """The address as in a URL."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{host}:{self.port}"

    @property
    def reached(self) -> str:
        """The address as in a URL for other computers; a wildcard becomes this computer's own."""
        if not ipaddress.ip_address(self.host).is_unspecified:
            return self.shown
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            try:
                # Sends nothing: the system only selects the address to send from.
                probe.connect((_ELSEWHERE[family], 9))
                host = probe.getsockname()[0]
            except OSError:  # no network
                host = socket.gethostname()
        return Address(host, self.port).shown


def read_address(name: str, text: str, example: int) -> Address:
    """Return the address in ``text``, the value of a key or option; localhost is 127.0.0.1.

    Raises:
        BadConfiguration: it is not an address with a port.
    """
    found = _ADDRESS.fullmatch(text)
    wrong = BadConfiguration(
        f"must be an address and a port, as 127.0.0.1:{example} or [::1]:{example}, got {text!r}",
        key=name,
    )
    if found is None or not 0 < int(found["port"]) < 1 << 16:
        raise wrong
    host = found["six"] or found["four"]
    host = "127.0.0.1" if host == "localhost" else host
    try:
        ipaddress.ip_address(host)
    except ValueError as error:
        raise wrong from error
    return Address(host, int(found["port"]))


def free_port() -> int:
    """Return a port of this computer's loopback that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
