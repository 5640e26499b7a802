"""What is open to whom."""

from __future__ import annotations

from fasaco_edge.bus.access import ROLES
from fasaco_edge.daemon.checks.finding import Finding, Level, Patient
from fasaco_edge.daemon.endpoints import UNIX, is_local, protocol_of
from fasaco_edge.daemon.inbox import MAP_SPACING_S

SHOWS = {
    "none": "by anybody there",
    "tls": "by whoever shows a certificate of the CA",
    "user": "by whoever knows a password",
}


def endpoints(patient: Patient) -> Finding:
    """Tell where the daemon listens, from where that can be reached, and by whom."""
    bus = patient.config.bus
    kind = bus.security.kind
    details = [f"{endpoint}: {_reach(endpoint)}, {SHOWS[kind]}" for endpoint in bus.listen]
    details += [f"{endpoint}: connects there" for endpoint in bus.connect]
    beyond = [endpoint for endpoint in bus.listen if not is_local(endpoint)]
    if not beyond:
        where = "on this computer alone" if bus.listen else "nowhere"
        return Finding(Level.OK, f"listens {where}; security: {kind}", details=tuple(details))
    found = f"listens beyond this computer; security: {kind}"
    if kind == "none":
        return Finding(
            Level.WARN,
            f"{found}: everybody in reach may give maps, poses and commands",
            "choose bus.security.kind tls, or keep the network to yourself",
            tuple(details),
        )
    if kind == "user":
        return Finding(
            Level.WARN,
            f"{found}: names are checked, but all that is said can be read on the way",
            "choose bus.security.kind tls where others share the network",
            tuple(details),
        )
    return Finding(Level.OK, found, details=tuple(details))


def roles(patient: Patient) -> Finding:
    """Tell who may do what."""
    security = patient.config.bus.security
    if security.kind == "none":
        return Finding(Level.OK, "no roles: whoever reaches the daemon may do everything")
    names = security.names()
    details = tuple(
        f"{role} ({', '.join(who) or 'nobody'}): {ROLES[role].told}" for role, who in names.items()
    )
    if names["router"] or not patient.config.bus.listen:
        missing = [] if names["router"] else ["router"]
    else:
        missing = [role for role in ("mapper", "operator") if not names[role]]
    if missing:
        lacking = " or ".join(missing)
        return Finding(
            Level.WARN,
            f"nobody is {lacking}: what that role does, nobody can do",
            f"name somebody in bus.security.roles.{missing[0]}",
            details,
        )
    count = len({name for who in names.values() for name in who})
    return Finding(
        Level.OK, f"names with a role: {count}; everybody else may do nothing", details=details
    )


def limits(patient: Patient) -> Finding:
    """Tell how much each who sends may send."""
    bus = patient.config.bus
    if bus.security.kind == "none" and not bus.open_to_everyone:
        own = f"takes in at most {1 / MAP_SPACING_S:g} maps a second, the newest always"
        return Finding(Level.OK, f"none for who sends; the daemon {own}")
    most = bus.security.limits
    return Finding(
        Level.OK,
        f"of each: maps up to {most.map_bytes / 1e6:.1f} MB, {most.maps_hz:g} maps, "
        f"{most.poses_hz:g} poses and {most.queries_hz:g} queries of a key a second",
    )


def _reach(endpoint: str) -> str:
    if protocol_of(endpoint) in UNIX:
        return "from this computer, where the file's permissions allow it"
    return "from this computer" if is_local(endpoint) else "from other computers"
