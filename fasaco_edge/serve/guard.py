"""Access control of the page and its commands: hosts, origins, tokens.

A page of another site in a user's browser can call this server, too. Such requests have an Origin
header of the other site, or a host name that was made to resolve to this server (DNS rebinding). A
request with an IP address as host cannot be a DNS rebinding.
"""

from __future__ import annotations

import hmac
import ipaddress
import re
import secrets
import socket
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.addresses import Address
from fasaco_edge.host.durable import whole, write_through
from fasaco_edge.host.files import FileTooLongError, read_own
from fasaco_edge.serve.messages import Role

# Largest file of tokens: about forty tokens.
MOST_BYTES = 4096
_TOKEN = re.compile(r"[\w.~-]{16,200}", re.ASCII)
ROLES: tuple[Role, ...] = get_args(Role)


@dataclass(frozen=True, slots=True)
class Guard:
    """Decides the rights of a client.

    Attributes:
        names: host names of this server; addresses are always allowed.
        tokens: each with its role; if empty, no token is required, and all clients have ``role``.
        role: role of all clients if there are no tokens.
    """

    names: frozenset[str]
    tokens: tuple[tuple[Role, str], ...] = ()
    role: Role = "viewer"

    def is_ours(self, host: str) -> bool:
        """Return whether a Host header names this server."""
        if "%" in host:  # the zone of an IPv6 address may be any text
            return False
        name, _, _ = host.rpartition(":") if re.search(r":\d+$", host) else (host, "", "")
        try:
            ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
        except ValueError:
            return name.lower() in self.names
        return True

    def to_look_only(self) -> Guard:
        """Return a guard that gives all clients the role of a viewer."""
        tokens: tuple[tuple[Role, str], ...] = tuple(("viewer", token) for _, token in self.tokens)
        return Guard(self.names, tokens)

    def role_of(self, token: str) -> Role | None:
        """Return the role of a client with ``token``; None if it is rejected."""
        if not self.tokens:
            return self.role
        found: Role | None = None
        # All tokens are compared, each in constant time, against timing attacks.
        for role, known in self.tokens:
            if hmac.compare_digest(token.encode(), known.encode()):
                found = role
        return found


def is_same_origin(origins: list[str], host: str) -> bool:
    """Return whether a request has no Origin header (no browser), or that of a page of ``host``."""
    own = (f"{scheme}://{host.lower()}" for scheme in ("http", "https"))
    return not origins or (len(origins) == 1 and origins[0].lower() in own)


def guard_for(
    address: Address, tokens: Path | None, names: list[str], *, allow_commands: bool
) -> Guard:
    """Return the guard of a server.

    Args:
        address: address at which the server listens.
        tokens: file of tokens, created if missing; None for no tokens.
        names: additional host names of this server.
        allow_commands: whether all clients may command without a token.

    Raises:
        BadConfiguration: access would be open to the network, or the token file is invalid.
    """
    if tokens is None and not address.is_loopback:
        raise BadConfiguration(
            f"--listen: {address.shown} lets other computers in, without any access control",
            hint="give --tokens FILE (a new file gets new tokens), or listen on 127.0.0.1",
        )
    if tokens is not None and allow_commands:
        raise BadConfiguration(
            "--allow-commands: with --tokens, the operator's token gives that right",
            hint="leave out one of the two",
        )
    ours = {"localhost", socket.gethostname().lower(), *(name.lower() for name in names)}
    ours |= {f"{name}.local" for name in ours if "." not in name}
    if tokens is None:
        return Guard(frozenset(ours), role="operator" if allow_commands else "viewer")
    return Guard(frozenset(ours), read_tokens(tokens))


def read_tokens(file: Path) -> tuple[tuple[Role, str], ...]:
    """Return the tokens in a file of lines ``operator: TOKEN``; create the file if missing.

    Raises:
        BadConfiguration: the file cannot be read or created, others may read it, or a line is
            invalid.
    """
    try:
        if not file.exists():
            made = "".join(f"{role}: {secrets.token_urlsafe(24)}\n" for role in ROLES)
            with whole(file) as new:
                write_through(new, made.encode(), mode=0o600)
        open_to = stat.S_IMODE(file.stat().st_mode) & 0o077
        text = read_own(file, MOST_BYTES).decode()
    except FileTooLongError as error:
        raise BadConfiguration(
            f"--tokens: {file}: {error.strerror}",
            hint="remove tokens and remarks: clients of one role may share a token",
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "not a text"
        raise BadConfiguration(f"--tokens: {file}: {why}") from error
    if open_to:
        raise BadConfiguration(f"--tokens: {file} can be read by others", hint=f"chmod 600 {file}")
    tokens: list[tuple[Role, str]] = []
    for number, line in enumerate(text.splitlines(), 1):
        role, _, token = (part.strip() for part in line.partition(":"))
        if not line.strip() or line.startswith("#"):
            continue
        if role not in ROLES or not _TOKEN.fullmatch(token):
            raise BadConfiguration(
                f"--tokens: {file}, line {number}: must be viewer: TOKEN or operator: TOKEN, "
                "a token of 16 or more letters, digits and - _ . ~"
            )
        tokens.append((role, token))
    if not tokens:
        raise BadConfiguration(f"--tokens: {file} has no token", hint="delete it to have new ones")
    return tuple(tokens)
