"""The command itself: a real daemon, a real terminal."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import termios
import time
from collections.abc import Iterator

import pytest

from fasaco_edge.host.processes import own_mb
from fasaco_edge.watch.live import Screen
from tests.support.outsider import Outsider
from tests.support.processes import Daemon, daemon_process, fasaco_edge, free_endpoint, mapped_files
from tests.support.rooms import HALL, begin, lanes, pose_bytes, show_room
from tests.watch.terminal import Terminal, piped

# Memory of its own at most, without pages of files [MB].
WATCH_MB = 30.0


@pytest.fixture(scope="module")
def covering(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with daemon_process(tmp_path_factory.mktemp("daemon")) as running:
        with Outsider(running.endpoint) as outsider:
            begin(outsider)
        yield running


def test_it_shows_how_the_mission_stands(covering):
    with Terminal("--connect", covering.endpoint, executed=True) as terminal:
        screen = terminal.wait(lambda seen: "COVERING" in seen and "→" in seen.split("robot", 2)[1])
        assert "of 234 cells" in screen
        assert "path " in screen
        assert "▀" in terminal.written
        for columns, lines in ((120, 40), (30, 8), (80, 24)):
            terminal.resize(columns, lines)
            terminal.wait(lambda seen, lines=lines: seen.count("\n") == lines - 1)
            assert {len(line) for line in terminal.screen()} == {columns}
        assert "38;2;" in terminal.written
        resident = own_mb(terminal.process.pid)
        print(f"watch: {resident:.1f} MB")
        assert resident < WATCH_MB
        mapped = mapped_files(terminal.process.pid)
        assert [name for name in ("numba", "llvmlite", "rerun", "PIL") if name in mapped] == []
        terminal.quit()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_leaves_the_terminal_as_it_was(covering, number):
    with Terminal("--connect", covering.endpoint) as terminal:
        terminal.wait_text("COVERING")
        assert not terminal.is_clean()
        assert terminal.end(number) == 0
        assert terminal.is_clean()
        assert "Traceback" not in terminal.written


def test_ctrl_z_gives_the_terminal_back_for_a_while(covering):
    with Terminal("--connect", covering.endpoint, executed=True) as terminal:
        terminal.wait_text("COVERING")
        terminal.process.send_signal(signal.SIGTSTP)
        _, status = os.waitpid(terminal.process.pid, os.WUNTRACED)
        assert os.WIFSTOPPED(status)
        terminal.read()
        assert terminal.is_clean()
        terminal.written = ""
        terminal.process.send_signal(signal.SIGCONT)
        terminal.wait_text("COVERING")
        assert not terminal.is_clean()
        terminal.quit()


def test_a_page_is_limited_whatever_size_the_terminal_reports():
    master, slave = os.openpty()
    with open(master, "rb"), open(slave, "w", encoding="utf-8") as terminal:
        for columns, lines, shown in ((65535, 65535, (800, 400)), (0, 0, (1, 1)), (9, 5, (9, 5))):
            termios.tcsetwinsize(terminal.fileno(), (lines, columns))
            assert Screen(terminal).size() == shown


def test_a_terminal_that_is_closed_ends_it(covering):
    with Terminal("--connect", covering.endpoint) as terminal:
        terminal.wait_text("COVERING")
        terminal.hang_up()
        assert terminal.process.wait(60.0) in (0, 1)


def test_it_outlives_the_daemon(tmp_path):
    endpoint = free_endpoint()
    with Terminal("--connect", endpoint) as terminal:
        terminal.wait_text(f"waiting for the bus at {endpoint}")
        bus = {"listen": [endpoint]}
        with daemon_process(tmp_path, bus=bus) as first, Outsider(endpoint) as outsider:
            begin(outsider)
            terminal.wait_text("COVERING")
            first.kill()
        screen = terminal.wait_text("waiting for it to return")
        assert "the daemon is gone" in screen
        with daemon_process(tmp_path, bus=bus):
            terminal.wait_text("WAITING FOR MAP")
            terminal.wait_text("the daemon is back")
            with Outsider(endpoint) as outsider:
                show_room(outsider, HALL, *lanes(1)[0])
                terminal.wait_text("COVERING")
        # What Zenoh's threads still do while the daemon is away must not abort it.
        terminal.wait_text("the daemon has been gone")
        terminal.quit()


def test_it_draws_no_more_often_than_ten_times_a_second(covering):
    with Terminal("--connect", covering.endpoint) as terminal, Outsider(covering.endpoint) as robot:
        terminal.wait_text("COVERING")
        terminal.read()
        before = terminal.written.count("\x1b[?2026h")
        began = time.monotonic()
        x, y = lanes(1)[0]
        while (seconds := time.monotonic() - began) < 2.0:
            robot.put("pose", pose_bytes(x + 0.1 * seconds, y))
            terminal.read(0.005)
        pages = terminal.written.count("\x1b[?2026h") - before
        print(f"{pages} pages in {seconds:.1f} s")
        assert 2 <= pages <= 10 * seconds + 2


def test_lines_where_there_is_no_terminal(covering):
    with piped("--connect", covering.endpoint) as process:
        assert process.stdout is not None
        said = [process.stdout.readline() for _ in range(4)]
        process.send_signal(signal.SIGTERM)
        assert process.wait(60.0) == 0
    assert any("the daemon is there" in line for line in said)
    goes = r"  covering, [\d.]+ % of cells, [\d.]+ m2 swept, [\d.]+ (s|min) to go, path \d+\n"
    assert any(re.search(goes, line) for line in said), said
    assert not any("\x1b" in line for line in said)


def test_a_broken_pipe_gives_no_traceback(covering):
    with piped("--connect", covering.endpoint, "--json") as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        process.wait(60.0)
        assert process.stderr.read() == ""


def test_json_output_continues_after_an_unreadable_status(covering):
    with (
        Outsider(covering.endpoint) as outsider,
        piped("--connect", covering.endpoint, "--json") as process,
    ):
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["coverage"]["coverable"] == 234
        for broken in (b"\xff", b"[]"):
            outsider.session.put(f"{outsider.prefix}/status", broken)
            assert json.loads(process.stdout.readline())["state"] == "covering"
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0


def test_once_is_one_picture(covering):
    ended = fasaco_edge("watch", "--once", "--connect", covering.endpoint)
    assert ended.code == 0
    assert "COVERING" in ended.out
    assert "of 234 cells" in ended.out
    assert "q quits" not in ended.out
    assert "\x1b" not in ended.out
    ended = fasaco_edge("watch", "--once", "--json", "--connect", covering.endpoint)
    assert json.loads(ended.out)["state"] == "covering"


def test_a_host_that_accepts_but_never_answers_blocks_no_command():
    with socket.create_server(("127.0.0.1", 0)) as mute:
        endpoint = f"tcp/127.0.0.1:{mute.getsockname()[1]}"
        began = time.monotonic()
        ended = fasaco_edge("watch", "--once", "--timeout", "1", "--connect", endpoint)
        assert ended.code == 1
        assert time.monotonic() - began < 120.0
        with Terminal("--connect", endpoint) as terminal:
            terminal.wait_text("waiting for a daemon")
            terminal.quit()


def test_once_without_a_daemon_is_an_error(covering):
    for endpoint, robot, said, hint in (
        (covering.endpoint, "nobody", "no daemon answers at fasaco/@v1/nobody", "this bus: robot"),
        (free_endpoint(), "robot", "fasaco-edge: ", "start the daemon"),
    ):
        words = ("--once", "--timeout", "1", "--connect", endpoint, "--robot", robot)
        ended = fasaco_edge("watch", *words)
        assert ended.code == 1
        assert said in ended.err
        assert hint in ended.err
        assert ended.out == ""
