"""A daemon with certificates and roles, and guests who show one of those certificates."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zenoh

from tests.support.certificates import Authority, authority
from tests.support.outsider import Outsider, open_client
from tests.support.processes import Daemon, daemon_process, free_endpoint

ROLES = {"mapper": ["slam"], "viewer": ["eye"], "operator": ["boss"], "recorder": ["scribe"]}
# Beside those with a role: one with a certificate and no role.
NAMES = ("robot", "slam", "eye", "boss", "scribe", "stranger")


def transport(files: dict[str, str]) -> dict[str, Any]:
    """Return what shows a certificate, in Zenoh's words."""
    tls = {"root_ca_certificate": files["root_ca"], "enable_mtls": True}
    if "certificate" in files:
        tls["connect_certificate"] = files["certificate"]
        tls["connect_private_key"] = files["private_key"]
    return {"link": {"tls": tls}}


class House:
    """A daemon behind mutual TLS.

    Attributes:
        daemon: its process.
        ca: who has signed the certificates.
        endpoint: where it listens, by a name that its certificate holds.
    """

    def __init__(self, daemon: Daemon, ca: Authority) -> None:
        self.daemon = daemon
        self.ca = ca
        self.endpoint = daemon.endpoint.replace("127.0.0.1", "localhost")

    def guest(self, name: str) -> Outsider:
        """Return a guest who may see what the robot does."""
        return Outsider(self.endpoint, transport=transport(self.ca.files(name)))

    def session(self, files: dict[str, str]) -> zenoh.Session:
        """Return a plain session."""
        return open_client(self.endpoint, transport(files))

    @contextmanager
    def voice(self, name: str) -> Iterator[Voice]:
        """Open a session that says something, heard or not."""
        session = self.session(self.ca.files(name))
        try:
            yield Voice(session)
        finally:
            session.close()  # type: ignore[no-untyped-call]


class Voice:
    """Speaks whether it may or not."""

    put = Outsider.put
    get = Outsider.get

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session
        self.prefix = "fasaco/@v1/robot"


@contextmanager
def secured_daemon(folder: Path, *words: str, **sections: Any) -> Iterator[House]:
    """Run a daemon that knows its guests."""
    ca = authority(folder / "ca", *NAMES)
    security = {"kind": "tls", "tls": ca.files("robot"), "roles": ROLES}
    # These guests ask without a pause.
    security["limits"] = {"queries_hz": 10_000.0}
    security |= sections.pop("security", {})
    bus = {"listen": [free_endpoint().replace("tcp/", "tls/")], "security": security}
    with daemon_process(folder, *words, bus=bus, **sections) as daemon:
        yield House(daemon, ca)
