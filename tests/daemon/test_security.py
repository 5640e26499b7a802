"""Who shows no name, or speaks out of turn, is not heard; the mission does not notice."""

from __future__ import annotations

import contextlib
import json
import socket
import subprocess
import time

import pytest
import zenoh
import zenoh.ext

from fasaco_edge.daemon.loop.inbox import MAP_SPACING_S
from tests.support.outsider import Collector, Outsider, open_client
from tests.support.processes import PROGRAM, daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pillared_room, pose_bytes, room
from tests.support.secured import NAMES, authority, needs_openssl, secured_daemon, transport
from tests.support.waiting import until

pytestmark = needs_openssl
START = json.dumps({"command": "start"}).encode()
PAUSE = json.dumps({"command": "pause"}).encode()
# What is refused is refused in silence: for so long nothing comes of it [s].
SILENCE_S = 0.5


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    with secured_daemon(tmp_path_factory.mktemp("house")) as running:
        begin(running)
        yield running


def begin(house):
    with house.guest("boss") as boss, house.sender("slam") as slam:
        slam.put("map", map_bytes(pillared_room()))
        slam.put("pose", pose_bytes(0.75, 0.75))
        boss.wait_status(lambda s: s["state"] == "covering" and not s["plan"]["planning"])


@pytest.fixture
def boss(house):
    with house.guest("boss") as session:
        yield session


def mission(status):
    return {key: status[key] for key in ("state", "map", "pose", "coverage", "path", "errors")}


@pytest.fixture
def unharmed(boss):
    before = boss.ask_status()
    yield
    time.sleep(SILENCE_S)
    assert mission(boss.ask_status()) == mission(before)


def test_a_mapper_may_publish_and_a_viewer_may_view(house, boss):
    with house.guest("eye") as eye, house.sender("slam") as slam:
        path = eye.listen("path")
        path.wait(lambda heard: heard.payload != b"")
        revision = boss.ask_status()["map"]["revision"]
        slam.put("map", map_bytes(pillared_room()))
        eye.wait_status(lambda status: status["map"]["revision"] == revision + 1)
        assert len(eye.get("@rpc/coverage")) == 1


@pytest.fixture
def senders(house):
    with contextlib.ExitStack() as stack:
        yield lambda names: [stack.enter_context(house.sender(name)) for name in names]


def test_other_roles_cannot_publish_maps_and_poses(senders, unharmed):
    for sender in senders(name for name in NAMES if name != "slam"):
        sender.put("map", map_bytes(room(3.0, 3.0)))
        sender.put("map_update", b"")
        sender.put("pose", pose_bytes(1.5, 1.5))


def test_a_mapper_may_not_speak_to_many_at_once(senders, unharmed):
    (slam,) = senders(["slam"])
    for key in ("fasaco/@v1/*/map", "fasaco/@v1/**", "fasaco/@v1/robot/*", "**"):
        slam.session.put(key, map_bytes(room(3.0, 3.0)))


def test_other_roles_cannot_command(senders, unharmed):
    replies = [
        sender.session.get(f"{sender.prefix}/@rpc/mission", timeout=SILENCE_S, payload=payload)
        for sender in senders(name for name in NAMES if name != "boss")
        for payload in (PAUSE, None)
    ]
    assert [list(each) for each in replies] == [[]] * len(replies)


def test_an_operator_commands(boss):
    key = f"{boss.prefix}/@rpc/mission"
    for payload, state in ((PAUSE, "paused"), (b'{"command":"resume"}', "covering")):
        (reply,) = boss.session.get(key, timeout=60.0, payload=payload)
        assert reply.ok is not None
        boss.wait_status(lambda status, state=state: status["state"] == state)


def test_a_participant_without_a_role_receives_nothing(house):
    receiver, tokens = Collector(), []
    with house.sender("stranger") as stranger:
        session, prefix = stranger.session, stranger.prefix
        for key in (f"{prefix}/status", f"{prefix}/**", "fasaco/@v1/**", "**", "@/**"):
            session.declare_subscriber(key, receiver)
        history = zenoh.ext.HistoryConfig(max_samples=1, detect_late_publishers=True)
        zenoh.ext.declare_advanced_subscriber(session, f"{prefix}/path", receiver, history=history)
        for key in (f"{prefix}/alive", f"{prefix}/**", "**", f"{prefix}/path/@adv/**"):
            session.liveliness().declare_subscriber(key, tokens.append, history=True)
            assert list(session.liveliness().get(key, timeout=SILENCE_S)) == []
        for key in (f"{prefix}/status", f"{prefix}/@rpc/status", "**", f"{prefix}/path/@adv/**"):
            assert list(session.get(key, timeout=SILENCE_S)) == []
        time.sleep(1.2)  # longer than from one status to the next
    assert receiver.heard == []
    assert tokens == []


def test_no_other_role_can_publish_as_the_robot(senders, boss):
    """Neither by what it says, nor by an answer, nor by a token."""
    receiver = boss.listen("path", late=False)
    for sender in senders(["eye", "slam", "boss", "stranger"]):
        sender.session.put(f"{sender.prefix}/path", b"elsewhere")
        sender.session.put(f"{sender.prefix}/status", b"{}")
        sender.session.delete(f"{sender.prefix}/path")
        sender.session.liveliness().declare_token(f"{sender.prefix}/alive")
        sender.session.declare_queryable(
            f"{sender.prefix}/@rpc/status", lambda query: query.reply(query.key_expr, b"{}")
        )
    time.sleep(SILENCE_S)
    assert boss.ask("@rpc/status").json()["robot"] == "robot"
    tokens = list(boss.session.liveliness().get(f"{boss.prefix}/alive", timeout=2.0))
    assert len(tokens) == 1
    assert receiver.heard == []
    assert boss.alive()


def test_a_map_beyond_the_limit_is_dropped_unread(tmp_path):
    with secured_daemon(
        tmp_path, security={"limits": {"map_bytes": 20_000, "queries_hz": 10_000.0}}
    ) as house:
        begin(house)
        with house.guest("boss") as boss, house.sender("slam") as slam:
            before = boss.ask_status()
            large, good = map_bytes(room(9.0, 9.0)), map_bytes(pillared_room())
            assert len(good) < 20_000 < len(large)
            slam.put("map", large)
            time.sleep(SILENCE_S)
            assert mission(boss.ask_status()) == mission(before)
            slam.put("map", good)
            boss.wait_status(lambda s: s["map"]["revision"] == before["map"]["revision"] + 1)


def test_a_flood_of_maps_is_thinned_and_ends_with_the_newest(house, boss):
    before = boss.ask_status()
    flood, last = map_bytes(pillared_room()), map_bytes(pillared_room(), stamp_ns=7)
    with house.sender("slam") as slam:
        began = time.monotonic()
        for _ in range(300):
            slam.put("map", flood)
        time.sleep(0.05)
        slam.put("map", last)
        after = boss.wait_status(lambda status: status["map"]["stamp_ns"] == 7)
        taken = after["map"]["revision"] - before["map"]["revision"]
        assert 1 <= taken <= (time.monotonic() - began) / MAP_SPACING_S + 2
        time.sleep(0.05)  # sooner than 10 ms after the one before, it would be let go
        slam.put("map", flood)
        boss.wait_status(lambda status: status["map"]["stamp_ns"] == 1)
    assert after["state"] == before["state"]
    assert after["errors"] == before["errors"]


def test_questions_without_end_are_thinned(tmp_path):
    with (
        secured_daemon(tmp_path, security={"limits": {"queries_hz": 20.0}}) as house,
        house.guest("eye") as eye,
    ):
        time.sleep(0.1)
        began = time.monotonic()
        answered = sum(len(eye.get("@rpc/status")) for _ in range(100))
        assert 1 <= answered <= 20 * (time.monotonic() - began) + 1
        time.sleep(0.1)
        assert len(eye.get("@rpc/status")) == 1


def test_missing_foreign_or_outdated_certificates_are_refused(house, tmp_path, unharmed):
    foreign = authority(tmp_path / "foreign", "boss").files("boss")
    foreign["root_ca"] = house.ca.root
    outdated = house.ca.sign("late", days=-1)
    for files in ({"root_ca": house.ca.root}, foreign, outdated):
        config = {
            "mode": "client",
            "connect": {"endpoints": [house.endpoint], "timeout_ms": 0},
            "transport": transport(files),
        }
        with pytest.raises(zenoh.ZError):
            zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


def test_garbage_and_half_open_sockets_are_survived(house, unharmed):
    host, _, port = house.endpoint.removeprefix("tls/").partition(":")
    open_sockets = [socket.create_connection((host, int(port))) for _ in range(20)]
    for number, raw in enumerate(open_sockets[:10]):
        raw.sendall(bytes([22, 3, 1, 255, 255] if number % 2 else range(256)) * 40)
    time.sleep(SILENCE_S)
    with house.guest("eye") as eye:
        assert eye.ask_status()["robot"] == "robot"
    for raw in open_sockets:
        raw.close()


def test_the_command_line_shows_a_certificate(house, tmp_path):
    def ask(name, files=None):
        file = tmp_path / f"{name}.yaml"
        file.write_text(json.dumps({"kind": "tls", "tls": files or house.ca.files(name)}))
        words = ["mission", "status", "--json", "--timeout", "2", "--connect", house.endpoint]
        command = [*PROGRAM, *words, "--security", str(file)]
        return subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)

    allowed, refused = ask("boss"), ask("eye")
    assert json.loads(allowed.stdout)["robot"] == "robot"
    assert refused.returncode == 1
    assert "no daemon answers" in refused.stderr
    # Zenoh says no more than that it cannot connect.
    outdated = ask("outdated", house.ca.sign("outdated", days=-1))
    assert "outdated.pem: certificate has expired" in outdated.stderr
    assert "opens no session: it hangs, is not on a Zenoh bus, or requires" in outdated.stderr
    foreign = authority(tmp_path / "foreign", "boss").files("boss")
    assert "boss.pem: unable to get" in ask("foreign", foreign | {"root_ca": house.ca.root}).stderr


def test_a_daemon_with_an_outdated_certificate_says_so(tmp_path):
    late = authority(tmp_path / "late").sign("robot", days=-1)
    with secured_daemon(tmp_path, security={"tls": late}) as house:
        until(lambda: "robot.pem: certificate has expired" in house.daemon.log_text())


def test_a_recorder_of_the_daemon_shows_its_certificate(tmp_path):
    pytest.importorskip("rerun")
    roles = {"roles": {"recorder": ["robot"], "operator": ["boss"]}}
    with (
        secured_daemon(tmp_path, "--record", str(tmp_path), security=roles) as house,
        house.guest("boss") as boss,
    ):
        said = boss.wait_status(lambda s: (s["recorder"] or {}).get("state") == "recording")
        assert said["recorder"]["restarts"] == 0


def test_user_and_password(tmp_path):
    for name, text in (("own.txt", "own-secret\n"), ("all.txt", "slam:one\nboss:two\n")):
        (tmp_path / name).write_text(text)
    who = {"name": "robot", "password_file": str(tmp_path / "own.txt")}
    who["dictionary_file"] = str(tmp_path / "all.txt")
    roles = {"mapper": ["slam"], "operator": ["boss"]}
    bus = {
        "listen": [free_endpoint()],
        "security": {
            "kind": "user",
            "user": who,
            "roles": roles,
            "limits": {"queries_hz": 10_000.0},
        },
    }

    def shown(user, password):
        return {"auth": {"usrpwd": {"user": user, "password": password}}}

    with daemon_process(tmp_path, bus=bus) as daemon:
        with Outsider(daemon.endpoint, transport=shown("boss", "two")) as boss:
            assert "own-secret" not in boss.ask("@rpc/status").payload.decode()
            slam = open_client(daemon.endpoint, shown("slam", "one"))
            boss.put("map", map_bytes(pillared_room()))
            time.sleep(SILENCE_S)
            assert boss.ask_status()["state"] == "waiting for map"
            slam.put(f"{boss.prefix}/map", map_bytes(pillared_room()))
            boss.wait_status(lambda status: status["state"] == "waiting for pose")
            slam.close()
            for wrong in (shown("boss", "one"), shown("ghost", "two"), {}):
                config = {
                    "mode": "client",
                    "connect": {"endpoints": [daemon.endpoint], "timeout_ms": 0},
                    "transport": wrong,
                }
                with pytest.raises(zenoh.ZError):
                    zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        assert "secret" not in daemon.log_text()
