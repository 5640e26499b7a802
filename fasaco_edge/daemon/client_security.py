"""How a process that joins a secured daemon or router shows who it is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from fasaco_edge.daemon.security_config import SecurityConfig, security_faults
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.plain_yaml import load, read_bounded


def read_client_security(words: str, connect: Sequence[str]) -> SecurityConfig:
    """Return what ``--security`` says: a YAML file, or the same as JSON beginning with ``{``.

    Raises:
        BadConfiguration: it cannot be read, is incomplete, or does not fit the endpoints.
    """
    try:
        text = words if words.startswith("{") else read_bounded(Path(words))
        security = msgspec.convert(load(text) or {}, SecurityConfig)
        for fault in security_faults(security, (), connect):
            raise fault
    except OSError as error:
        raise BadConfiguration(f"--security: {words}: {error.strerror}") from error
    except ValueError as error:
        raise BadConfiguration(f"--security: {error}") from error
    except BadConfiguration as error:
        raise BadConfiguration(f"--security, --connect: {error}", hint=error.hint) from error
    return security


def client_words(security: SecurityConfig) -> list[str]:
    """Return the words of a command line by which another process shows the same name.

    They name files; a password never stands there.
    """
    if security.kind == "none":
        return []
    part: dict[str, object] = {"kind": security.kind}
    if security.kind == "tls":
        part["tls"] = msgspec.to_builtins(security.tls)
    else:
        user = security.user
        part["user"] = {"name": user.name, "password_file": user.password_file}
    return ["--security", msgspec.json.encode(part).decode()]
