"""Certificate check: whether a certificate, its key and its CA match, tried by a handshake."""

from __future__ import annotations

import contextlib
import ssl
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Protocol

from fasaco_edge.errors import BadConfiguration, ClockBeforeCertificate

ROUND_TRIPS = 8
# X509_V_FLAG_NO_CHECK_TIME, for which ssl has no name.
NO_CHECK_TIME = 0x20_0000


class TlsFiles(Protocol):
    """The PEM files of one side of a connection."""

    @property
    def certificate(self) -> str: ...
    @property
    def private_key(self) -> str: ...
    @property
    def root_ca(self) -> str: ...


@dataclass(frozen=True, slots=True)
class Certificate:
    """Content of a certificate.

    Attributes:
        name: its common name, to which roles are assigned.
        hosts: the names and addresses by which others may connect to it.
        begins: time from which both it and its CA are valid.
        ends: time at which it or its CA expires, whichever is first.
    """

    name: str
    hosts: tuple[str, ...]
    begins: datetime
    ends: datetime


def read_certificate(files: TlsFiles, *, listens: bool = True) -> Certificate:
    """Check a certificate, and return its content; ``listens``: its owner accepts connections.

    Raises:
        BadConfiguration: a file cannot be read, has expired, or does not match the others.
        ClockBeforeCertificate: by this computer's clock it is not valid yet.
    """
    try:
        listening, connecting = _context(files, server=True), _context(files, server=False)
        if not listens:
            connecting.verify_mode = ssl.CERT_NONE
        certificate: dict[str, Any] | None = _handshake(listening, connecting).getpeercert()
        assert certificate is not None
        chain: list[dict[str, Any]] = [certificate, *listening.get_ca_certs()]
    except ssl.SSLCertVerificationError as error:
        raise BadConfiguration(
            f"{files.certificate}: {error.verify_message}",
            hint="name the CA that has signed it, or have it signed anew (protocol/security.md)",
        ) from error
    except ssl.SSLError as error:
        # OpenSSL gives no reason if a file is not PEM, or the key is locked.
        reason = (error.reason or "not PEM, or a key with a password").lower().replace("_", " ")
        together = f"{files.certificate}, {files.private_key} and {files.root_ca}"
        raise BadConfiguration(f"{together} do not fit together: {reason}") from error
    except OSError as error:
        raise BadConfiguration(
            f"{error.filename or files.certificate}: {error.strerror}"
        ) from error

    def moments(name: str) -> list[datetime]:
        return [datetime.fromtimestamp(ssl.cert_time_to_seconds(one[name]), UTC) for one in chain]

    begins, ends = max(moments("notBefore")), min(moments("notAfter"))
    now = datetime.now(UTC)
    if now < begins:
        raise ClockBeforeCertificate(
            f"the clock says {now:%Y-%m-%d %H:%M} UTC, which is before the beginning of "
            f"{files.certificate}, {begins:%Y-%m-%d %H:%M}: no connection can be made with it"
        )
    if now > ends:
        raise BadConfiguration(
            f"{files.certificate}: certificate has expired, {ends:%Y-%m-%d}",
            hint="have a new one signed (protocol/security.md), or check the clock with `date -u`",
        )
    names = [value for part in certificate["subject"] for key, value in part if key == "commonName"]
    return Certificate(
        name=names[-1] if names else "",
        hosts=tuple(value for _, value in certificate.get("subjectAltName", ())),
        begins=begins,
        ends=ends,
    )


def _context(files: TlsFiles, *, server: bool) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER if server else ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_REQUIRED
    # Whether the certificate is valid now is checked separately.
    context.verify_flags |= NO_CHECK_TIME
    # A locked key must not prompt for its password.
    context.load_cert_chain(files.certificate, files.private_key, password=lambda: "")
    context.load_verify_locations(files.root_ca)
    return context


def _handshake(listening: ssl.SSLContext, connecting: ssl.SSLContext) -> ssl.SSLObject:
    """Return the listening side, which received the certificate."""
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    client = connecting.wrap_bio(back, there)
    server = listening.wrap_bio(there, back, server_side=True)
    for _ in range(ROUND_TRIPS):
        for side in (client, server):
            with contextlib.suppress(ssl.SSLWantReadError):
                side.do_handshake()
    return server
