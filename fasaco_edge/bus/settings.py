"""Settings of a session on the Zenoh bus, and the Zenoh configuration made from them.

The same for every process:

* no multicast scouting and no shared memory: a session reaches only configured endpoints, and an
  idle session stays small;
* each topic has its QoS, see ``wire.topics``: samples that a daemon publishes are dropped on
  congestion, so that a frozen subscriber never blocks the daemon.
"""

from __future__ import annotations

import json
import re
import socket
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fasaco_edge.bus import DEFAULT_ENDPOINT
from fasaco_edge.errors import BusUnavailable
from fasaco_edge.wire.limits import MAX_MESSAGE_BYTES

if TYPE_CHECKING:
    import zenoh

# Timeout of the handshake of an incoming connection [ms]; largest number of pending handshakes.
ACCEPT_TIMEOUT_MS, ACCEPT_PENDING = 3000, 1000
# Beginning of the message that no endpoint was reached.
NO_CONNECTION = "cannot connect to "
# Timeout of a connection that shows whether a program listens at an endpoint [s].
PROBE_S = 1.0
# Length of the queues [packets of 64 kB]. A map or a path has many packets, and with Zenoh's
# default of two it is lost if the computer is busy for 50 ms. These queues take a megabyte, only
# while needed.
QUEUED_BATCHES = dict.fromkeys(
    ("interactive_high", "data_high", "data", "data_low", "background"), 16
)


@dataclass(frozen=True, slots=True)
class BusSettings:
    """Settings of a session.

    Attributes:
        mode: "peer", "client" or "router".
        connect: endpoints to connect to.
        listen: endpoints to listen on. If another process listens there already, the session
            connects to it instead, unless the session is secured.
        secured: authentication and access rules, a part of Zenoh's configuration, see
            ``bus.access``. It may hold a password, and is never shown.
    """

    mode: str = "client"
    connect: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    listen: tuple[str, ...] = ()
    secured: Mapping[str, Any] = field(default_factory=dict, repr=False)


def check_settings(settings: BusSettings) -> None:
    """Check the configuration of a session without opening it.

    Raises:
        BusUnavailable: Zenoh rejects it.
    """
    # Imported here, as a process that only reads a configuration does not need it.
    import zenoh  # noqa: PLC0415

    try:
        session_config(settings)
    except zenoh.ZError as error:
        raise BusUnavailable(first_line(error)) from error


def session_config(settings: BusSettings) -> zenoh.Config:
    """Return Zenoh's configuration of a session: the common part, and ``secured``.

    Raises:
        zenoh.ZError: it has unknown keys or impossible values.
    """
    import zenoh  # noqa: PLC0415

    is_client = settings.mode == "client"
    own = {
        "mode": settings.mode,
        "connect": {
            "endpoints": list(settings.connect),
            # A client without its router fails at once; a peer keeps trying.
            "timeout_ms": 0 if is_client else -1,
            "exit_on_failure": is_client,
            "retry": {"period_init_ms": 200, "period_max_ms": 1000},
        },
        "listen": {"endpoints": list(settings.listen)},
        "scouting": {"multicast": {"enabled": False}},
        # Advanced publishers need timestamps for their cache.
        "timestamping": {"enabled": True},
        "transport": {
            "shared_memory": {"enabled": False},
            # With Zenoh's defaults, a hundred connections without a handshake block all others for
            # twelve seconds.
            "unicast": {"accept_timeout": ACCEPT_TIMEOUT_MS, "accept_pending": ACCEPT_PENDING},
            "link": {
                "rx": {"max_message_size": MAX_MESSAGE_BYTES},
                "tx": {"queue": {"size": QUEUED_BATCHES}},
            },
        },
    }
    return zenoh.Config.from_json5(json.dumps(_merged(own, settings.secured)))


def _merged(own: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(own)
    for key, value in more.items():
        before = own.get(key)
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            merged[key] = _merged(before, value)
        else:
            merged[key] = value
    return merged


def first_line(error: Exception) -> str:
    """Return Zenoh's error message without the location in its sources, in plain words."""
    said = str(error).partition(" at /")[0].strip()
    if (match := re.fullmatch(r"Unable to connect to any of \[(.*)\]!", said)) is None:
        return said
    return NO_CONNECTION + re.sub(r"Single\((.*?)\)", r"\1", match[1])


def unavailable(error: Exception, endpoints: Iterable[str]) -> BusUnavailable:
    """Return the error of a session that cannot be opened with Zenoh's ``error``.

    Zenoh says the same whether nothing listens or a program there opens no session.
    """
    said = first_line(error)
    for endpoint in endpoints if said.startswith(NO_CONNECTION) else ():
        if _is_accepted(endpoint):
            return BusUnavailable(
                said,
                hint=f"a program listens at {endpoint}, but opens no session: it hangs, is not on "
                "a Zenoh bus, or requires other credentials (bus.security, --security)",
            )
    return BusUnavailable(said)


def _is_accepted(endpoint: str) -> bool:
    """Return whether a TCP connection to an endpoint is accepted."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = re.split("[?#]", address)[0].rpartition(":")
    if protocol not in ("tcp", "tls", "ws") or not port.isdecimal():
        return False
    try:
        socket.create_connection((host.strip("[]"), int(port)), PROBE_S).close()
    except (OSError, UnicodeError, OverflowError):
        return False
    return True
