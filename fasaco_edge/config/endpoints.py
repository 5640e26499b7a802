"""Zenoh endpoints: their parts, and from where they can be reached.

An endpoint is ``<protocol>/<address>[?<metadata>][#<configuration>]``.
"""

from __future__ import annotations

import ipaddress
import re

# Sockets in the file system: who may write there, may connect.
UNIX = ("unixsock-stream", "unixpipe")
IP = ("tcp", "udp", "tls", "quic", "ws")


def protocol_of(endpoint: str) -> str:
    """Return the protocol, "" where there is none."""
    return endpoint.partition("/")[0] if "/" in endpoint else ""


def host_of(endpoint: str) -> str:
    """Return the host of an IP endpoint, without brackets; "" where none can be made out."""
    address = re.split(r"[?#]", endpoint.partition("/")[2])[0]
    host = address.rpartition(":")[0]
    return host[1:-1] if host.startswith("[") and host.endswith("]") else host


def is_local(endpoint: str) -> bool:
    """Tell whether only this computer can reach an endpoint; False where that is not certain.

    Names are not resolved: any but ``localhost`` may stand for any address.
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
    """Return the endpoint at which this computer reaches what listens at ``endpoint``."""
    host = host_of(endpoint)
    try:
        anywhere = ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return endpoint
    if not anywhere:
        return endpoint
    # By a name, which a certificate may hold.
    shown = f"[{host}]" if ":" in host else host
    return endpoint.replace(f"/{shown}:", "/localhost:", 1)
