"""The view of a demo on a terminal: which kind fits, how it ends, and what is printed meanwhile."""

from __future__ import annotations

import json
import os
import re
import sys

import pytest

from fasaco_edge.cli.console.terminal import CleanConsole
from fasaco_edge.cli.demo import view
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import Status
from maps.map_writer import write_map
from tests.cli.test_demo import processes_of
from tests.support.processes import is_running
from tests.support.rooms import RESOLUTION_M, room
from tests.support.terminal import Terminal


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pixels = room(2.4, 1.8)
    geometry = GridGeometry(*pixels.shape, RESOLUTION_M, Pose2D(-1.0, -0.4))
    write_map(OccupancyGrid(geometry, pixels), tmp_path / "room.yaml")
    return tmp_path


def test_a_line_of_progress_fits_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr(view, "err", lambda: CleanConsole(stderr=True))
    path = {"revision": 47, "steps": 999, "remaining_steps": 199, "line_s": 9000.0}
    covering = {"state": "covering", "path": path, "coverage": {"fraction": 0.72}}
    for document in ({"state": "waiting for map"}, covering | {"floor": {"swept_m2": 1032.9}}):
        shown = view.LinesView(["r1", "r2"])
        shown.show(1, decode_tolerant(json.dumps(document).encode(), Status), 7205.7)
    waits, goes = capsys.readouterr().err.splitlines()
    assert waits == "7205.7 s  r2  waiting for map"
    assert goes == "7205.7 s  r2  covering, 72.0 % of cells, 1032.9 m2 swept, 2.5 h to go, path 47"
    assert len(goes) <= 80


@pytest.mark.parametrize(
    ("key", "size", "env"),
    [("\x03", (60, 20), {"NO_COLOR": "1"}), ("q", (200, 50), {})],
    ids=["ctrl-c", "q"],
)
def test_a_key_ends_the_view_and_restores_the_terminal(folder, key, size, env):
    pytest.importorskip("rerun")
    columns, lines = size
    words = ("demo", "--map", "room.yaml", "--out", folder / "demo")
    with Terminal(*words, columns=columns, lines=lines, **env) as shell:
        shell.wait_text(" lately ")
        assert not shell.is_clean()
        # What is typed is for the demo alone: one that died of it first was a failure.
        started = processes_of(folder)
        assert started
        assert shell.process.pid not in {os.getpgid(pid) for pid in started}
        shell.type(key)
        assert shell.end() == (0 if key == "q" else 130), shell.written[-2000:]
        assert shell.is_clean()
        screen = "\n".join(shell.screen())
        assert "\nin another terminal: " in screen
        assert "Traceback" not in screen
        assert "\\x1b" not in shell.written
        if env:
            assert set(re.findall(r"\x1b\[([\d;]*)m", shell.written)) <= {"0"}
    assert not [pid for pid in processes_of(folder) if is_running(pid)]


# Run in a terminal: the kind of view for each size of it, and without some things.
KINDS = r"""
import os, sys, termios
from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.demo.view import demo_view
def kind(columns=60, lines=20, **environment):
    termios.tcsetwinsize(2, (lines, columns))
    before = dict(os.environ)
    os.environ.update(environment)
    terminal.err.cache_clear()
    view = type(demo_view(["robot"], "tcp/127.0.0.1:1")).__name__
    os.environ.clear(); os.environ.update(before)
    return view
sys.modules["fasaco_edge.watch"] = None
print("without watch", kind())
del sys.modules["fasaco_edge.watch"]
print("with watch", kind(), kind(200, 50), kind(59), kind(60, 19), kind(0, 0))
print("dumb", kind(TERM="dumb"), kind(TERM="unknown"), kind(TERM=""))
print("no colour", kind(NO_COLOR="1"))
if os.fork():
    os.wait()
else:
    os.setpgid(0, 0)
    os.write(1, f"in the background {kind()}\n".encode())
"""


def test_the_view_suits_the_terminal(tmp_path):
    script = tmp_path / "kinds.py"
    script.write_text(KINDS)
    with Terminal(program=(sys.executable, str(script))) as shell:
        assert shell.end() == 0, shell.written
        assert shell.screen()[:5] == [
            "without watch LinesView",
            "with watch LiveView LiveView LinesView LinesView LinesView",
            "dumb LinesView LinesView LinesView",
            "no colour LiveView",
            "in the background LinesView",
        ]


# Run in a terminal: what is printed and logged while the live map is shown.
MEANWHILE = r"""
import itertools, logging, sys
from pathlib import Path
from fasaco_edge.cli.console import logs, streams
from fasaco_edge.cli.demo.view import LiveView
streams.clean_streams()
logs.begin_logging("info")
steps = itertools.count()
def step(timeout_s):
    if next(steps) == 2:
        print("said")
        logging.getLogger("bus").warning("no router, \x1b[31mred")
    return Path(sys.argv[1]).exists()
LiveView(["robot"], "tcp/127.0.0.1:1").run(step)
print("the end")
"""


def test_printed_text_is_on_the_page_and_after_it(tmp_path):
    script, end = tmp_path / "meanwhile.py", tmp_path / "end"
    script.write_text(MEANWHILE)
    with Terminal(program=(sys.executable, str(script), str(end))) as shell:
        page = shell.wait_text("WARNING bus: no router")
        assert shell.shown.is_alternate
        assert page.count("\n") == 23
        assert re.search(r"\n\d\d:\d\d:\d\d said +\n", page)
        end.touch()
        assert shell.end() == 0, shell.written
        assert shell.is_clean()
        said = ["said", r"WARNING bus: no router, \x1b[31mred", "the end", ""]
        assert shell.screen() == said
