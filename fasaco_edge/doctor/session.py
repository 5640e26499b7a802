"""Checks of the bus: whether the daemon can join it, and its participants.

Listeners at an endpoint are found without Zenoh.
"""

from __future__ import annotations

import re
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.claim import claims_in
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings, check_settings
from fasaco_edge.config.endpoints import from_here, host_of, protocol_of
from fasaco_edge.doctor.finding import CheckContext, Finding, fail, ok, warn
from fasaco_edge.errors import BadConfiguration, BusUnavailable, MalformedMessage
from fasaco_edge.text import one_line
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import VERSION
from fasaco_edge.wire.schemas import TF_MESSAGE

ANSWER_S = 0.5
STREAMS = ("tcp", "tls", "ws")


def address_of(endpoint: str) -> tuple[str, int] | None:
    """Return the address of an endpoint for a TCP connection from here; None for other kinds."""
    if protocol_of(endpoint) not in STREAMS:
        return None
    port = re.search(r":(\d+)(?:[?#]|$)", endpoint)
    here = from_here(endpoint)
    return (host_of(here), int(port[1])) if port else None


def answers(endpoint: str) -> bool | None:
    """Return whether a program listens at an endpoint; None if not known."""
    address = address_of(endpoint)
    if address is None:
        return None
    try:
        socket.create_connection(address, timeout=ANSWER_S).close()
    except OSError:
        return False
    return True


def why_not_bound(endpoint: str) -> str:
    """Return why a program could not listen at an endpoint of this computer; "" if it could."""
    address = address_of(endpoint)
    if address is None:
        return ""
    host, port = host_of(endpoint), address[1]
    try:
        place = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(place[0], place[1]) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(place[4])
    except OSError as error:
        return error.strerror or str(error)
    return ""


# Time to listen for maps and poses [s]; poses come ten times a second.
LISTEN_S = 0.7
ASK_S = 0.7
# What to do about two publishers of one input.
ONE_ONLY = "stop all but one: the daemon uses the first it receives, until it is silent"
# Largest number of maps under other names that are listed.
MOST_PLACES = 8
# Positions of the entity's kind and of its topic's type in a token of rmw_zenoh
# (``wire.ros_keys``).
TOKEN_KIND, TOKEN_TYPE = 5, 10


def session(context: CheckContext) -> Finding:
    """Check that the daemon could open its session, or name what prevents it."""
    bus = context.config.bus
    try:
        check_settings(bus.settings(context.config.keys().prefix, context.config.ros2 or None))
    except (BadConfiguration, BusUnavailable) as error:
        return fail(str(error), error.hint)
    details, is_taken = [], False
    for endpoint in bus.listen:
        if answers(from_here(endpoint)):
            is_taken = True
            details.append(f"{endpoint}: a program listens there")
        elif why := why_not_bound(endpoint):
            to_do = "correct bus.listen: that address is not this computer's, or not for this user"
            return fail(f"{endpoint}: no daemon can listen there: {why}", to_do)
        else:
            details.append(f"{endpoint}: free")
    answered = {endpoint: answers(endpoint) for endpoint in bus.connect}
    silent = [endpoint for endpoint, does in answered.items() if does is False]
    details += [f"{endpoint}: no answer" for endpoint in silent]
    if len(silent) == len(bus.connect) > 0:
        # A client with credentials exits, as these may be wrong; systemd restarts it.
        ends = bus.mode == "client" and bus.security.kind != "none"
        make, then = (fail, "does not start") if ends else (warn, "waits for it")
        found = f"no answer at {', '.join(silent)}: the daemon {then}"
        return make(found, "start the router there, or correct bus.connect", details)
    if not is_taken:
        listening = [endpoint for endpoint, does in answered.items() if does]
        where, who = ", ".join(listening or bus.connect), "a program listens there"
        found = f"{where}: {'' if listening else 'only a connection shows whether '}{who}"
        return ok("the endpoints are free" if bus.listen else found, details)
    try:
        with _joined(context) as joined:
            met = " and ".join(joined.met()) or "no other session"
            return ok(f"joined {met} as a client", details)
    except BusUnavailable as error:
        to_do = "stop that program (`ss -ltnp` names it), or choose another port in bus.listen"
        found = f"the program that listens there does not accept a Zenoh session: {error}"
        return fail(found, to_do, details)


def lacking_inputs(status: Status) -> list[str]:
    """Return the inputs that a daemon waits for; none while it loads."""
    if status.state == "loading":
        return []
    return [kind for kind in ("map", "pose") if getattr(status, kind) is None]


def peers(context: CheckContext, listen_s: float = LISTEN_S) -> Finding:
    """Check the participants of the bus: daemon, other robots, and publishers of maps and poses.

    ``listen_s``: time to listen for maps and poses [s].
    """
    if not any(answers(endpoint) is not False for endpoint in _ways(context)):
        return ok("neither a daemon nor a router answers")
    try:
        with _joined(context) as bus:
            return _seen(context, bus, listen_s)
    except (BadConfiguration, BusUnavailable) as error:
        return warn(f"could not connect: {error}", error.hint)


def _seen(context: CheckContext, bus: Bus, listen_s: float) -> Finding:
    keys, ros = context.config.keys(), context.config.ros2
    wanted = {"map": [keys.of(topics.MAP)], "pose": [keys.of(topics.POSE)]}
    chained = set[str]()
    if ros:
        poses = [topic for name, topic in ros.inputs.items() if name in ("pose", "tf_static")]
        wanted["map"].append(ros.input_key(ros.inputs["map"]))
        wanted["pose"] += map(ros.input_key, poses)
        # Each link of a chain of transforms has a publisher of its own.
        chained |= {ros.input_key(topic) for topic in poses if topic.schema == TF_MESSAGE}
    elsewhere = MapsElsewhere(bus, wanted["map"])
    received = _listen(bus, wanted, listen_s, chained)
    alive = bus.alive(f"{keys.base}/{VERSION}/*/alive", ASK_S)
    others = sorted(key.split("/")[-2] for key in alive if key != keys.of(topics.ALIVE))
    details = [f"other robots: {', '.join(others)}"] if others else []
    details += [f"a map elsewhere: {place}" for place in elsewhere.places()]
    claims = claims_in(bus.alive(keys.of(topics.CLAIM), ASK_S))
    details += [f"daemon {own} {stand}" for own, stand in sorted(claims.items())]
    status = _status(bus, keys.rpc("status")) if keys.of(topics.ALIVE) in alive else None
    for kind, senders in received.items():
        count = senders.total()
        details.append(f"{kind}: {count or 'nothing received'} in {listen_s:g} s")
    several = _several(bus, received)
    if keys.of(topics.ALIVE) not in alive:
        found = f"no daemon of robot {keys.robot!r}; {_in_words(received)}"
        return warn(f"{found}; {several}", ONE_ONLY, details) if several else ok(found, details)
    if status is None:
        found = "the daemon runs, but does not answer status queries"
        to_do = "connect under a name with the role viewer (bus.security.roles)"
        return warn(found, to_do, details)
    found = f"the daemon runs: {status.state}, {status.reason}"
    if len(claims) > 1:
        found = f"{len(claims)} daemons have the name {keys.robot!r}, of which one plans; {found}"
        to_do = "stop those that wait, or give each a name of its own (robot.name)"
        return warn(found, to_do, details)
    if lacking := lacking_inputs(status):
        keys_lacking = ", ".join(key for kind in lacking for key in wanted[kind])
        found = f"{found}; it has no {' and '.join(lacking)}"
        come = all(received[kind] for kind in lacking)
        to_do = f"{'correct what comes' if come else 'publish'} on {keys_lacking}"
        if "map" in lacking and elsewhere.places():
            to_do += (
                ", or use a map found elsewhere: set robot.name, bus.base, ros2.domain and "
                "ros2.namespace to those of that map"
            )
        return warn(found, to_do, details)
    if status.troubles:
        # While the robot drives, a trouble is the reason of its state.
        texts = [each.text for each in status.troubles if each.text != status.reason]
        to_do = "; ".join(each.do for each in status.troubles)
        return warn("; ".join((found, *texts)), to_do, details)
    return warn(f"{found}; {several}", ONE_ONLY, details) if several else ok(found, details)


class MapsElsewhere:
    """Maps that are published under other names than this daemon's map; ``own``: its names."""

    def __init__(self, bus: Bus, own: list[str]) -> None:
        self._bus = bus
        self._own = own
        self._keys: set[str] = set()
        # Maps on the native key of any robot, and on the key of a bridge in any namespace.
        for key in (f"**/{VERSION}/*/{topics.MAP.suffix}", f"**/{topics.MAP.suffix}"):
            bus.subscribe(key, lambda sample: self._keys.add(sample.key), latched=True)

    def places(self) -> list[str]:
        """Return the keys and topics of maps, at most ``MOST_PLACES``.

        Topics of rmw_zenoh are found by their tokens.
        """
        found = {f"key {key}" for key in set(self._keys) if key not in self._own}
        for token in self._bus.alive("@ros2_lv/**", ASK_S):
            parts = token.split("/")
            is_map = len(parts) > TOKEN_TYPE and "OccupancyGrid_" in parts[TOKEN_TYPE]
            if not is_map or parts[TOKEN_KIND] != "MP":
                continue
            topic = parts[TOKEN_TYPE - 1].replace("%", "/")
            is_own = any(key.startswith(f"{parts[1]}{topic}/") for key in self._own)
            # Costmaps, and the daemon's coverage, are occupancy grids, too.
            if topic.endswith(f"/{topics.MAP.name}") and not is_own:
                found.add(f"ROS_DOMAIN_ID {parts[1]}, topic {topic}")
        return sorted(one_line(place) for place in found)[:MOST_PLACES]


def _listen(
    bus: Bus, wanted: dict[str, list[str]], listen_s: float, chained: Collection[str] = ()
) -> dict[str, Counter[str]]:
    """Return for each kind the number of samples from each session, by its id.

    The id is "" for unknown sessions, and for samples on the keys ``chained``.
    """
    received, lock = {kind: Counter[str]() for kind in wanted}, threading.Lock()

    def counting(kind: str, *, is_chained: bool) -> Callable[[Sample], None]:
        def count(sample: Sample) -> None:
            with lock:
                received[kind]["" if is_chained else sample.sender] += 1

        return count

    for kind, kinds_keys in wanted.items():
        for key in kinds_keys:
            take = counting(kind, is_chained=key in chained)
            bus.subscribe(key, take, latched=True)
    time.sleep(listen_s)
    with lock:
        return {kind: Counter(senders) for kind, senders in received.items()}


def _several(bus: Bus, received: dict[str, Counter[str]]) -> str:
    """Return the kinds that come from several publishers, in words, or ""."""
    counts = {
        kind: sum(1 for each in senders if each and not bus.is_relay(each))
        for kind, senders in received.items()
    }
    return "; ".join(f"{n} publishers of {kind}s" for kind, n in counts.items() if n > 1)


def _in_words(received: dict[str, Counter[str]]) -> str:
    there = [f"{kind}s" for kind, senders in received.items() if senders]
    return f"{' and '.join(there)} received" if there else "no maps and no poses received"


def _status(bus: Bus, key: str) -> Status | None:
    for reply in bus.get(key, ASK_S):
        if not reply.is_error:
            try:
                return decode_tolerant(reply.payload, Status)
            except MalformedMessage:
                return None
    return None


def _ways(context: CheckContext) -> list[str]:
    bus = context.config.bus
    return [*map(from_here, bus.listen), *bus.connect]


@contextmanager
def _joined(context: CheckContext) -> Iterator[Bus]:
    """Join the bus as an additional client, by the endpoints that answer."""
    ways = tuple(way for way in _ways(context) if answers(way) is not False)
    secured = context.config.bus.security.of_client()
    with open_bus(BusSettings("client", ways, (), secured)) as bus:
        yield bus
