"""Security of the bus: the section ``bus.security``, and Zenoh's settings from it."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, structs

from fasaco_edge.bus import access
from fasaco_edge.config.endpoints import UNIX, is_local, protocol_of
from fasaco_edge.config.reading import Section
from fasaco_edge.errors import BadConfiguration, ClockBeforeCertificate, OpenToEveryone
from fasaco_edge.host.plain_yaml import load, read_bounded
from fasaco_edge.wire.topics import FLEET

LOG = logging.getLogger(__name__)

ATTRIBUTES = {"tls": "cert_common_names", "user": "usernames"}
# The protocols over which a session proves its identity.
CARRIERS = {
    "tls": (("tls",), "only tls/<host>:<port> carries certificates"),
    "user": (("tcp", "ws", *UNIX), "user and password are shown over tcp, ws or a unix socket"),
}

Name = Annotated[str, Meta(min_length=1)]


class TlsConfig(Section, frozen=True):
    """PEM files: the CA of all participants, this daemon's certificate and its key."""

    root_ca: str = ""
    certificate: str = ""
    private_key: str = ""


class UserConfig(Section, frozen=True):
    """This daemon's user name, and a file with its password and nothing else.

    ``dictionary_file`` has a line ``name:password`` for each user who may connect.
    """

    name: str = ""
    password_file: str = ""
    dictionary_file: str = ""


class RolesConfig(Section, frozen=True):
    """Names with each role: common names of certificates, or user names (``bus.access.ROLES``)."""

    mapper: tuple[Name, ...] = ()
    viewer: tuple[Name, ...] = ()
    operator: tuple[Name, ...] = ()
    recorder: tuple[Name, ...] = ()
    driver: tuple[Name, ...] = ()
    ros: tuple[Name, ...] = ()
    router: tuple[Name, ...] = ()


class LimitsConfig(Section, access.Limits, frozen=True):
    """Limits on each sender."""


class SecurityConfig(Section, frozen=True):
    """Authentication of participants, and their permissions."""

    kind: Literal["none", "tls", "user"] = "none"
    tls: TlsConfig = TlsConfig()
    user: UserConfig = UserConfig()
    roles: RolesConfig = RolesConfig()
    limits: LimitsConfig = LimitsConfig()

    def names(self) -> dict[str, tuple[str, ...]]:
        """Return the names with each role."""
        return structs.asdict(self.roles)

    def warn_of_clock(self) -> None:
        """Warn if the clock is before the certificate's start, so that no connection can be made.

        Certificates are read, which takes memory and time, only if the clock is before the time at
        which one of their files, or this program, was written.
        """
        if self.kind != "tls":
            return
        try:
            written = [os.stat(path).st_mtime for _, path in files(self)]
            if time.time() >= max(*written, Path(__file__).stat().st_mtime):
                return
            # Imports ssl, which a daemon with a correct clock does not need.
            from fasaco_edge.config.certificates import read_certificate  # noqa: PLC0415

            read_certificate(self.tls)
        except ClockBeforeCertificate as error:
            LOG.warning("%s; %s", error, error.hint, extra={"event": "clock"})
        except (OSError, BadConfiguration):
            return  # opening the session raises this error

    def of_client(self, dictionary_file: str = "") -> dict[str, Any]:
        """Return the credentials of a session, as a part of Zenoh's configuration.

        Args:
            dictionary_file: passwords of the users who may connect to it; "" for none.

        Raises:
            BadConfiguration: a file cannot be read.
        """
        match self.kind:
            case "tls":
                for name, file in files(self):
                    _read(name, file)
                tls = self.tls
                transport = access.mutual_tls(tls.root_ca, tls.certificate, tls.private_key)
            case "user":
                user = self.user
                password = _read("user.password_file", user.password_file).strip()
                if not password:
                    raise BadConfiguration(
                        f"bus.security.user.password_file: {user.password_file} is empty"
                    )
                if dictionary_file:
                    _read("user.dictionary_file", dictionary_file)
                transport = access.user_password(user.name, password, dictionary_file)
            case _:
                return {}
        # By gossip, peers would receive each other's endpoints, and could make us connect there.
        return {"transport": transport, "scouting": {"gossip": {"enabled": False}}}

    def of_daemon(
        self,
        prefix: str,
        ros: access.Role | None = None,
        ros_driver: access.Role | None = None,
    ) -> dict[str, Any]:
        """Return the credentials of a daemon's session, with access control for all others.

        Args:
            prefix: prefix of all keys of the robot.
            ros, ros_driver: rights of the roles ``ros`` and ``driver`` under ROS 2; None without a
                section ``ros2``.

        Raises:
            BadConfiguration: a file cannot be read.
        """
        part = self.of_client(self.user.dictionary_file)
        if self.kind == "none":
            return part
        base = prefix.rpartition("/")[0]
        # A router represents the other robots, too.
        fleet = access.Role("the other robots", (FLEET.suffix,), (FLEET.suffix,))
        grants = [access.Grant("fleet", self.roles.router, f"{base}/*", rights=fleet)]
        grants += [
            access.Grant(role, who, prefix) for role, who in self.names().items() if role != "ros"
        ]
        if ros is not None:
            grants.append(access.Grant("ros", self.roles.ros, "", rights=ros))
            # A recorder receives what the daemon receives.
            inputs = access.Role(ros.description, listens=ros.speaks)
            grants.append(
                access.Grant("ros", self.roles.recorder, "", of="recorder", rights=inputs)
            )
        if ros_driver is not None:
            driver = self.roles.driver
            grants.append(access.Grant("ros", driver, "", of="driver", rights=ros_driver))
        part["access_control"] = access.access_control(grants, ATTRIBUTES[self.kind])
        return part | self.thinned(prefix)

    def thinned(self, prefix: str) -> dict[str, Any]:
        """Return the limits, as a part of Zenoh's configuration."""
        return access.limits(prefix, self.limits)


def files(security: SecurityConfig) -> Iterator[tuple[str, str]]:
    """Yield the files that the chosen kind needs: the key under ``bus.security``, and the path."""
    section = {"tls": security.tls, "user": security.user}.get(security.kind)
    for name, file in structs.asdict(section).items() if section else ():
        if name != "name":
            yield f"{security.kind}.{name}", file


def security_faults(
    security: SecurityConfig,
    listen: Sequence[str],
    connect: Sequence[str],
    *,
    open_to_everyone: bool = False,
) -> Iterator[BadConfiguration]:
    """Yield missing and inconsistent values.

    Remote endpoints without authentication yield OpenToEveryone.
    """
    beyond = [endpoint for endpoint in listen if not is_local(endpoint)]
    if security.kind == "none":
        if beyond and not open_to_everyone:
            yield OpenToEveryone(
                f"bus.listen: {beyond[0]} can be reached from other computers: remote access "
                "requires authentication (bus.security)"
            )
        named = [role for role, who in security.names().items() if who]
        if named:
            yield BadConfiguration(
                f"bus.security.roles.{named[0]}: with bus.security.kind none there are no names"
            )
        return
    if open_to_everyone:
        yield BadConfiguration(
            f"bus.open_to_everyone: contradicts bus.security.kind {security.kind}"
        )
    yield from _missing(security, listen)
    protocols, carries = CARRIERS[security.kind]
    for key, endpoints in (("listen", listen), ("connect", connect)):
        for endpoint in endpoints:
            if protocol_of(endpoint) not in protocols:
                yield BadConfiguration(
                    f"bus.{key}: {endpoint}: {carries}",
                    hint="correct the endpoint, or bus.security.kind",
                )


def _missing(security: SecurityConfig, listen: Sequence[str]) -> Iterator[BadConfiguration]:
    if security.kind == "user" and not security.user.name:
        yield BadConfiguration("bus.security.user.name: needed with bus.security.kind user")
    for name, file in files(security):
        if "\0" in file:
            yield BadConfiguration(f"bus.security.{name} must be a path, got one with a NUL")
        if not file and (name != "user.dictionary_file" or listen):
            yield BadConfiguration(
                f"bus.security.{name}: needed with bus.security.kind {security.kind}"
            )


def _read(name: str, file: str) -> str:
    try:
        return read_bounded(Path(file))
    except OSError as error:
        raise BadConfiguration(f"bus.security.{name}: {file}: {error.strerror}") from error
    except ValueError as error:
        raise BadConfiguration(f"bus.security.{name}: {file}: not a text") from error


def read_client_security(file: str, connect: Sequence[str]) -> SecurityConfig:
    """Read the YAML file of ``--security``.

    Raises:
        BadConfiguration: it cannot be read, is incomplete, or does not fit the endpoints.
    """
    try:
        security = msgspec.convert(load(read_bounded(Path(file))) or {}, SecurityConfig)
        for fault in security_faults(security, (), connect):
            raise fault
    except OSError as error:
        raise BadConfiguration(f"--security: {file}: {error.strerror}") from error
    except ValueError as error:
        raise BadConfiguration(f"--security: {file}: {error}") from error
    except BadConfiguration as error:
        raise BadConfiguration(f"--security, --connect: {error}", hint=error.hint) from error
    return security
