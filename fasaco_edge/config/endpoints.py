"""Endpoints of the bus: their faults, and the computers that can reach them.

An endpoint is ``<protocol>/<address>[?<metadata>][#<configuration>]``.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Iterator, Sequence

from fasaco_edge.errors import BadConfiguration

# Sockets in the file system: a user with write permission there may connect.
UNIX = ("unixsock-stream", "unixpipe")
IP = ("tcp", "udp", "tls", "quic", "ws")


def protocol_of(endpoint: str) -> str:
    """Return the protocol, "" if there is none."""
    return endpoint.partition("/")[0] if "/" in endpoint else ""


def host_of(endpoint: str) -> str:
    """Return the host of an IP endpoint, without brackets; "" for none."""
    address = re.split(r"[?#]", endpoint.partition("/")[2])[0]
    host = address.rpartition(":")[0]
    return host[1:-1] if host.startswith("[") and host.endswith("]") else host


def is_local(endpoint: str) -> bool:
    """Return whether only this computer can reach an endpoint; False if uncertain.

    Names are not resolved; the only local name is ``localhost``.
    """
    protocol = protocol_of(endpoint)
    if protocol in UNIX:
        return True
    if protocol not in IP:
        return False
    host = host_of(endpoint)
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def from_here(endpoint: str) -> str:
    """Return the endpoint at which this computer reaches a listener at ``endpoint``."""
    host = host_of(endpoint)
    try:
        anywhere = ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return endpoint
    if not anywhere:
        return endpoint
    # Connect by the name ``localhost``, which a certificate may contain.
    shown = f"[{host}]" if ":" in host else host
    return endpoint.replace(f"/{shown}:", "/localhost:", 1)


# Further protocols of Zenoh, for users who build it with them.
DEVICES = ("serial", "vsock")
# Longest endpoint that Zenoh accepts [bytes].
MOST_BYTES = 255


def endpoint_faults(name: str, endpoints: Sequence[str]) -> Iterator[BadConfiguration]:
    """Yield the faults of a key's endpoints; Zenoh would only report that none of them answers."""
    for index, endpoint in enumerate(endpoints):
        if why := _why_none(endpoint):
            yield BadConfiguration(
                f"{endpoint!r}: {why}",
                key=f"{name}[{index}]",
                hint="an endpoint is <protocol>/<address>, as tcp/192.168.1.5:7447",
            )


def _why_none(endpoint: str) -> str:
    """Return why a text is not an endpoint; "" if it is an endpoint."""
    protocol, address = protocol_of(endpoint), re.split(r"[?#]", endpoint.partition("/")[2])[0]
    known = (*IP, *UNIX, *DEVICES)
    if protocol not in known:
        of_these = f"the protocol must be one of {', '.join(known)}"
        return f"{of_these}, got {protocol!r}" if protocol else "no protocol before the address"
    if not address:
        return f"no address after {protocol}/"
    if endpoint.endswith(("?", "#")):
        return f"nothing after {endpoint[-1]}"
    if (length := len(endpoint.encode(errors="replace"))) > MOST_BYTES:
        return f"it may have at most {MOST_BYTES} bytes, got {length}"
    return _why_no_socket(address) if protocol in IP else ""


def _why_no_socket(address: str) -> str:
    host, _, port = address.rpartition(":")
    if re.search(r"[\s\0]", address):
        return "a space in the address"
    if not host:
        return "the address must be <host>:<port>"
    # A system chooses a port for 0, which no other program knows.
    if not re.fullmatch(r"[0-9]{1,5}", port) or not 0 < int(port) < 1 << 16:
        return f"the port must be a number from 1 to 65535, got {port!r}"
    if ":" in host and not (host.startswith("[") and host.endswith("]")):
        return f"an IPv6 address stands in brackets, as [{host}]:{port}"
    return ""
