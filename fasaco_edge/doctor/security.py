"""Checks of access: endpoints, roles, the daemon's identity and its secrets."""

from __future__ import annotations

import stat
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

from fasaco_edge.bus.access import ROLES
from fasaco_edge.config.certificates import read_certificate
from fasaco_edge.config.endpoints import UNIX, is_local, protocol_of
from fasaco_edge.config.security import BusConfig
from fasaco_edge.doctor.finding import CheckContext, Finding, fail, ok, warn
from fasaco_edge.errors import BadConfiguration, ClockBeforeCertificate

SHOWS = {
    "none": "without authentication",
    "tls": "with a certificate of the CA",
    "user": "with a password",
}


def endpoints(context: CheckContext) -> Finding:
    """Check where the daemon listens, and who can reach it from where."""
    bus = context.config.bus
    kind = bus.security.kind
    details = [f"{endpoint}: {_reach(endpoint)}, {SHOWS[kind]}" for endpoint in bus.listen]
    details += [f"{endpoint}: connects there" for endpoint in bus.connect]
    metrics = context.config.metrics
    if (address := metrics.address()) is not None:
        where = "this computer" if ip_address(address.host).is_loopback else "other computers"
        details.append(f"http://{metrics.listen}/metrics: figures, from {where}, without password")
    beyond = [endpoint for endpoint in bus.listen if not is_local(endpoint)]
    if not beyond:
        where = "on this computer only" if bus.listen else "nowhere"
        return ok(f"listens {where}; security: {kind}", details)
    found = f"listens beyond this computer; security: {kind}"
    if kind == "none":
        return warn(
            f"{found}: every program that can connect may send maps, poses and commands",
            "choose bus.security.kind tls, or use a private network",
            details,
        )
    if kind == "user":
        return warn(
            f"{found}: users are authenticated, but traffic is not encrypted",
            "choose bus.security.kind tls if others share the network",
            details,
        )
    return ok(found, details)


def roles(context: CheckContext) -> Finding:
    """Check that each role has a name."""
    security = context.config.bus.security
    if security.kind == "none":
        return ok("no roles: every program that can connect may do everything")
    names = security.names()
    details = [
        f"{role} ({', '.join(who) or 'none'}): {ROLES[role].description}"
        for role, who in names.items()
    ]
    if names["router"] or not context.config.bus.listen:
        missing = [] if names["router"] else ["router"]
    else:
        missing = [role for role in ("mapper", "operator") if not names[role]]
    if missing:
        lacking = " or ".join(missing)
        return warn(
            f"no name has the role {lacking}: its rights are denied to all",
            f"add a name to bus.security.roles.{missing[0]}",
            details,
        )
    count = len({name for who in names.values() for name in who})
    return ok(f"names with a role: {count}; all others may do nothing", details)


def _reach(endpoint: str) -> str:
    if protocol_of(endpoint) in UNIX:
        return "from this computer, where the file's permissions allow it"
    return "from this computer" if is_local(endpoint) else "from other computers"


EXPIRES_SOON = timedelta(days=30)
SECRETS = {"tls": ("private_key",), "user": ("password_file", "dictionary_file")}
HOW_TO = "protocol/security.md, shows how to make them"


def identity(context: CheckContext) -> Finding:
    """Check the daemon's certificate or password, and when it expires."""
    bus = context.config.bus
    security, listens = bus.security, bool(bus.listen)
    if security.kind == "none":
        return ok("no authentication in either direction")
    try:
        security.of_daemon(context.config.keys().prefix)
        if security.kind == "user":
            return _login(bus)
        certificate = read_certificate(security.tls, listens=listens)
    except (BadConfiguration, ClockBeforeCertificate) as error:
        to_do = error.hint if isinstance(error, ClockBeforeCertificate) else HOW_TO
        return fail(str(error), to_do)
    left = certificate.ends - datetime.now(UTC)
    details = [_recording(bus, certificate.name)]
    if listens:
        details.insert(0, f"others connect to it as {', '.join(certificate.hosts) or 'nothing'}")
    found = f"certificate of {certificate.name!r}, ends {certificate.ends:%Y-%m-%d}"
    if not certificate.name or (listens and not certificate.hosts):
        return fail(f"{found}: a name is missing in it", HOW_TO, details)
    if left < EXPIRES_SOON:
        return warn(f"{found}, in {left.days} days", "renew it", details)
    return ok(found, details)


def secret_files(context: CheckContext) -> Finding:
    """Check that others on this computer cannot read keys and passwords."""
    security = context.config.bus.security
    if security.kind == "none":
        return ok("there are none")
    section = getattr(security, security.kind)
    paths = [Path(file) for name in SECRETS[security.kind] if (file := getattr(section, name))]
    modes, details = 0, []
    for path in paths:
        try:
            mode = path.stat().st_mode
        except OSError as error:
            return fail(f"{path}: {error.strerror}", HOW_TO)
        modes |= mode
        details.append(f"{path}: {stat.filemode(mode)}")
    command = "chmod 600 " + " ".join(map(str, paths))
    if modes & (stat.S_IROTH | stat.S_IWOTH):
        return fail("can be read by all users of this computer", command, details)
    if modes & (stat.S_IRGRP | stat.S_IWGRP):
        return warn("can be read by their group", command, details)
    return ok("read by their owner alone", details)


def _login(bus: BusConfig) -> Finding:
    """Check user and password; the files are known to be readable."""
    security, user = bus.security, bus.security.user
    names = []
    text = Path(user.dictionary_file).read_text(encoding="utf-8") if user.dictionary_file else ""
    for number, line in enumerate(text.splitlines(), start=1):
        name, colon, password = line.partition(":")
        if not (name and colon and password):
            where = f"{user.dictionary_file}, line {number}"
            return fail(f"{where}: no name:password", "correct the line")
        names.append(name)
    unknown = {name for who in security.names().values() for name in who} - set(names)
    details = (f"may connect: {', '.join(names) or 'none'}", _recording(bus, user.name))
    if user.dictionary_file and unknown:
        missing = ", ".join(sorted(unknown))
        found = f"user {user.name!r}; {missing}: a role, but no password"
        return warn(found, f"add lines to {user.dictionary_file}", details)
    return ok(f"user {user.name!r}; {len(names)} others may connect", details)


def _recording(bus: BusConfig, name: str) -> str:
    if name in bus.security.roles.recorder:
        return "a recorder that it starts itself (--record) may receive everything"
    where = "bus.security.roles.recorder" if bus.listen else "the recorders of the router"
    return f"to record with --record, add {name!r} to {where}"
