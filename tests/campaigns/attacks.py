"""What an attacker might try against a daemon behind mutual TLS; each says what came of it."""

from __future__ import annotations

import contextlib
import json
import random
import socket
import ssl
import time
from collections.abc import Callable, Iterator
from typing import Any

import zenoh

from tests.support.outsider import open_client
from tests.support.rooms import map_bytes, pose_bytes, room, update_bytes
from tests.support.secured import Authority, House, transport

# A map of a megabyte, and the mission's: to get it once more changes nothing.
HALL = room(50.0, 50.0)
GOOD_MAP = map_bytes(HALL)
AT = (0.75, 0.75)
FLOOD_S = 5.0
FLOOD_HZ = 1000.0
PAUSE = b'{"command":"pause"}'
HALF_OPEN = 150
MANY = 5000


def refused(house: House, how: dict[str, Any], endpoint: str = "") -> str:
    """Try to open a session."""
    config = {
        "mode": "client",
        "connect": {"endpoints": [endpoint or house.endpoint], "timeout_ms": 0},
        "transport": how,
    }
    try:
        zenoh.open(zenoh.Config.from_json5(json.dumps(config))).close()  # type: ignore[no-untyped-call]
    except zenoh.ZError:
        return "refused"
    return "LET IN"


def no_certificate(house: House) -> str:
    """Connect without a certificate."""
    return refused(house, transport({"root_ca": house.ca.root}))


def another_ca(house: House, foreign: Authority) -> str:
    """Connect with the operator's name, signed by another CA."""
    return refused(house, transport(foreign.files("boss") | {"root_ca": house.ca.root}))


def outdated(house: House) -> str:
    """Connect with a certificate that has ended."""
    return refused(house, transport(house.ca.sign("late", days=-1)))


def plain_tcp(house: House) -> str:
    """Speak Zenoh without TLS to the port."""
    return refused(
        house, {"unicast": {"open_timeout": 2000}}, house.endpoint.replace("tls/", "tcp/")
    )


def viewer_gives_a_map(house: House) -> str:
    """A viewer publishes a map and a pose."""
    with house.sender("eye") as eye:
        eye.put("map", map_bytes(room(3.0, 3.0)))
        eye.put("pose", pose_bytes(2.0, 2.0))
        time.sleep(0.5)
    return "sent"


def mapper_commands(house: House) -> str:
    """A mapper asks @rpc/mission to pause."""
    with house.sender("slam") as slam:
        key = f"{slam.prefix}/@rpc/mission"
        answers = list(slam.session.get(key, payload=PAUSE, timeout=1.0))
    return f"{len(answers)} answers"


def mapper_speaks_to_all(house: House) -> str:
    """A mapper publishes on fasaco/@v1/** and on **."""
    with house.sender("slam") as slam:
        for key in ("fasaco/@v1/**", "fasaco/@v1/*/map", "**"):
            slam.session.put(key, map_bytes(room(3.0, 3.0)))
        time.sleep(0.5)
    return "sent"


def stranger_listens(house: House) -> str:
    """A certificate without a role subscribes to everything, tokens too."""
    heard: list[Any] = []
    with house.sender("stranger") as stranger:
        for key in ("**", "fasaco/@v1/**", f"{stranger.prefix}/status", f"{stranger.prefix}/alive"):
            stranger.session.declare_subscriber(key, heard.append)
            stranger.session.liveliness().declare_subscriber(key, heard.append, history=True)
        time.sleep(2.5)
    return f"heard {len(heard)}"


def viewer_passes_for_the_robot(house: House) -> str:
    """A viewer gives a path, answers @rpc/status, and shows the robot's token."""
    heard: list[Any] = []
    with house.guest("boss") as boss, house.sender("eye") as eye:
        boss.session.declare_subscriber(f"{boss.prefix}/path", heard.append)
        eye.session.declare_queryable(f"{eye.prefix}/@rpc/status", lambda query: query.drop())
        eye.session.liveliness().declare_token(f"{eye.prefix}/alive")
        eye.session.put(f"{eye.prefix}/path", b"elsewhere")
        time.sleep(0.5)
        answers = boss.get("@rpc/status")
    return f"operator heard {len(heard)} paths, {len(answers)} answer"


def oversized(megabytes: float) -> Callable[[House], str]:
    """Return an attack: a mapper sends one map of that size."""

    def send(house: House) -> str:
        with house.sender("slam") as slam:
            slam.put("map", bytes(int(megabytes * 1e6)))
            time.sleep(2.0)
        return "sent"

    return send


def flood(name: str, topic: str, payload: bytes, hertz: float = FLOOD_HZ) -> Callable[[House], str]:
    """Return an attack: a peer sends one message over and over."""

    def send(house: House) -> str:
        with house.sender(name) as sender:
            return pour(sender.session, f"{sender.prefix}/{topic}", payload, hertz)

    return send


def pour(session: zenoh.Session, key: str, payload: bytes, hertz: float) -> str:
    """Publish at a rate for some seconds, wanted or not; a full link drops what it cannot hold."""
    began, count = time.monotonic(), 0
    while (now := time.monotonic()) < began + FLOOD_S:
        session.put(key, payload, congestion_control=zenoh.CongestionControl.DROP)
        count += 1
        time.sleep(max(0.0, began + count / hertz - now))
    return f"{count / FLOOD_S:.0f}/s put"


def queries(house: House) -> str:
    """A viewer asks for the status as fast as it can, without waiting."""
    with house.sender("eye") as eye:
        began, asked, answers = time.monotonic(), 0, []
        while time.monotonic() < began + FLOOD_S:
            eye.session.get(f"{eye.prefix}/@rpc/status", answers.append, timeout=1.0)
            asked += 1
            time.sleep(0.0005)
        time.sleep(0.5)
    good = sum(reply.ok is not None for reply in answers)
    return f"{asked / FLOOD_S:.0f}/s asked, {good / FLOOD_S:.0f}/s answered"


def garbage(house: House) -> str:
    """Fifty connections of random bytes, some of which begin like TLS."""
    rng = random.Random(0)
    for number in range(50):
        with contextlib.suppress(OSError), raw_socket(house) as raw:
            raw.sendall((b"\x16\x03\x01" if number % 2 else b"") + rng.randbytes(100_000))
    return f"50 x 100 kB sent; {let_in(house)}"


def half_open(house: House) -> str:
    """150 connections that say nothing, and then go; honest ones meanwhile and afterwards."""
    with contextlib.ExitStack() as stack:
        for _ in range(HALF_OPEN):
            stack.enter_context(raw_socket(house))
        meanwhile = let_in(house)
    return f"{meanwhile}; once they had gone: {let_in(house)}"


def half_open_tls(house: House) -> str:
    """150 connections that show a certificate and say nothing more."""
    files = house.ca.files("stranger")
    context = ssl.create_default_context(cafile=files["root_ca"])
    context.load_cert_chain(files["certificate"], files["private_key"])
    with contextlib.ExitStack() as stack, contextlib.suppress(TimeoutError):
        for number in range(HALF_OPEN):
            shown = number
            raw = stack.enter_context(raw_socket(house))
            raw.settimeout(1.0)
            stack.enter_context(context.wrap_socket(raw, server_hostname="localhost"))
    return f"{shown} handshakes; {let_in(house)}"


def let_in(house: House) -> str:
    """Connect as an honest peer, as often as it takes."""
    began = time.monotonic()
    open_client(house.endpoint, transport(house.ca.files("eye"))).close()  # type: ignore[no-untyped-call]
    return f"viewer in after {time.monotonic() - began:.1f} s"


def many_keys(house: House) -> str:
    """A certificate without a role subscribes to 5,000 keys of its own."""
    with house.sender("stranger") as stranger:
        for number in range(MANY):
            stranger.session.declare_subscriber(f"{'x' * 200}/{number}", lambda sample: None)
        time.sleep(2.0)
    return f"{MANY} declared"


@contextlib.contextmanager
def raw_socket(house: House) -> Iterator[socket.socket]:
    """Connect to the daemon's port."""
    host, _, port = house.endpoint.removeprefix("tls/").partition(":")
    with socket.create_connection((host, int(port)), timeout=5.0) as raw:
        yield raw


def attacks(foreign: Authority) -> dict[str, Callable[[House], str]]:
    """Return everything there is to try, by what it is called in the table."""
    update = update_bytes(HALL, 1.0, 1.0, 2.0, 2.0)
    return {
        "no certificate": no_certificate,
        "certificate of another CA": lambda house: another_ca(house, foreign),
        "certificate that has ended": outdated,
        "Zenoh without TLS": plain_tcp,
        "viewer gives map and pose": viewer_gives_a_map,
        "mapper commands": mapper_commands,
        "mapper speaks to many keys": mapper_speaks_to_all,
        "stranger listens to everything": stranger_listens,
        "viewer passes for the robot": viewer_passes_for_the_robot,
        "map of 64.5 MB": oversized(64.5),
        "map of 100 MB": oversized(100.0),
        "mapper: 1,000 maps/s of 1 MB": flood("slam", "map", GOOD_MAP),
        "viewer: 1,000 maps/s of 1 MB": flood("eye", "map", GOOD_MAP),
        "mapper: 20,000 poses/s": flood("slam", "pose", pose_bytes(*AT), 20_000.0),
        "mapper: 1,000 map updates/s": flood("slam", "map_update", update),
        "mapper: 20,000 map updates/s": flood("slam", "map_update", update, 20_000.0),
        "mapper: 1,000 broken maps/s": flood("slam", "map", GOOD_MAP[:-1]),
        "viewer: queries without end": queries,
        "garbage on the port": garbage,
        f"{HALF_OPEN} half-open sockets": half_open,
        f"{HALF_OPEN} silent TLS connections": half_open_tls,
        "stranger subscribes to 5,000 keys": many_keys,
    }
