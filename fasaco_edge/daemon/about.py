"""Answers to who asks what this daemon is: its configuration, its versions, what can be asked."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any, cast

import msgspec

from fasaco_edge import __version__
from fasaco_edge.bus.queries import Reply, Request, matches
from fasaco_edge.bus.session import ZENOH_VERSION, Bus
from fasaco_edge.daemon.answers import answering, check, error_reply
from fasaco_edge.daemon.config import DaemonConfig
from fasaco_edge.errors import UnknownQuery
from fasaco_edge.wire.keys import RPC_NAMES, VERSION, Keys
from fasaco_edge.wire.status import encode_json

SECRET = re.compile(r"password|passphrase|secret|private_key|credential|token", re.IGNORECASE)
LEFT_OUT = "(left out)"


def serve_about(bus: Bus, keys: Keys, config: Callable[[], DaemonConfig]) -> None:
    """Serve ``config``, as it is then, and ``version``; tell others what there is to ask."""
    versions = {
        "package": "fasaco-edge",
        "version": __version__,
        "protocol": VERSION.removeprefix("@"),
        "zenoh": ZENOH_VERSION,
    }
    documents = {"config": lambda: config_document(config()), "version": lambda: versions}
    for name, document in documents.items():
        bus.serve(keys.rpc(name), answering(partial(_tell, document)))
    bus.serve(f"{keys.prefix}/@rpc/*", partial(_unknown, keys), complete=False)


def config_document(config: DaemonConfig) -> dict[str, Any]:
    """Return the configuration in force as it may be shown to anybody: without secrets.

    An endpoint may carry any setting of Zenoh's behind its ``#``, keys and passwords among
    them: all that is left out.
    """
    return cast("dict[str, Any]", _shown(msgspec.to_builtins(config)))


def _shown(value: object) -> object:
    if isinstance(value, dict):
        return {
            name: LEFT_OUT if item and SECRET.search(str(name)) else _shown(item)
            for name, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [_shown(item) for item in value]
    if isinstance(value, str) and re.match(r"\w+/[^#]*#", value):
        return f"{value.partition('#')[0]}#{LEFT_OUT}"
    return value


def _tell(document: Callable[[], dict[str, Any]], request: Request) -> Reply:
    check(request)
    return Reply(encode_json(document()))


def _unknown(keys: Keys, request: Request) -> Reply | None:
    """Answer what no other queryable does: this one hears every query."""
    if any(matches(request.key, keys.rpc(name)) for name in RPC_NAMES):
        return None
    name = request.key.rpartition("/")[2]
    return error_reply(
        UnknownQuery(f"there is no query {name!r}; there are {', '.join(RPC_NAMES)}")
    )
