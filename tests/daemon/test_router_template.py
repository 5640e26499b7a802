"""Two daemons behind the router of protocol/config/router.json5: to each its own."""

from __future__ import annotations

import contextlib
import time

import pytest
import zenoh

from fasaco_edge.host.resources import folder
from tests.daemon.test_security import PAUSE, SILENCE_S
from tests.support.outsider import Outsider, open_client
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pillared_room, pose_bytes
from tests.support.secured import authority, needs_openssl, transport
from tests.support.waiting import until

pytestmark = needs_openssl
FLEET = ("r1", "r2")
NAMES = ("router", *FLEET, "slam-r1", "slam-r2", "tablet", "office")


@pytest.fixture(scope="module")
def ca(tmp_path_factory):
    return authority(tmp_path_factory.mktemp("fleet") / "ca", *NAMES)


@pytest.fixture(scope="module")
def endpoint(ca, tmp_path_factory):
    listens = free_endpoint().replace("tcp/", "tls/")
    text = (folder("protocol") / "config" / "router.json5").read_text()
    text = text.replace("/etc/fasaco-edge", str(ca.folder)).replace("tls/0.0.0.0:7447", listens)
    connects = listens.replace("127.0.0.1", "localhost")
    with contextlib.ExitStack() as stack:
        stack.enter_context(zenoh.open(zenoh.Config.from_json5(text)))
        for name in FLEET:
            security = {"kind": "tls", "tls": ca.files(name), "roles": {"router": ["router"]}}
            bus = {"mode": "client", "listen": [], "connect": [connects], "security": security}
            place = tmp_path_factory.mktemp(name)
            fleet = {"name": "hall"}
            stack.enter_context(daemon_process(place, bus=bus, robot={"name": name}, fleet=fleet))
        yield connects


@pytest.fixture
def sender(ca, endpoint):
    with contextlib.ExitStack() as stack:
        yield lambda name: stack.enter_context(open_client(endpoint, transport(ca.files(name))))


@pytest.fixture
def office(ca, endpoint):
    with contextlib.ExitStack() as stack:
        seats = [Outsider(endpoint, name, transport(ca.files("office"))) for name in FLEET]
        yield [stack.enter_context(seat) for seat in seats]


def status(seat):
    time.sleep(0.05)  # the router passes a hundred queries a second
    return seat.ask_status()


def members(seat):
    return [member["name"] for member in status(seat)["fleet"]["members"]]


def test_a_mapper_reaches_only_its_own_robot(office, sender):
    first, second = office
    slam = sender("slam-r1")
    for robot in FLEET:
        slam.put(f"fasaco/@v1/{robot}/map", map_bytes(pillared_room()))
        slam.put(f"fasaco/@v1/{robot}/pose", pose_bytes(0.75, 0.75))
    slam.put("fasaco/@v1/*/map", map_bytes(pillared_room()))
    path = first.listen("path")
    path.wait(lambda heard: heard.payload != b"")
    time.sleep(SILENCE_S)
    assert status(first)["map"]["revision"] == 1
    assert status(second)["state"] == "waiting for map"


def test_an_operator_commands_both(office):
    for seat in office:
        (reply,) = seat.session.get(f"{seat.prefix}/@rpc/mission", payload=PAUSE, timeout=60.0)
        assert reply.ok is not None


def test_a_robot_does_not_pass_for_another_nor_command_it(office, sender):
    robot, second = sender("r1"), office[1]
    before = status(second)
    receiver = second.listen("status", late=False)
    robot.put("fasaco/@v1/r2/status", b"{}")
    robot.put("fasaco/@v1/r2/map", map_bytes(pillared_room()))
    assert list(robot.get("fasaco/@v1/r2/@rpc/mission", timeout=SILENCE_S, payload=PAUSE)) == []
    # What the daemon itself says once a second, after all of that.
    receiver.wait(lambda heard: heard.json().get("uptime_s", 0.0) > before["uptime_s"] + 1.0)
    assert all(heard.json().get("robot") == "r2" for heard in receiver.heard)
    assert status(second)["map"] == before["map"]


def test_robots_of_a_fleet_receive_all_but_publish_as_themselves(office, sender):
    for seat, name in zip(office, FLEET, strict=True):
        slam, deadline = sender(f"slam-{name}"), time.monotonic() + 60.0
        # Another session at once: what it says first may come before who listens is known to it.
        while not (told := status(seat))["map"] or not told["pose"]:
            assert time.monotonic() < deadline, told
            slam.put(f"fasaco/@v1/{name}/map", map_bytes(pillared_room()))
            slam.put(f"fasaco/@v1/{name}/pose", pose_bytes(0.75, 0.75))
            time.sleep(0.5)
    receiver = office[0].listen("fleet", late=False)
    for seat, other in zip(office, reversed(FLEET), strict=True):
        until(lambda seat=seat, other=other: members(seat) == [other])
    said = receiver.wait(lambda heard: True).payload
    for name in ("r1", "slam-r1", "tablet"):
        sender(name).put("fasaco/@v1/r3/fleet", said)
    time.sleep(SILENCE_S)
    assert members(office[1]) == ["r1"]


def test_a_viewer_views_both(ca, endpoint):
    for name in FLEET:
        with Outsider(endpoint, name, transport(ca.files("tablet"))) as tablet:
            assert status(tablet)["robot"] == name
            key = f"{tablet.prefix}/@rpc/mission"
            assert list(tablet.session.get(key, timeout=SILENCE_S, payload=PAUSE)) == []


def test_only_a_robot_can_claim_its_own_name(office, sender, ca, endpoint, tmp_path):
    """Whoever else says that it plans is not heard; a second daemon with its certificate is."""
    sessions = [sender(name) for name in ("slam-r1", "tablet", "office", "r2")]
    tokens = [s.liveliness().declare_token("fasaco/@v1/r1/claim/0/plans") for s in sessions]
    time.sleep(SILENCE_S)
    assert status(office[0])["claim"]["stand"] == "plans"
    assert len(tokens) == len(sessions)
    security = {"kind": "tls", "tls": ca.files("r1"), "roles": {"router": ["router"]}}
    bus = {"mode": "client", "listen": [], "connect": [endpoint], "security": security}
    with daemon_process(tmp_path, bus=bus, robot={"name": "r1"}) as second:
        until(lambda: "this one waits" in second.log_text(), why=second.log_text)
        assert status(office[0])["claim"]["id"] in second.log_text()
