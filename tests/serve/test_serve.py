"""The served page: a real daemon, a real server, real viewers."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import re
import socket
import stat
import sys
import time
from array import array
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("websockets")

from websockets.exceptions import ConnectionClosed, InvalidStatus

from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli import serve as cli_serve
from fasaco_edge.client.feed import Feed
from fasaco_edge.host.addresses import Address, read_address
from fasaco_edge.host.processes import own_mb
from fasaco_edge.serve import viewer
from fasaco_edge.serve.guard import Guard, guard_for
from fasaco_edge.serve.messages import message_text
from fasaco_edge.serve.served_view import ServedView
from fasaco_edge.serve.server import MOST_STRANGERS, MOST_VIEWERS, LiveServer
from fasaco_edge.wire.keys import Keys
from tests.serve.serving import Served, listens, looking, served
from tests.support.outsider import TIMEOUT_S, Outsider, joined_daemon
from tests.support.processes import (
    Daemon,
    daemon_process,
    fasaco_edge,
    free_endpoint,
    mapped_files,
)
from tests.support.rooms import HALL, begin, lanes, map_bytes, pose_bytes, show_room, update_bytes
from tests.support.waiting import until

# Memory of its own at most, without pages of files [MB].
SERVE_MB = 24.0
ROOM = {"name": "by the door", "polygon": [[0.5, 0.5], [3.0, 0.5], [3.0, 3.0], [0.5, 3.0]]}


def is_told(said: dict[str, Any]) -> bool:
    return said.get("state") in ("covering", "degraded")


@pytest.fixture(scope="module")
def covering(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    mission = {
        "zones": [{"name": "corner", "polygon": [[3, 3], [5, 3], [5, 4], [3, 4]]}],
        "keep_out": [[[4, 1], [4.5, 1], [4.5, 1.5], [4, 1.5]]],
    }
    with daemon_process(tmp_path_factory.mktemp("daemon"), mission=mission) as running:
        with Outsider(running.endpoint) as outsider:
            begin(outsider)
        yield running


@pytest.fixture(scope="module")
def page(covering: Daemon, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with served(tmp_path_factory.mktemp("page"), covering.endpoint) as running:
        yield running


def test_the_page_is_one_file_that_runs_only_what_is_in_it(page):
    status, headers, body = page.get()
    assert status == 200
    policy = headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'; ")
    for kind in ("script", "style"):
        (text,) = re.findall(f"<{kind}>(.*?)</{kind}>", body, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in policy
    assert not re.search(r"(src|href|url\()\s*=?\s*[\"']?(https?:)?//", body)
    assert " on" not in re.findall(r"<body.*?<script>", body, re.DOTALL)[0].replace(" once", "")
    assert page.get("/other")[0] == 404
    assert page.get("/live")[0] == 426


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("localhost:1", 200),
        ("[::1]:8465", 200),
        ("192.168.1.20", 200),
        (socket.gethostname(), 200),
        ("evil.example", 421),
        ("evil.example:8465", 421),
        ("[fe80::1%'; script-src *]:80", 421),
        ("127.0.0.1.evil.example", 421),
    ],
)
def test_only_names_of_its_own_are_answered(page, host, status):
    """A name of somebody else that points here is DNS rebinding."""
    assert page.get(Host=host)[0] == status


def test_a_page_of_another_server_gets_no_socket(page):
    with pytest.raises(InvalidStatus, match="403"), looking(page, origin="http://evil.example"):
        pass
    with looking(page, origin=f"http://{page.address}") as looker:
        assert looker.wait("welcome")["role"] == "viewer"


def test_a_viewer_sees_the_mission(covering, page):
    began = time.monotonic()
    with looking(page) as looker:
        # Nobody keeps the map: what is free shows the lattice until there is one.
        assert looker.wait("map")["pixel"] in (0.3, 0.05)
        print(f"first map after {time.monotonic() - began:.2f} s")
        rows, cols = HALL.shape
        with Outsider(covering.endpoint) as outsider:
            outsider.put("map", map_bytes(HALL))
            grid = looker.wait("map", lambda grid: grid["pixel"] == 0.05)
        assert (grid["rows"], grid["cols"], grid["pixel"]) == (rows, cols, 0.05)
        marks = np.frombuffer(grid["body"], np.uint8).reshape(rows, cols)
        assert (marks == np.where(HALL == 100, 2, 1)).all()
        # Status and path come each on its own.
        state = looker.wait("state", lambda state: state.get("state") == "covering")
        assert state["absent"] == ""
        path = looker.wait("path")
        points = array("f", path["body"])
        x, y = lanes(1)[0]
        assert len(points) > 100
        pose = looker.wait("pose")
        assert (pose["x"], pose["y"]) == (round(x, 3), round(y, 3))
        areas = looker.wait("areas", lambda areas: areas["zones"])
        assert [zone["name"] for zone in areas["zones"]] == ["corner"]
        assert areas["keep_out"][0]["is"] == "standing"
        looker.wait("floor", lambda floor: max(floor["body"]) == 127)
        assert "field" not in looker.seen
        looker.send(kind="wants", field=True)
        looker.wait("field", lambda field: max(field["body"]) == 127)
        with Outsider(covering.endpoint) as outsider:
            x, y = lanes(2)[1]
            outsider.put("pose", pose_bytes(x, y))
            looker.wait("pose", lambda pose: pose["x"] == round(x, 3))
            pixels = HALL.copy()
            pixels[80:85, 100:105] = 100
            outsider.put("map_update", update_bytes(pixels, 5.0, 4.0, 5.25, 4.25))
            looker.wait("map", lambda grid: grid["body"][82 * cols + 102] == 2)


def test_it_stays_small(covering, page):
    with looking(page) as looker:
        looker.wait("map")
        looker.wait("path")
        pid = page.process.pid
        resident = own_mb(pid)
        print(f"serve: {resident:.1f} MB")
        assert resident < SERVE_MB
        mapped = mapped_files(pid)
        assert [name for name in ("numba", "numpy", "rerun", "PIL") if name in mapped] == []


@pytest.mark.parametrize("said", ["", "{", '{"kind":"command"}', '{"kind":"hello"}', "[" * 9999])
def test_nonsense_ends_only_that_viewer(page, said):
    with looking(page) as other, looking(page) as looker:
        other.wait("welcome")
        looker.wait("welcome")
        looker.socket.send(said)
        if said != '{"kind":"hello"}':
            with pytest.raises(ConnectionClosed):
                looker.wait("never")
        other.seen.clear()
        other.send(kind="wants", field=False)
        other.command("pause")


def test_a_mission_is_run_from_the_page(tmp_path):
    with daemon_process(tmp_path, mission={"autostart": False}) as daemon:
        words = ("--allow-commands",)
        with (
            Outsider(daemon.endpoint) as outsider,
            served(tmp_path, daemon.endpoint, *words) as page,
            looking(page) as looker,
        ):
            assert looker.wait("welcome")["role"] == "operator"
            show_room(outsider, HALL, *lanes(1)[0])
            outsider.wait_status(lambda status: status["state"] == "idle")
            looker.wait("state", lambda state: state.get("state"))
            keep_out = [[2.0, 2.0], [2.4, 2.0], [2.4, 2.4], [2.0, 2.4]]
            order = {"zones": [ROOM], "keep_out": [keep_out], "passes": 2, "return_home": True}
            assert looker.command("start", order)["ok"]
            mission = outsider.wait_status(lambda s: s["state"] == "covering")["mission"]
            assert [(zone["name"], zone["passes"]) for zone in mission["zones"]] == [
                ("by the door", 2)
            ]
            assert mission["keep_out"] == 1
            assert mission["return_home"]
            areas = looker.wait("areas", lambda areas: areas["keep_out"])
            assert areas["zones"] == [{**ROOM, "is": "ordered"}]
            assert areas["keep_out"] == [{"name": "", "polygon": keep_out, "is": "order"}]
            zones = lambda state: state.get("mission", {}).get("zones")  # noqa: E731
            assert looker.wait("state", zones)["mission"]["zones"][0]["name"] == "by the door"
            assert looker.command("pause")["ok"]
            outsider.wait_status(lambda status: status["state"] == "paused")
            assert looker.command("resume")["ok"]
            outsider.wait_status(lambda status: status["state"] == "covering")
            assert looker.command("home")["ok"]
            assert looker.command("cancel")["ok"]
            outsider.wait_status(lambda status: status["mission"]["ordered"] is None)
            bad = {"zones": [{"name": "line", "polygon": [[0, 0], [1, 1]]}]}
            answer = looker.command("start", bad)
            assert answer["ok"] is False
            assert "polygon" in answer["text"]
            assert "mission.json" in answer["hint"]
            # To drop what was covered is no button of a page.
            looker.send(kind="command", id=99, command="reset")
            with pytest.raises(ConnectionClosed):
                looker.wait("answer", lambda said: said["id"] == 99)


def test_a_recording_has_one_link_and_not_the_operators(tmp_path, capsys, monkeypatch):
    tokens, address = tmp_path / "tokens", read_address("--listen", "127.0.0.1:8465", example=8465)
    guard = guard_for(address, tokens, [], allow_commands=False)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    links = []
    for each in (guard, guard.to_look_only()):
        cli_serve._say(address, each, tokens, secured=False)
        links.append(set(capsys.readouterr().out.splitlines()[1:]))
    live, recorded = links
    assert len(live) == 2
    assert recorded == {line for line in live if line.startswith("  viewer: ")}


def test_tokens_say_who_may_look_and_who_may_command(covering, tmp_path):
    file = tmp_path / "tokens"
    with served(tmp_path, covering.endpoint, "--tokens", str(file)) as page:
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
        lines = file.read_text().splitlines()
        tokens = dict(line.split(": ") for line in lines)
        assert list(tokens) == ["viewer", "operator"]
        assert len(set(tokens.values())) == 2
        assert tokens["viewer"] not in page.log.read_text()
        for role, token in tokens.items():
            with looking(page, token) as looker:
                assert looker.wait("welcome")["role"] == role
                looker.wait("state", lambda state: state.get("state"))  # it has joined the bus
                assert looker.command("replan")["ok"] is (role == "operator")
        for wrong in ("", "x" * 32, tokens["viewer"][:-1], "é"):
            with looking(page, wrong) as looker:
                assert looker.wait("denied")["asks"] is (wrong == "")
                with pytest.raises(ConnectionClosed):
                    looker.read()
                assert set(looker.seen) == {"denied"}


def test_other_addresses_need_valid_tokens(tmp_path):
    endpoint = free_endpoint()
    words = ("serve", "--connect", endpoint, "--listen")
    tokens = tmp_path / "tokens"
    tokens.write_text("operator: short\n")
    tokens.chmod(0o600)
    open_ = tmp_path / "open"
    open_.write_text(f"operator: {'x' * 20}\n")
    open_.chmod(0o644)
    # Cut where reading ended, the first twenty letters of a token would be one.
    long = tmp_path / "long"
    long.write_text("# a remark\n".ljust(4065, "#") + f"\noperator: {'x' * 40}\n")
    long.chmod(0o600)
    for more, said in (
        (("127.0.0.1:8465", "--tokens", long), f"{long}: 4117 bytes, at most 4096 are read"),
        (("0.0.0.0:8465",), "without any access control"),
        (("[::]:8465",), "without any access control"),
        (("somewhere:8465",), "must be an address and a port"),
        (("127.0.0.1:8465", "--tokens", tokens), "line 1: must be"),
        (("127.0.0.1:8465", "--tokens", open_), "can be read by others"),
        (("127.0.0.1:8465", "--tokens", tmp_path / "t", "--allow-commands"), "operator's token"),
        (("127.0.0.1:8465", "--certificate", tokens), "go together"),
    ):
        ended = fasaco_edge(*words, *more)
        assert ended.code == 78, ended.err
        assert said in ended.err


def test_a_server_without_its_feed_ends():
    """Else a page would show for ever what was last."""

    class Deaf(Feed):
        def take(self, timeout_s: float) -> list[tuple[str, object]]:
            raise RuntimeError("deaf")

    with Deaf(BusSettings("client", (free_endpoint(),)), Keys()) as feed:
        server = LiveServer(feed, ServedView(Keys()), Guard(frozenset()))
        serving = server.run(Address("127.0.0.1", 0))
        with pytest.raises(RuntimeError, match="deaf"):
            asyncio.run(asyncio.wait_for(serving, TIMEOUT_S))


def test_a_taken_address_is_an_error(page):
    ended = fasaco_edge("serve", "--connect", free_endpoint(), "--listen", page.address)
    assert (ended.code, ended.out) == (1, "")
    assert "cannot listen" in ended.err
    assert "hint: give --listen another port" in ended.err


def test_fifty_viewers_that_come_and_go_leave_nothing(page):
    with looking(page) as looker:
        looker.wait("path")
    before, resident = page.descriptors(), own_mb(page.process.pid)
    for number in range(50):
        with looking(page) as looker:
            looker.wait("map")
            if number % 2:
                looker.socket.socket.shutdown(socket.SHUT_RDWR)
    until(lambda: page.descriptors() <= before, why=page.descriptors)
    grown = own_mb(page.process.pid) - resident
    print(f"fifty viewers: {grown:+.1f} MB")
    assert grown < 8.0


def test_the_number_of_viewers_is_limited(page):
    with ExitStack() as crowd:
        for _ in range(MOST_VIEWERS):
            crowd.enter_context(looking(page)).wait("welcome")
        with pytest.raises(InvalidStatus, match="503"), looking(page):
            pass
    until(lambda: can_look(page))


def test_silent_viewers_do_not_keep_others_out(page):
    with ExitStack() as crowd:
        silent = [crowd.enter_context(opened(page)) for _ in range(MOST_STRANGERS + 3)]
        with looking(page) as looker:
            looker.wait("welcome")
        # The oldest have made room for those after them.
        assert silent[0].recv(4096) == b""
        silent[-1].setblocking(False)
        with pytest.raises(BlockingIOError):
            silent[-1].recv(4096)


def test_a_call_from_two_origins_is_refused_in_order(page):
    own = f"Origin: http://{page.address}"
    for origins in ((own, "Origin: http://evil.example"), ("Origin: http://evil.example", own)):
        host, _, port = page.address.rpartition(":")
        with socket.create_connection((host, int(port)), TIMEOUT_S) as calling:
            calling.sendall(upgrade(page, *origins))
            assert b" 403 " in calling.recv(4096)
    assert "Traceback" not in page.log.read_text()


def can_look(page: Served) -> bool:
    try:
        with looking(page) as looker:
            return bool(looker.wait("welcome"))
    except InvalidStatus:
        return False


def test_a_hanging_viewer_is_dropped_and_blocks_no_other(tmp_path):
    random = np.random.default_rng(1)
    with (
        joined_daemon(tmp_path) as (daemon, outsider),
        served(tmp_path, daemon.endpoint) as page,
        looking(page) as looker,
    ):
        # From here on it opens nothing more but viewers.
        looker.wait("state", lambda state: state.get("state"))
        before = page.descriptors()
        with hanging(page) as hung:
            until(lambda: page.descriptors() > before)
            resident = own_mb(page.process.pid)
            count, deadline = 0, time.monotonic() + 300.0
            # Maps of noise: some hundred kilobytes each, whatever compresses them.
            while page.descriptors() > before:
                assert time.monotonic() < deadline, "the viewer is still there"
                noise = random.choice(np.array([0, -1, 100], np.int8), (1000, 1000))
                outsider.put("map", map_bytes(noise))
                looker.wait("map", is_of(noise))
                count += 1
            print(f"dropped after {count} maps")
            assert own_mb(page.process.pid) - resident < 40.0
            hung.close()
        assert listens(page)


def is_of(pixels: np.ndarray) -> Callable[[Any], bool]:
    marks = np.where(pixels == 100, 2, np.where(pixels == 0, 1, 0)).astype(np.uint8)
    return lambda message: message["body"] == marks.tobytes()


def upgrade(page: Served, *more: str) -> bytes:
    key = base64.b64encode(b"0123456789abcdef").decode()
    lines = (
        "GET /live HTTP/1.1",
        f"Host: {page.address}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        f"Sec-WebSocket-Key: {key}",
        "Sec-WebSocket-Version: 13",
    )
    return "\r\n".join((*lines, *more, "", "")).encode()


def opened(page: Served) -> socket.socket:
    host, _, port = page.address.rpartition(":")
    silent = socket.create_connection((host, int(port)), TIMEOUT_S)
    silent.sendall(upgrade(page))
    assert b" 101 " in silent.recv(4096)
    return silent


def hanging(page: Served) -> socket.socket:
    host, _, port = page.address.rpartition(":")
    hung = socket.socket()
    hung.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    hung.connect((host, int(port)))
    hung.sendall(upgrade(page))
    said = b'{"kind":"hello"}'
    hung.sendall(bytes((0x81, 0x80 | len(said), 0, 0, 0, 0)) + said)
    return hung


def test_it_outlives_the_daemon(tmp_path):
    endpoint = free_endpoint()
    with served(tmp_path, endpoint) as page, looking(page) as looker:
        looker.wait("state", lambda state: endpoint in state["bus"] and state["absent"])
        with daemon_process(tmp_path, bus={"listen": [endpoint]}):
            looker.wait("state", lambda state: state.get("state") == "waiting for map")
        looker.wait("state", lambda state: "has been gone" in state["absent"])
        with daemon_process(tmp_path, bus={"listen": [endpoint]}):
            looker.wait("state", lambda state: state["absent"] == "")


def test_an_order_beyond_the_limits_fails_only_for_its_sender(covering, tmp_path):
    with (
        served(tmp_path, covering.endpoint, "--allow-commands") as page,
        looking(page) as looker,
        looking(page) as other,
    ):
        answer = looker.command("start", {"passes": 10**400})
        assert not answer["ok"]
        assert "must be from" in answer["text"]
        other.wait("state", is_told)
        assert page.process.poll() is None


class SilentBrowser:
    """A browser that says nothing for 0.1 s, and then goes."""

    def __init__(self) -> None:
        self.heard: list[str] = []

    async def send(self, message: str) -> None:
        self.heard.append(json.loads(message)["kind"])

    async def __aiter__(self) -> AsyncIterator[str]:
        await asyncio.sleep(0.1)
        for nothing in ():
            yield nothing


def test_a_viewer_without_news_gets_signs_of_life(monkeypatch):
    monkeypatch.setattr(viewer, "ALIVE_S", 0.01)
    browser: Any = SilentBrowser()
    source: Any = SimpleNamespace(newest=lambda: [("state", 1, message_text("state"))])
    asyncio.run(viewer.Viewer(browser, source, Guard(frozenset())).serve("viewer"))
    assert browser.heard[0] == "state"
    assert set(browser.heard[1:]) == {"alive"}
