"""The page in a real browser, by its DevTools: seen, and a mission ordered by finger."""

from __future__ import annotations

import base64
import io
import itertools
import json
import os
import shutil
import signal
import subprocess
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("websockets")

from websockets.sync.client import ClientConnection, connect

from tests.serve.serving import served
from tests.serve.test_plain import TECHNICAL
from tests.support.outsider import TIMEOUT_S, Outsider, joined_daemon, open_client
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import (
    HALL,
    UNKNOWN,
    begin,
    drive,
    fill,
    lanes,
    map_bytes,
    show_room,
)
from tests.support.router import router_process
from tests.support.statuses import FULL
from tests.support.waiting import until

BROWSER = shutil.which("chromium")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="needs chromium")
PHONE, LAPTOP = (390, 844), (1280, 800)
READY = "Ready to sweep,false"
# What the page asks if the robot has no map yet, and so counts what it has swept in any place.
ASKED_WITHOUT_MAP = """(() => {
  const sent = command, text = "start forgets up to 9 covered cells (0.8 m2)";
  command = (name, members, { refused }) => refused({ code: "would_forget", text });
  start({});
  command = sent;
  find("loss").close();
  return find("losstext").textContent;
})()"""
# How many of some places all over the map are covered by something else.
COVERED = """(() => {
  canvas.scrollIntoView();
  const { left, top, width, height } = canvas.getBoundingClientRect();
  const shares = [...Array(24).keys()].map((i) => (i + 0.5) / 24);
  const places = shares.flatMap((x) => shares.map((y) => [left + x * width, top + y * height]));
  return places.filter((place) => document.elementFromPoint(...place) !== canvas).length;
})()"""


@dataclass
class Tab:
    socket: ClientConnection
    complaints: list[str] = field(default_factory=list)
    numbers: Iterator[int] = field(default_factory=itertools.count)

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        number = next(self.numbers)
        self.socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            said = json.loads(self.socket.recv(TIMEOUT_S))
            if said.get("method") == "Runtime.exceptionThrown" or (
                said.get("method") == "Log.entryAdded"
                and said["params"]["entry"]["level"] in ("warning", "error")
            ):
                self.complaints.append(json.dumps(said["params"]))
            if said.get("id") == number:
                result: dict[str, Any] = said["result"]
                return result

    def js(self, text: str) -> Any:
        return self.call("Runtime.evaluate", expression=text)["result"].get("value")

    def click(self, name: str) -> None:
        until(lambda: self.js(f"find({name!r}).offsetParent !== null"), why=lambda: name)
        self.js(f"find({name!r}).click()")

    def size(self, size: tuple[int, int], scheme: str) -> None:
        width, height = size
        screen = {"width": width, "height": height, "deviceScaleFactor": 1}
        self.call("Emulation.setDeviceMetricsOverride", **screen, mobile=size == PHONE)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.call("Emulation.setEmulatedMedia", features=features)

    def picture(self) -> np.ndarray:
        """Return what is seen, uint8 (rows, cols, 3)."""
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

    def touch(self, *way: tuple[float, float]) -> None:
        for index, (x, y) in enumerate(way):
            kind = "touchMove" if index else "touchStart"
            self.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y}])
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def on_screen(self, x: float, y: float) -> tuple[float, float]:
        box = "canvas.getBoundingClientRect()"
        text = f"JSON.stringify([toScreen({x}, {y}), {box}.left, {box}.top])"
        (px, py), left, top = json.loads(self.js(text))
        return px + left, py + top


@contextmanager
def browsing(url: str, folder: Path) -> Iterator[Tab]:
    options = ("--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0")
    words = (*options, f"--user-data-dir={folder}", "about:blank")
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(
        [str(BROWSER), *words], stdout=quiet, stderr=quiet, start_new_session=True
    )
    port = folder / "DevToolsActivePort"
    try:
        until(lambda: port.exists() and bool(port.read_text().strip()))
        listed = f"http://127.0.0.1:{port.read_text().split()[0]}/json/list"
        until(lambda: bool(pages_at(listed)))
        address = pages_at(listed)[0]["webSocketDebuggerUrl"]
        with connect(address, max_size=None, compression=None) as socket:
            tab = Tab(socket)
            for domain in ("Page", "Runtime", "Log"):
                tab.call(f"{domain}.enable")
            tab.size(PHONE, "light")
            tab.call("Emulation.setTouchEmulationEnabled", enabled=True)
            tab.call("Page.navigate", url=url)
            yield tab
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def pages_at(listed: str) -> list[dict[str, Any]]:
    with urllib.request.urlopen(listed, timeout=TIMEOUT_S) as answer:
        return [tab for tab in json.loads(answer.read()) if tab["type"] == "page"]


def has(picture: np.ndarray, colour: str) -> int:
    return int((picture == channels(colour)).all(axis=-1).sum())


def channels(colour: str) -> list[int]:
    return [int(colour[at : at + 2], 16) for at in (1, 3, 5)]


def pause_and_reload(tab: Tab, outsider: Outsider, url: str) -> None:
    tab.click("pause")
    outsider.wait_status(lambda status: status["state"] == "paused")
    tab.call("Page.navigate", url=url)
    until(lambda: tab.js("model.state && model.state.state") == "paused")


def order_again(tab: Tab, outsider: Outsider, url: str) -> None:
    tab.call("Page.navigate", url=url)
    until(lambda: tab.js("find('again').textContent") == "Last order again: area 1")
    photograph(tab, "again")
    tab.click("again")
    again = outsider.wait_status(lambda status: status["state"] == "covering")["mission"]
    assert [zone["name"] for zone in again["zones"]] == ["area 1"]
    assert again["keep_out"] == 1
    until(lambda: tab.js("find('again').offsetParent === null"))


def canceled(tab: Tab, outsider: Outsider) -> bool:
    tab.js("find('cancel').click()")
    return outsider.ask_status()["mission"]["ordered"] is None


@needs_browser
def test_a_mission_is_ordered_by_finger(tmp_path):
    with (
        joined_daemon(tmp_path, mission={"autostart": False}) as (daemon, outsider),
        served(tmp_path, daemon.endpoint, "--allow-commands") as page,
        browsing(page.url, tmp_path / "browser") as tab,
    ):
        until(lambda: tab.js("model.role") == "operator")
        show_room(outsider, HALL, *lanes(1)[0])
        # What is left out is not shown by itself before there was an order.
        until(lambda: tab.js("[find('does').textContent, find('left').open].join()") == READY)
        until(lambda: tab.js("Boolean(model.map && model.map.pixel === 0.05 && model.pose)"))
        until(lambda: tab.js("view.scale > 0 && !waiting"))
        tab.js("find('plan').open = true")
        tab.click("draw-zone")
        (x0, y0), (x1, y1) = tab.on_screen(0.5, 0.5), tab.on_screen(3.0, 3.0)
        tab.touch((x0, y0), ((x0 + x1) / 2, (y0 + y1) / 2), (x1, y1))
        tab.click("draw-keepout")
        for corner in ((2.0, 2.0), (2.4, 2.0), (2.4, 2.4)):
            tab.touch(tab.on_screen(*corner))
        until(lambda: tab.js("drawing.corners.length") == 3)
        tab.click("drawdone")
        tab.click("order")
        mission = outsider.wait_status(lambda status: status["state"] == "covering")["mission"]
        assert [zone["name"] for zone in mission["zones"]] == ["area 1"]
        assert mission["keep_out"] == 1
        until(lambda: tab.js("model.areas.zones.length") == 1)
        corners = json.loads(tab.js("JSON.stringify(model.areas.zones[0].polygon)"))
        assert np.abs(np.array(corners) - [[0.5, 0.5], [3, 0.5], [3, 3], [0.5, 3]]).max() < 0.1
        until(lambda: tab.js("drafts.length") == 0)
        draw_keep_out(tab, (1.0, 1.0), (1.4, 1.4))
        for size, scheme in itertools.product((PHONE, LAPTOP), ("light", "dark")):
            tab.size(size, scheme)
            # Robot and path in the colours of the style, once it is drawn anew.
            until(
                lambda: all(
                    has(tab.picture(), tab.js(f"colours.{of}")) for of in ("robot", "ahead")
                )
            )
            assert tab.js("document.documentElement.scrollWidth <= innerWidth")
            assert tab.js(COVERED) == 0
        tab.size(PHONE, "light")
        assert tab.js("find('does').textContent") == "Sweeps area 1"
        assert tab.js("find('share-of').textContent") == "in this area"
        assert not TECHNICAL.search(tab.js("document.body.innerText"))
        assert tab.js("find('technical').textContent").startswith("covering: ")
        # A pause, and a page opened anew, lose neither the path nor what is drawn.
        pause_and_reload(tab, outsider, page.url)
        until(lambda: has(tab.picture(), tab.js("colours.ahead")))
        assert tab.js("drafts.map((draft) => draft.name).join()") == "keep-out 1"
        assert not TECHNICAL.search(tab.js("document.body.innerText"))
        offers_to_start_what_is_drawn(tab)
        tab.js("drafts.length = 0; showDrafts()")
        tab.click("resume")
        outsider.wait_status(lambda status: status["state"] == "covering")
        tab.click("cancel")
        assert outsider.ask_status()["mission"]["ordered"] == "command"
        # On a slow machine the second tap may be too late, and be a first one.
        until(lambda: canceled(tab, outsider))
        order_again(tab, outsider, page.url)
        tab.js("find('details').open = true")
        tab.click("trail")
        until(lambda: tab.js("Boolean(model.field)"))
        assert tab.complaints == []


def offers_to_start_what_is_drawn(tab: Tab) -> None:
    tab.js("drawing.kind = 'zone'; finish([[1, 1], [2, 1], [2, 2]])")
    said = tab.js("""(() => {
      const texts = [], state = model.state;
      for (const stage of ["", "over"]) {
        model.state = { ...state, mission: { ...state.mission, paused: false, stage } };
        show({ kind: "state" });
        texts.push(find("usedrawn").textContent);
      }
      model.state = state;
      return texts.join();
    })()""")
    assert said == "Start anew with these,Start with these"


def keep_out_of_no_floor(tab: Tab) -> None:
    far = '{ name: "far", polygon: [[500, 500], [501, 500], [501, 501]] }'
    tab.js(f'command("keep_out_add", {{ keep_out: {far} }})')
    until(lambda: "seen no floor" in tab.js("find('answer').textContent"))
    photograph(tab, "no_floor")
    tab.js('drop("far")')


@needs_browser
def test_a_keep_out_applies_mid_mission_and_a_restart_asks_first(tmp_path):
    with joined_daemon(tmp_path) as (daemon, outsider):
        begin(outsider)
        drive(outsider, lanes(12))
        with (
            served(tmp_path, daemon.endpoint, "--allow-commands") as page,
            browsing(page.url, tmp_path / "browser") as tab,
        ):
            until(lambda: tab.js("model.role") == "operator")
            until(lambda: tab.js("Boolean(model.map && model.pose && model.state)"))
            tab.js("find('plan').open = true")
            draw_keep_out(tab, (2.0, 2.0), (2.4, 2.4))
            assert button(tab, "Apply now")
            photograph(tab, "apply_now")
            press(tab, "Apply now")
            until(lambda: tab.js("keptOut().length") == 1)
            until(lambda: tab.js("drafts.length") == 0)
            mission = outsider.wait_status(lambda s: s["mission"]["keep_outs"])["mission"]
            assert [area["name"] for area in mission["keep_outs"]] == ["keep-out 1"]
            assert outsider.ask_status()["coverage"]["covered"] == 12

            # With another order the page asks, and says what would be lost.
            draw_keep_out(tab, (3.0, 2.0), (3.4, 2.4))
            assert tab.js("find('order').textContent") == "Start anew with these"
            tab.click("order")
            until(lambda: tab.js("find('loss').open"))
            said = tab.js("find('losstext').textContent")
            assert said == "1.0 m² of it is swept already."
            photograph(tab, "question")
            press(tab, "Back")
            assert outsider.ask_status()["coverage"]["covered"] == 12
            assert tab.js("drafts.length") == 1
            assert tab.js(ASKED_WITHOUT_MAP) == "Up to 0.8 m² of it is swept already."
            tab.click("order")
            until(lambda: tab.js("find('loss').open"))
            press(tab, "Keep it, sweep the rest")
            until(lambda: tab.js("find('answer').textContent") == "It sweeps the rest.")
            keep_out_of_no_floor(tab)
            outsider.wait_status(lambda status: status["mission"]["keep_out"] == 2)
            assert outsider.ask_status()["coverage"]["covered"] == 12
            until(lambda: tab.js("drafts.length") == 0)

            # Tapped on the map it can be removed; one of the order cannot.
            tab.js("canvas.scrollIntoView()")
            tab.touch(tab.on_screen(3.2, 2.2))
            assert tab.js("find('pickbar').hidden")
            tab.touch(tab.on_screen(2.2, 2.2))
            until(lambda: not tab.js("find('pickbar').hidden"))
            assert tab.js("find('pickname').textContent") == "keep-out 1"
            photograph(tab, "picked")
            tab.click("unkeep")
            outsider.wait_status(lambda status: status["mission"]["keep_out"] == 1)
            until(lambda: tab.js("find('pickbar').hidden"))
            tab.click("order")
            until(lambda: tab.js("find('loss').open"))
            press(tab, "Forget it and start anew")
            outsider.wait_status(lambda status: status["coverage"]["covered"] == 1)
            assert tab.complaints == []


@needs_browser
def test_a_reason_shows_its_floor_on_the_map_and_nothing_else(tmp_path):
    with (
        joined_daemon(tmp_path, planner={"line": "quick"}) as (daemon, outsider),
        served(tmp_path, daemon.endpoint, "--allow-commands") as page,
        browsing(page.url, tmp_path / "browser") as tab,
    ):
        until(lambda: tab.js("Boolean(model.state)"))
        begin(outsider, fill(HALL, 3.0, 0.0, 6.0, 4.5, UNKNOWN))
        until(lambda: "done at" in tab.js("find('togo-of').textContent"))
        # While the map grows, nobody knows how much there is to do.
        outsider.put("map", map_bytes(HALL))
        until(lambda: "not before" in tab.js("find('togo-of').textContent"))
        drive(outsider, lanes(12))
        keep_out = {"name": "shelf", "polygon": [[2.0, 2.0], [2.6, 2.0], [2.6, 2.6], [2.0, 2.6]]}
        tab.js(f"command('keep_out_add', {{ keep_out: {json.dumps(keep_out)} }})")
        until(lambda: tab.js("find('left-what').textContent") == "Left out so far")
        assert not any(painted(tab))
        show_left(tab, "in a keep-out")
        inside, outside = painted(tab, (1.7, 1.7), (2.9, 2.9))
        photograph(tab, "not_swept")
        assert inside > 300
        assert outside == 0
        # The robot's tool is round: corners stay.
        show_left(tab, "too narrow")
        corners = painted(tab, (0.0, 0.0), (0.3, 0.3)), painted(tab, (1.9, 1.9), (2.7, 2.7))
        assert (corners[0][0] > 0, corners[1][0]) == (True, 0)
        until(lambda: canceled(tab, outsider))
        until(lambda: tab.js("find('left-what').textContent") == "Not swept")
        show_left(tab, "left when the work was ended")
        inside, outside = painted(tab, (2.05, 2.05), (2.55, 2.55))
        assert outside > 10_000
        assert inside == 0
        photograph(tab, "not_swept_after_cancel")
        assert not TECHNICAL.search(tab.js("document.body.innerText"))
        tab.click("unleft")
        assert tab.complaints == []


@needs_browser
def test_with_an_older_daemon_the_page_explains_missing_places(tmp_path):
    endpoint = free_endpoint()
    left = [
        {"m2": 1.0, "reason": "too narrow for the robot, or too near to a wall or to furniture"}
    ]
    status = json.dumps(FULL | {"floor": FULL["floor"] | {"left": left, "out_of_reach": []}})
    with (
        router_process(endpoint),
        open_client(endpoint) as session,
        served(tmp_path, endpoint) as page,
        browsing(page.url, tmp_path / "browser") as tab,
    ):

        def is_shown() -> bool:
            session.put("fasaco/@v1/robot/status", status)
            return bool(tab.js("Boolean(model.state && model.state.state)"))

        until(is_shown)
        tab.js("find('left').open = true; find('left').querySelector('button').click()")
        reason = "too narrow for the robot, or too close to a wall or furniture"
        assert tab.js("find('leftname').textContent") == reason
        photograph(tab, "old_daemon")
        assert tab.js("find('absent').innerText").startswith("No robot named robot ")
        assert tab.complaints == []
        # A server that is silent is gone: the page waits 15 s, here none. It finds it again.
        page.process.send_signal(signal.SIGSTOP)
        tab.js("heardAt -= SILENT_MS")
        until(lambda: tab.js("find('absent').innerText") == "No connection; trying again")
        page.process.send_signal(signal.SIGCONT)
        until(lambda: tab.js("find('absent').innerText").startswith("No robot named robot "))
        page.process.terminate()
        until(lambda: tab.js("find('absent').innerText") == "No connection; trying again")


def show_left(tab: Tab, reason: str) -> None:
    tab.js("find('left').open = true")
    every = "[...find('left').querySelectorAll('button')]"
    until(lambda: tab.js(f"{every}.some((b) => b.textContent.includes({reason!r}))"))
    tab.js(f"{every}.find((b) => b.textContent.includes({reason!r})).click()")
    assert reason in tab.js("find('leftname').textContent")
    tab.js("canvas.scrollIntoView()")
    until(lambda: any(painted(tab)))


def painted(
    tab: Tab, low: tuple[float, float] = (0.0, 0.0), high: tuple[float, float] = (0.0, 0.0)
) -> tuple[int, int]:
    """Return how many pixels of the map have the colour of floor left in a rectangle, and beside.

    ``low``, ``high``: its corners (x, y) [m].
    """
    picture = tab.picture()[: int(tab.js("canvas.getBoundingClientRect().bottom"))]
    rows, cols = np.nonzero((picture == channels(tab.js("colours.left"))).all(axis=-1))
    (x0, y1), (x1, y0) = tab.on_screen(*low), tab.on_screen(*high)
    inside = np.count_nonzero((cols > x0) & (cols < x1) & (rows > y0) & (rows < y1))
    return int(inside), len(rows) - int(inside)


def draw_keep_out(tab: Tab, low: tuple[float, float], high: tuple[float, float]) -> None:
    """Draw a keep-out by a finger, from corner to corner."""
    count = tab.js("drafts.length")
    tab.click("draw-keepout")
    (x0, y0), (x1, y1) = tab.on_screen(*low), tab.on_screen(*high)
    tab.touch((x0, y0), ((x0 + x1) / 2, (y0 + y1) / 2), (x1, y1))
    until(lambda: tab.js("drafts.length") == count + 1)
    # It is seen where it lies, and used from there.
    assert tab.js("canvas.getBoundingClientRect().top") >= 0
    assert button(tab, "Apply now")


def button(tab: Tab, text: str) -> bool:
    every = f"[...document.querySelectorAll('button')].filter((b) => b.textContent === {text!r})"
    return bool(tab.js(f"{every}.some((b) => b.offsetParent !== null)"))


def press(tab: Tab, text: str) -> None:
    until(lambda: button(tab, text), why=lambda: text)
    every = f"[...document.querySelectorAll('button')].filter((b) => b.textContent === {text!r})"
    tab.js(f"{every}.find((b) => b.offsetParent !== null).click()")


def photograph(tab: Tab, name: str) -> None:
    """Keep what is seen where PHOTOGRAPHS says, for people to look at."""
    if folder := os.environ.get("PHOTOGRAPHS"):
        Image.fromarray(tab.picture()).save(Path(folder) / f"{name}.png")


@needs_browser
def test_a_page_asks_for_its_token(tmp_path):
    file = tmp_path / "tokens"
    with (
        daemon_process(tmp_path) as daemon,
        served(tmp_path, daemon.endpoint, "--tokens", str(file)) as page,
    ):
        token = file.read_text().split("operator: ")[1].strip()
        with browsing(page.url, tmp_path / "one") as tab:
            until(lambda: tab.js("find('login').open"))
            assert tab.js("find('wrong').hidden")
            tab.js("find('token').value = 'guessed'; find('login').close()")
            until(lambda: tab.js("find('login').open && !find('wrong').hidden"))
            photograph(tab, "wrong_token")
            tab.js(f"find('token').value = {token!r}; find('login').close()")
            until(lambda: tab.js("model.role") == "operator")
        with browsing(f"{page.url}#{token}", tmp_path / "two") as tab:
            until(lambda: tab.js("model.role") == "operator")
            assert tab.js("location.hash") == ""
            # A link opened in a tab that has the page is taken, too: whether it is a wrong one...
            tab.call("Page.navigate", url=f"{page.url}#guessed")
            until(lambda: tab.js("find('login').open && !find('wrong').hidden"))
            # ... or the right one, as the page asks for it.
            tab.js("model.role = ''")
            tab.call("Page.navigate", url=f"{page.url}#{token}")
            until(lambda: tab.js("model.role") == "operator")
            assert tab.js("!find('login').open && location.hash === ''")
