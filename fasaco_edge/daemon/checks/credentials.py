"""How the daemon shows who it is, and whether its secrets are kept."""

from __future__ import annotations

import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path

from fasaco_edge.daemon.certificates import read_certificate
from fasaco_edge.daemon.checks.finding import Finding, Level, Patient, worst
from fasaco_edge.daemon.config import BusConfig
from fasaco_edge.errors import BadConfiguration, ClockBeforeCertificate

SOON = timedelta(days=30)
SECRETS = {
    "tls": ("private_key",),
    "user": ("password_file", "dictionary_file"),
}
HOW_TO = "protocol/README.md, Security, tells how to make them"


def identity(patient: Patient) -> Finding:
    """Tell by what name others know the daemon, and until when."""
    bus = patient.config.bus
    security, listens = bus.security, bool(bus.listen)
    if security.kind == "none":
        return Finding(Level.OK, "shows no name, asks for none")
    try:
        security.of_daemon(patient.config.keys().prefix)
        if security.kind == "user":
            return _login(bus)
        certificate = read_certificate(security.tls, listens=listens)
    except (BadConfiguration, ClockBeforeCertificate) as error:
        to_do = error.hint if isinstance(error, ClockBeforeCertificate) else HOW_TO
        return Finding(Level.FAIL, str(error), to_do)
    left = certificate.ends - datetime.now(UTC)
    details = [_recording(bus, certificate.name)]
    if listens:
        details.insert(0, f"others connect to it as {', '.join(certificate.hosts) or 'nothing'}")
    found = f"certificate of {certificate.name!r}, ends {certificate.ends:%Y-%m-%d}"
    if not certificate.name or (listens and not certificate.hosts):
        return Finding(Level.FAIL, f"{found}: a name is missing in it", HOW_TO, tuple(details))
    if left < SOON:
        return Finding(Level.WARN, f"{found}, in {left.days} days", "renew it", tuple(details))
    return Finding(Level.OK, found, details=tuple(details))


def secret_files(patient: Patient) -> Finding:
    """Tell whether others on this computer can read keys and passwords."""
    security = patient.config.bus.security
    if security.kind == "none":
        return Finding(Level.OK, "there are none")
    section = getattr(security, security.kind)
    paths = [Path(file) for name in SECRETS[security.kind] if (file := getattr(section, name))]
    levels, details = [], []
    for path in paths:
        try:
            mode = path.stat().st_mode
        except OSError as error:
            return Finding(Level.FAIL, f"{path}: {error.strerror}", HOW_TO)
        levels.append(_level(mode))
        details.append(f"{path}: {stat.filemode(mode)}")
    level = worst(levels)
    if level is Level.OK:
        return Finding(level, "read by their owner alone", details=tuple(details))
    whom = "everybody on this computer" if level is Level.FAIL else "their group"
    command = "chmod 600 " + " ".join(map(str, paths))
    return Finding(level, f"can be read by {whom}", command, tuple(details))


def _login(bus: BusConfig) -> Finding:
    """Tell about user and password; the files can be read."""
    security, user = bus.security, bus.security.user
    names = []
    text = Path(user.dictionary_file).read_text(encoding="utf-8") if user.dictionary_file else ""
    for number, line in enumerate(text.splitlines(), start=1):
        name, colon, password = line.partition(":")
        if not (name and colon and password):
            where = f"{user.dictionary_file}, line {number}"
            return Finding(Level.FAIL, f"{where}: no name:password", "correct the line")
        names.append(name)
    unknown = {name for who in security.names().values() for name in who} - set(names)
    details = (f"may connect: {', '.join(names) or 'nobody'}", _recording(bus, user.name))
    if user.dictionary_file and unknown:
        missing = ", ".join(sorted(unknown))
        found = f"user {user.name!r}; {missing}: a role, but no password"
        return Finding(Level.WARN, found, f"add lines to {user.dictionary_file}", details)
    return Finding(
        Level.OK, f"user {user.name!r}; {len(names)} others may connect", details=details
    )


def _recording(bus: BusConfig, name: str) -> str:
    if name in bus.security.roles.recorder:
        return "a recorder that it starts itself (--record) may hear everything"
    where = "bus.security.roles.recorder" if bus.listen else "the recorders of the router"
    return f"to record with --record, add {name!r} to {where}"


def _level(mode: int) -> Level:
    if mode & (stat.S_IROTH | stat.S_IWOTH):
        return Level.FAIL
    return Level.WARN if mode & (stat.S_IRGRP | stat.S_IWGRP) else Level.OK
