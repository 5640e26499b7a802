"""The bus and its security: the section ``bus``, and Zenoh's settings from it."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from msgspec import Meta, structs

from fasaco_edge.bus import DEFAULT_ENDPOINT, access
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.endpoints import UNIX, endpoint_faults, from_here, is_local, protocol_of
from fasaco_edge.config.reading import faults_of
from fasaco_edge.errors import BadConfiguration, FasacoError, OpenToEveryone
from fasaco_edge.host.documents import StrictDocument, inspected
from fasaco_edge.host.plain_yaml import read_bounded, read_written
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topics import FLEET

if TYPE_CHECKING:
    from fasaco_edge.config.ros import RosConfig

LOG = logging.getLogger(__name__)

ATTRIBUTES = {"tls": "cert_common_names", "user": "usernames"}
# The protocols over which a session proves its identity.
CARRIERS = {
    "tls": (("tls",), "only tls/<host>:<port> carries certificates"),
    "user": (("tcp", "ws", *UNIX), "only tcp, ws and unix sockets carry user and password"),
}

Name = Annotated[str, Meta(min_length=1)]


class TlsConfig(StrictDocument, frozen=True):
    """PEM files: the CA of all participants, this daemon's certificate and its key."""

    root_ca: str = ""
    certificate: str = ""
    private_key: str = ""


class UserConfig(StrictDocument, frozen=True):
    """This daemon's user name, and a file with its password and nothing else.

    ``dictionary_file`` has a line ``name:password`` for each user who may connect.
    """

    name: str = ""
    password_file: str = ""
    dictionary_file: str = ""


class RolesConfig(StrictDocument, frozen=True):
    """Names with each role: common names of certificates, or user names (``bus.access.ROLES``)."""

    mapper: tuple[Name, ...] = ()
    viewer: tuple[Name, ...] = ()
    operator: tuple[Name, ...] = ()
    recorder: tuple[Name, ...] = ()
    driver: tuple[Name, ...] = ()
    ros: tuple[Name, ...] = ()
    router: tuple[Name, ...] = ()


class LimitsConfig(StrictDocument, access.SenderLimits, frozen=True):
    """Limits on each sender."""


class SecurityConfig(StrictDocument, frozen=True):
    """Authentication of participants, and their permissions."""

    kind: Literal["none", "tls", "user"] = "none"
    tls: TlsConfig = TlsConfig()
    user: UserConfig = UserConfig()
    roles: RolesConfig = RolesConfig()
    limits: LimitsConfig = LimitsConfig()

    def names(self) -> dict[str, tuple[str, ...]]:
        """Return the names with each role."""
        return structs.asdict(self.roles)

    def warn_of_certificate(self) -> None:
        """Warn of a certificate with which no connection can be made: Zenoh does not say why."""
        if self.kind != "tls" or not all(os.path.isfile(path) for _, path in files(self)):
            return  # opening the session raises an error that names the file
        # Imports ssl, which a session without certificates does not need.
        from fasaco_edge.config.certificates import read_certificate  # noqa: PLC0415

        try:
            read_certificate(self.tls, listens=False)
        except FasacoError as error:
            LOG.warning("%s; %s", error, error.hint, extra={"event": "certificate"})

    def of_client(self, dictionary_file: str = "") -> dict[str, Any]:
        """Return the credentials of a session, as a part of Zenoh's configuration.

        ``dictionary_file``: passwords of the users who may connect to it; "" for none.

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
                    text = f"{user.password_file} is empty"
                    raise BadConfiguration(text, key="bus.security.user.password_file")
                if dictionary_file:
                    _read("user.dictionary_file", dictionary_file)
                transport = access.user_password(user.name, password, dictionary_file)
            case _:
                return {}
        # By gossip, peers would receive each other's endpoints, and could make us connect there.
        return {"transport": transport, "scouting": {"gossip": {"enabled": False}}}

    def of_daemon(
        self, prefix: str, ros: access.Role | None = None, ros_driver: access.Role | None = None
    ) -> dict[str, Any]:
        """Return the credentials of a daemon's session, with access control for all others.

        ``prefix``: prefix of all keys of the robot; ``ros`` and ``ros_driver``: the rights of
        the roles ``ros`` and ``driver`` under ROS 2, None without a section ``ros2``.

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
        return part | access.limits(prefix, self.limits)


class BusConfig(StrictDocument, frozen=True):
    """How the daemon joins the bus, and who else may join it.

    Remote access requires authentication (``security``), unless ``open_to_everyone`` is set.
    """

    base: str = "fasaco"
    mode: Literal["peer", "client", "router"] = "peer"
    listen: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    connect: tuple[str, ...] = ()
    open_to_everyone: bool = False
    security: SecurityConfig = SecurityConfig()

    def faults(self) -> Iterator[BadConfiguration]:
        yield from faults_of(lambda: Keys(base=self.base))
        if not (self.listen or self.connect):
            text = "must not be empty if bus.connect is empty"
            yield BadConfiguration(text, key="listen", others=["connect"])
        yield from endpoint_faults("listen", self.listen)
        yield from endpoint_faults("connect", self.connect)
        yield from security_faults(
            self.security, self.listen, self.connect, open_to_everyone=self.open_to_everyone
        )

    def settings(self, prefix: str, ros: RosConfig | None = None) -> BusSettings:
        """Return the settings of the session of a robot whose keys begin with ``prefix``.

        ``ros``: its section of ROS 2; None without one.

        Raises:
            BadConfiguration: a file of ``security`` cannot be read.
        """
        rights = (ros.rights(), ros.driver_rights()) if ros else ()
        part = self.security.of_daemon(prefix, *rights)
        if self.open_to_everyone:
            part |= access.limits(prefix, self.security.limits)
        return BusSettings(self.mode, self.connect, self.listen, part)

    def of_client(self) -> BusSettings:
        """Return the settings of another program's session, on the same computer.

        Raises:
            BadConfiguration: a file of ``security`` cannot be read.
        """
        self.security.warn_of_certificate()
        endpoints = tuple(map(from_here, self.listen or self.connect))
        return BusSettings("client", endpoints, secured=self.security.of_client())


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
    """Yield missing and inconsistent values, with keys below ``bus``.

    Remote endpoints without authentication yield OpenToEveryone.
    """
    kind = ["security.kind"]
    beyond = [index for index, endpoint in enumerate(listen) if not is_local(endpoint)]
    if security.kind == "none":
        if beyond and not open_to_everyone:
            yield OpenToEveryone(
                f"{listen[beyond[0]]} can be reached from other computers: remote access requires "
                "authentication (bus.security)",
                key=f"listen[{beyond[0]}]",
                others=[*kind, "open_to_everyone"],
            )
        for role, who in security.names().items():
            if who:
                text = "with bus.security.kind none there are no names"
                yield BadConfiguration(text, key=f"security.roles.{role}", others=kind)
        return
    if open_to_everyone:
        text = f"contradicts bus.security.kind {security.kind}"
        yield BadConfiguration(text, key="open_to_everyone", others=kind)
    yield from _missing(security, listen)
    protocols, carries = CARRIERS[security.kind]
    for key, endpoints in (("listen", listen), ("connect", connect)):
        for index, endpoint in enumerate(endpoints):
            if protocol_of(endpoint) not in protocols:
                yield BadConfiguration(
                    f"{endpoint}: {carries}",
                    hint="correct the endpoint, or bus.security.kind",
                    key=f"{key}[{index}]",
                    others=kind,
                )


def _missing(security: SecurityConfig, listen: Sequence[str]) -> Iterator[BadConfiguration]:
    needed, others = f"needed with bus.security.kind {security.kind}", ["security.kind"]
    if security.kind == "user" and not security.user.name:
        yield BadConfiguration(needed, key="security.user.name", others=others)
    for name, file in files(security):
        if "\0" in file:
            yield BadConfiguration("must be a path, got one with a NUL", key=f"security.{name}")
        if not file and (name != "user.dictionary_file" or listen):
            yield BadConfiguration(needed, key=f"security.{name}", others=[*others, "listen"])


def _read(name: str, file: str) -> str:
    key = f"bus.security.{name}"
    try:
        return read_bounded(Path(file))
    except OSError as error:
        raise BadConfiguration(f"{file}: {error.strerror}", key=key) from error
    except ValueError as error:
        raise BadConfiguration(f"{file}: not a text", key=key) from error


def read_client_security(file: str, connect: Sequence[str]) -> SecurityConfig:
    """Read the YAML file of ``--security``.

    Raises:
        BadConfiguration: it cannot be read, is incomplete, or does not fit the endpoints.
    """
    text = read_written(Path(file), BadConfiguration, missing="name the file of --security")
    values = {} if text.values is None else text.values
    security, faults = inspected(SecurityConfig, values, BadConfiguration)
    text.check(faults)
    for fault in security_faults(security, (), connect):
        raise BadConfiguration(
            f"--security, --connect: {fault.within('bus', BadConfiguration)}", hint=fault.hint
        )
    return security
