"""The loop of a live view on a terminal's alternate screen, in plain lines, or as JSON."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import termios
import time
import tty
from types import FrameType
from typing import Any, Self, TextIO

from rich.console import Console

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.host.processes import stop_event
from fasaco_edge.text import json_line, one_line
from fasaco_edge.watch import phrases
from fasaco_edge.watch.feed import Feed
from fasaco_edge.watch.page import Page
from fasaco_edge.watch.robot_view import RobotView
from fasaco_edge.wire.documents.json_text import decode_json
from fasaco_edge.wire.topics import PHEROMONE

END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# At most ten pages a second, and only if the content or the clock changed [s].
FRAME_S = 0.1
LINE_EVERY_S = 1.0
# The largest page. A terminal may claim 65,535 x 65,535, and a page would take gigabytes.
MOST_COLUMNS, MOST_LINES = 800, 400
# Time to wait for the rest after a status [s].
REST_S = 1.0


def take(feed: Feed, view: RobotView, timeout_s: float) -> list[tuple[str, object]]:
    """Take in arrivals, and return them; wait up to ``timeout_s`` [s] for one."""
    items = feed.take(timeout_s)
    now = phrases.steady_now()
    for topic, item in items:
        view.take(topic, item, now)
    view.trouble = feed.trouble
    return items


def watch_on_screen(feed: Feed, view: RobotView, console: Console) -> None:
    """Show the mission until q is typed or a signal arrives.

    f shows the living trail in place of coverage and path, and back.

    Raises:
        OSError: the terminal is gone.
    """
    page, shown_at = Page(console), (0, (0, 0), "")
    with stop_event(*END_SIGNALS) as stop, Screen(sys.stdout) as screen:
        while not stop.is_set():
            came = take(feed, view, 0.0)
            now = phrases.steady_now()
            key = (int(now), screen.size(), view.trouble)
            if came or key != shown_at:
                shown_at, size = key, key[1]
                screen.show(page.lines(view, now, *size), size)
            typed = screen.keys(FRAME_S).lower()
            if "q" in typed:
                return
            if typed.count("f") % 2:
                shown_at = (0, (0, 0), "")
                feed.want(PHEROMONE, page.toggle_field())


def watch_in_lines(feed: Feed, view: RobotView) -> None:
    """Print events, and once a second the state, until a signal arrives."""
    # What exists already arrives within the first second.
    printed, last_line, next_line_at = 0, "", phrases.steady_now() + LINE_EVERY_S
    with stop_event(*END_SIGNALS) as stop:
        while not stop.is_set():
            take(feed, view, FRAME_S)
            now = phrases.steady_now()
            for entry in view.events.since(printed):
                _print_line(entry.at_s, entry.text)
            printed = view.events.count
            if now >= next_line_at:
                next_line_at, line = now + LINE_EVERY_S, status_line(view, now)
                if line != last_line:
                    last_line = line
                    _print_line(now, line)


def watch_as_json(feed: Feed, view: RobotView) -> None:
    """Print each status as a line of JSON, until a signal arrives."""
    with stop_event(*END_SIGNALS) as stop:
        while not stop.is_set():
            for topic, item in take(feed, view, FRAME_S):
                if topic == "status" and isinstance(item, Sample):
                    print_json(item.payload)


def look_once(feed: Feed, view: RobotView, timeout_s: float) -> bool:
    """Wait up to ``timeout_s`` [s] until enough is known for a picture; return whether it is."""
    deadline = time.monotonic() + timeout_s
    with stop_event(*END_SIGNALS) as stop:
        while view.status is None or not view.is_here:
            if stop.is_set() or time.monotonic() > deadline:
                return False
            take(feed, view, FRAME_S)
        deadline = time.monotonic() + REST_S
        while not (stop.is_set() or _is_whole(view)) and time.monotonic() < deadline:
            take(feed, view, FRAME_S)
    return True


def status_line(view: RobotView, now: float) -> str:
    """Return the state in a line."""
    status = view.status
    if view.trouble:
        return f"waiting for the bus at {one_line(view.trouble)}"
    if view.gone_since is not None:
        return "waiting for the daemon to return"
    if not view.is_here:
        return f"waiting for a daemon of robot {view.robot}"
    if status is None:
        return "no status from the daemon yet"
    if view.silent_s(now):
        return "the daemon is silent"
    fraction = status.coverage.fraction if status.coverage else 0.0
    return f"{phrases.percent(fraction)} of cells  {phrases.figures(status)}"


def print_json(payload: bytes) -> None:
    """Print a JSON object as one line, whatever its layout."""
    print(json_line(decode_json(payload)), flush=True)


def _is_whole(view: RobotView) -> bool:
    return view.map is not None and view.coverage is not None and view.walk.revision > 0


def _print_line(at_s: float, text: str) -> None:
    sys.stdout.write(f"{phrases.clock(at_s)}  {text}\n")
    sys.stdout.flush()


ENTER = "\x1b[?1049h\x1b[?25l\x1b[2J"
LEAVE = "\x1b[0m\x1b[?25h\x1b[?1049l"
# Terminals that know it show a whole page at once, the others ignore it.
BEGIN_PAGE, END_PAGE = "\x1b[?2026h", "\x1b[?2026l"


class Screen:
    """Shows pages of lines; sends only lines that changed."""

    def __init__(self, terminal: TextIO) -> None:
        self._terminal = terminal
        self._keyboard = sys.stdin if sys.stdin is not None and sys.stdin.isatty() else None
        self._has_input = True
        self._before: list[Any] | None = None
        self._shown: list[str] = []
        self._size = (0, 0)
        self._old_handler: Any = None

    def __enter__(self) -> Self:
        self._old_handler = signal.signal(signal.SIGTSTP, self._suspend)
        self._begin()
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGTSTP, self._old_handler)
        self._end()

    def size(self) -> tuple[int, int]:
        """Return columns and lines that are shown, as they are now."""
        try:
            size = os.get_terminal_size(self._terminal.fileno())
        except OSError:
            return 80, 24
        return min(max(size.columns, 1), MOST_COLUMNS), min(max(size.lines, 1), MOST_LINES)

    def show(self, lines: list[str], size: tuple[int, int]) -> None:
        """Show a page of ``size``, columns and lines.

        Raises:
            OSError: the terminal is gone.
        """
        if size != self._size:
            self._size, self._shown = size, []
        begin = "" if self._shown else "\x1b[0m\x1b[2J"
        shown = self._shown or [""] * len(lines)
        changed = [
            f"\x1b[{number};1H{line}"
            for number, (line, old) in enumerate(zip(lines, shown, strict=True), 1)
            if line != old
        ]
        if changed:
            self._write(f"{BEGIN_PAGE}{begin}{''.join(changed)}{END_PAGE}")
            self._shown = lines

    def keys(self, timeout_s: float) -> str:
        """Return the typed keys; wait up to ``timeout_s`` [s] for one."""
        keyboard = [self._keyboard.fileno()] if self._keyboard and self._has_input else []
        ready, _, _ = select.select(keyboard, [], [], timeout_s)
        if not ready:
            return ""
        try:
            typed = os.read(ready[0], 1024)
        except OSError:
            typed = b""
        if not typed:
            # The input has ended; it would always be ready.
            self._has_input = False
        return typed.decode(errors="replace")

    def _begin(self) -> None:
        if self._keyboard is not None:
            self._before = termios.tcgetattr(self._keyboard)
            # Keys come at once and are not shown; Ctrl-C and Ctrl-Z stay what they are.
            tty.setcbreak(self._keyboard)
        self._shown = []
        self._write(ENTER)

    def _end(self) -> None:
        with contextlib.suppress(OSError):
            self._write(LEAVE)
        if self._before is not None and self._keyboard is not None:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._keyboard, termios.TCSADRAIN, self._before)

    def _suspend(self, _number: int, _frame: FrameType | None) -> None:
        """Stop as Ctrl-Z asks, with the terminal restored; continue after ``fg``."""
        self._end()
        os.kill(os.getpid(), signal.SIGSTOP)
        self._begin()

    def _write(self, text: str) -> None:
        # Without the stream's buffer: after the terminal is gone, data must not stay in it.
        left = text.encode(self._terminal.encoding, errors="replace")
        while left:
            left = left[os.write(self._terminal.fileno(), left) :]
