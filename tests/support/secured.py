"""CA by openssl, as in protocol/security.md, and a daemon that requires its certificates."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import zenoh

from tests.support.outsider import Outsider, open_client
from tests.support.processes import Daemon, daemon_process, free_endpoint

needs_openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")
KEY = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes"
BOTH = "serverAuth,clientAuth"
LOCAL = "DNS:localhost,IP:127.0.0.1"


@dataclass(frozen=True)
class Authority:
    """A CA in its own folder, with the certificates that it has signed."""

    folder: Path

    @property
    def root(self) -> str:
        """Its own certificate."""
        return str(self.folder / "ca.pem")

    def files(self, name: str) -> dict[str, str]:
        """Return the files of a name, as members of ``bus.security.tls``."""
        certificate, key = self.folder / f"{name}.pem", self.folder / f"{name}.key"
        return {"root_ca": self.root, "certificate": str(certificate), "private_key": str(key)}

    def sign(
        self, name: str, *, days: int = 30, names: str = LOCAL, uses: str = BOTH
    ) -> dict[str, str]:
        """Make key and certificate for a name; it expires after ``days``, or has expired."""
        extensions = self.folder / f"{name}.ext"
        extensions.write_text(
            f"basicConstraints=CA:FALSE\nextendedKeyUsage={uses}\nsubjectAltName={names}\n"
        )
        self._openssl(f"req {KEY} -keyout {name}.key -out {name}.csr -subj /CN={name}")
        self._openssl(
            f"x509 -req -in {name}.csr -CA ca.pem -CAkey ca.key -CAcreateserial "
            f"-days {days} -extfile {name}.ext -out {name}.pem"
        )
        return self.files(name)

    def _openssl(self, words: str) -> None:
        subprocess.run(
            ["openssl", *words.split()], cwd=self.folder, check=True, capture_output=True
        )


def authority(folder: Path, *names: str) -> Authority:
    """Return a new CA that has signed certificates for these names."""
    folder.mkdir(parents=True)
    made = Authority(folder)
    made._openssl(
        f"req -x509 {KEY} -keyout ca.key -out ca.pem -days 30 -subj /CN=test-ca "
        "-addext basicConstraints=critical,CA:TRUE -addext keyUsage=critical,keyCertSign"
    )
    for name in names:
        made.sign(name)
    return made


ROLES = {"mapper": ["slam"], "viewer": ["eye"], "operator": ["boss"], "recorder": ["scribe"]}
# Names with a role, and "stranger" with a certificate but no role.
NAMES = ("robot", "slam", "eye", "boss", "scribe", "stranger")


def transport(files: dict[str, str]) -> dict[str, Any]:
    """Return the section ``transport`` of Zenoh's configuration with a certificate."""
    tls = {"root_ca_certificate": files["root_ca"], "enable_mtls": True}
    if "certificate" in files:
        tls["connect_certificate"] = files["certificate"]
        tls["connect_private_key"] = files["private_key"]
    return {"link": {"tls": tls}}


class House:
    """A daemon behind mutual TLS.

    Attributes:
        daemon: its process.
        ca: the CA of the certificates.
        endpoint: its endpoint, with a host name of its certificate.
    """

    def __init__(self, daemon: Daemon, ca: Authority) -> None:
        self.daemon = daemon
        self.ca = ca
        self.endpoint = daemon.endpoint.replace("127.0.0.1", "localhost")

    def guest(self, name: str) -> Outsider:
        """Return the client of a name, which may read."""
        return Outsider(self.endpoint, transport=transport(self.ca.files(name)))

    def session(self, files: dict[str, str]) -> zenoh.Session:
        """Return a plain session."""
        return open_client(self.endpoint, transport(files))

    @contextmanager
    def sender(self, name: str) -> Iterator[Sender]:
        """Open a session that publishes, with permission or without."""
        session = self.session(self.ca.files(name))
        try:
            yield Sender(session)
        finally:
            session.close()  # type: ignore[no-untyped-call]


class Sender:
    """Publishes with permission or without."""

    put = Outsider.put
    get = Outsider.get

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session
        self.prefix = "fasaco/@v1/robot"


@contextmanager
def secured_daemon(folder: Path, *words: str, **sections: Any) -> Iterator[House]:
    """Run a daemon that gives roles to ``NAMES``."""
    ca = authority(folder / "ca", *NAMES)
    security = {"kind": "tls", "tls": ca.files("robot"), "roles": ROLES}
    # These clients query without a pause.
    security["limits"] = {"queries_hz": 10_000.0}
    security |= sections.pop("security", {})
    bus = {"listen": [free_endpoint().replace("tcp/", "tls/")], "security": security}
    with daemon_process(folder, *words, bus=bus, **sections) as daemon:
        yield House(daemon, ca)
