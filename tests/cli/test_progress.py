"""Commands that show progress, each in a terminal as people have it; and where there is none."""

from __future__ import annotations

import lzma
import re
import signal
import sys
from pathlib import Path

import pytest

from fasaco_edge.cli.console import terminal
from tests.support.processes import ENVIRONMENT, fasaco_edge, free_endpoint
from tests.support.screen import Screen
from tests.support.terminal import Terminal

COLOURS = re.compile(r"\x1b\[[0-9;]*m")
RECORDING = Path(__file__).parents[1] / "data/mission.rrd.xz"
# What a bar is drawn of.
BAR = ("━", "╸", "╺")
PLAN = ("plan", "flat", "--budget", "0.5")
SIMULATE = ("simulate", "flat", "--speed", "10", "--connect")


def no_escape_is_shown(shell: Terminal) -> None:
    assert "\\x1b" not in shell.written
    text = "\n".join(shell.screen())
    assert not re.search(r"\^\[|\[2K|\[\d*A|\[\?25|\[\d[\d;]*m", text), text


def ended_well(shell: Terminal, code: int = 0) -> str:
    assert shell.end() == code, shell.written
    no_escape_is_shown(shell)
    assert shell.is_clean()
    text = "\n".join(shell.screen())
    assert not any(sign in text for sign in BAR), text
    return text


@pytest.fixture
def recording(tmp_path):
    pytest.importorskip("rerun")
    path = tmp_path / "mission.rrd"
    path.write_bytes(lzma.decompress(RECORDING.read_bytes()))
    return path


@pytest.mark.parametrize(
    ("words", "shown", "first_line"),
    [
        (PLAN, "steps, [0-9.]+ % above the bound ", "map +.*"),
        (("plan", "flat", "--ants", "40", "--planner", "fasaco"), "ants ━* +0/40 ", "map +.*"),
        (("warmup",), "checking the kernels ", "kernels ready after [0-9.]+ s in .*"),
        (
            ("bench", "planners", "--maps", "office", "--seeds", "1", "--ants", "8"),
            "planners ━* +0/6 ",
            ".*",
        ),
    ],
    ids=["plan", "ants", "warmup", "planners"],
)
def test_progress_is_drawn_and_leaves_nothing_behind(words, shown, first_line):
    # On a busy machine half a second may be over before a plan is drawn.
    for tried in (words, (*PLAN[:-1], "20")) if words == PLAN else (words,):
        with Terminal(*tried, columns=120) as shell:
            text = ended_well(shell)
            written = COLOURS.sub("", shell.written)
        if re.search(shown, written):
            break
    assert re.search(shown, written)
    assert not re.search(shown, text)
    assert re.fullmatch(first_line, text.partition("\n")[0]), text


def test_a_review_shows_what_it_reads(recording):
    with Terminal("review", recording, columns=120) as shell:
        text = ended_well(shell)
        assert "recording ━" in COLOURS.sub("", shell.written)
        assert re.match("complete: every cell covered", text)


def test_the_simulation_shows_its_robot_in_one_line():
    with Terminal(*SIMULATE, free_endpoint(), columns=120) as shell:
        screen = shell.wait_text("waits for a router")
        assert "Connection refused" not in screen.splitlines()[-1]
        # Ctrl-C, as it is typed.
        shell.type("\x03")
        text = ended_well(shell)
        assert "waits for" not in text.splitlines()[-1]


# Run in a terminal: bars, with their titles as arguments.
BARS = r"""
import sys
from fasaco_edge.cli.console import streams, terminal
streams.clean_streams()
with terminal.progress() as bar:
    for title in sys.argv[1:]:
        bar.add_task(title, total=100_000, completed=20_000)
    sys.stdin.readline()
"""


@pytest.mark.parametrize(("columns", "lines"), [(60, 20), (80, 24)])
def test_bar_and_clock_are_whole(tmp_path, columns, lines):
    script = tmp_path / "bars.py"
    script.write_text(BARS)
    titles = ("flat", "robot-1", "second_floor_of_the_hospital_in_the_north")
    program = (sys.executable, str(script), *titles)
    with Terminal(program=program, columns=columns, lines=lines) as shell:
        screen = shell.wait(lambda seen: seen.count("20000/100000") == 3)
        shell.type("\n")
        assert shell.end() == 0
    rows = [line for line in screen.splitlines() if "20000/100000" in line]
    for row, title in zip(rows, titles, strict=True):
        assert len(row) <= columns
        assert re.search(r"\b0:\d\d:\d\d\b", row)
        assert sum(row.count(sign) for sign in BAR) == (32 if columns >= 80 else 16)
        name = re.split("[━╸╺]", row)[0].strip()
        assert name == title or (title.startswith(name[:-1]) and name.endswith("…"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_shows_the_cursor_again(number):
    with Terminal("plan", "office", "--budget", "300", columns=120) as shell:
        shell.wait_text("above the bound")
        assert not shell.is_clean()
        shell.process.send_signal(number)
        code = shell.end()
        assert code == (130 if number == signal.SIGINT else -signal.SIGTERM)
        no_escape_is_shown(shell)
        assert shell.is_clean()


@pytest.mark.parametrize("words", [PLAN, ("warmup",)])
def test_a_dumb_terminal_gets_no_escapes(words):
    with Terminal(*words, columns=120, TERM="dumb") as shell:
        assert shell.end() == 0
        assert "\x1b" not in shell.written
        assert "\\x1b" not in shell.written
        assert not any(sign in shell.written for sign in BAR)


@pytest.mark.parametrize("colour", [{}, {"FORCE_COLOR": "1", "TERM": "xterm-256color"}])
def test_a_file_gets_no_progress(monkeypatch, colour):
    for name, value in colour.items():
        monkeypatch.setitem(ENVIRONMENT, name, value)
    ended = fasaco_edge(*PLAN)
    assert ended.code == 0
    assert ended.err == ""
    assert "\x1b" not in COLOURS.sub("", ended.out)


@pytest.mark.parametrize(("counted", "count"), [(True, " (1 of 3)"), (False, "")])
def test_long_work_says_so_in_a_file_too(monkeypatch, capsys, counted, count):
    """Of a search the bar shows seconds, as no numbers: "25 of 2" said nothing."""
    monkeypatch.setattr(terminal, "SAY_S", 0.0)
    with terminal.progress(counted=counted) as bar:
        task = bar.add_task("looking", total=3)
        bar.update(task, description="compiling kernels", completed=1)
    assert capsys.readouterr().err == f"compiling kernels{count}\n"


# Run in a terminal: what a log, a warning, a second console and a thread print meanwhile.
MEANWHILE = r"""
import logging, sys, threading, time
from fasaco_edge.cli.console import logs, streams, terminal
streams.clean_streams()
logs.begin_logging("info")
def say():
    logging.getLogger("bus").warning("no router, name \x1b[31mred\x1b[0m")
with terminal.progress() as bar:
    bar.add_task("at work", total=3, completed=1)
    time.sleep(0.2)
    thread = threading.Thread(target=say)
    thread.start(); thread.join()
    print("begun", end=" ")
    print("and ended", file=sys.stderr)
    terminal.err().print("a remark")
    print("in stdout")
    time.sleep(0.2)
    print("no line end", end="")
print()
"""


def test_printed_text_appears_above_the_progress(tmp_path):
    script = tmp_path / "meanwhile.py"
    script.write_text(MEANWHILE)
    with Terminal(program=(sys.executable, str(script)), columns=120) as shell:
        assert shell.end() == 0
        assert shell.is_clean()
        told = [
            r"WARNING bus: no router, name \x1b[31mred\x1b[0m",
            "and ended",
            "a remark",
            "begun in stdout",
        ]
        assert shell.screen() == [*told, "no line end", ""]
        screen = Screen(120)
        screen.feed(shell.written.partition("no line end")[0].rpartition("\x1b[?25h")[0])
        during = screen.lines()
        assert during[:4] == told
        assert during[4].startswith("at work ━")
        assert len([line for line in during if "at work" in line]) == 1
