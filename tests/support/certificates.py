"""A CA and certificates for one test, made by openssl as protocol/README.md shows."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

needs_openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")
KEY = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes"
BOTH = "serverAuth,clientAuth"
LOCAL = "DNS:localhost,IP:127.0.0.1"


@dataclass(frozen=True)
class Authority:
    """A CA in a folder of its own, and what it has signed."""

    folder: Path

    @property
    def root(self) -> str:
        """Its own certificate."""
        return str(self.folder / "ca.pem")

    def files(self, name: str) -> dict[str, str]:
        """Return the files of whoever has that name, as ``bus.security.tls`` has them."""
        certificate, key = self.folder / f"{name}.pem", self.folder / f"{name}.key"
        return {"root_ca": self.root, "certificate": str(certificate), "private_key": str(key)}

    def sign(
        self, name: str, *, days: int = 30, names: str = LOCAL, uses: str = BOTH
    ) -> dict[str, str]:
        """Make key and certificate for a name; it ends after so many days, or has ended."""
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
