"""Zenoh configuration of a session: what all have in common, and what secures one."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import zenoh

from fasaco_edge.wire.limits import MAX_MESSAGE_BYTES

# Timeout of the handshake of an incoming connection [ms], and how many may be pending.
ACCEPT_TIMEOUT_MS, ACCEPT_PENDING = 3000, 1000
# A map or a path is many packets of 64 kB. Where two of them fill the queue, as by default, a
# computer that is busy for 50 ms drops the map; these take a megabyte, and only when there is one.
QUEUED_BATCHES = dict.fromkeys(("interactive_high", "data_high", "data", "data_low"), 16)


def session_config(
    mode: str,
    connect: Sequence[str],
    listen: Sequence[str],
    secured: Mapping[str, Any],
) -> zenoh.Config:
    """Return Zenoh's configuration of a session; for its arguments see ``BusSettings``.

    Raises:
        zenoh.ZError: it has unknown keys or impossible values.
    """
    is_client = mode == "client"
    own = {
        "mode": mode,
        "connect": {
            "endpoints": list(connect),
            # A client without its router fails at once; a peer keeps trying.
            "timeout_ms": 0 if is_client else -1,
            "exit_on_failure": is_client,
            "retry": {"period_init_ms": 200, "period_max_ms": 1000},
        },
        "listen": {"endpoints": list(listen)},
        "scouting": {"multicast": {"enabled": False}},
        # Advanced publishers need timestamps for their cache.
        "timestamping": {"enabled": True},
        "transport": {
            "shared_memory": {"enabled": False},
            # Connections without a handshake must not keep others out: by default a hundred of
            # them do, for twelve seconds.
            "unicast": {"accept_timeout": ACCEPT_TIMEOUT_MS, "accept_pending": ACCEPT_PENDING},
            "link": {
                "rx": {"max_message_size": MAX_MESSAGE_BYTES},
                "tx": {"queue": {"size": QUEUED_BATCHES}},
            },
        },
    }
    return zenoh.Config.from_json5(json.dumps(_merged(own, secured)))


def _merged(own: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Return both; where both have a mapping, that of both."""
    merged = dict(own)
    for key, value in more.items():
        before = own.get(key)
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            merged[key] = _merged(before, value)
        else:
            merged[key] = value
    return merged
