"""Loop of a live view: on a terminal's alternate screen, in plain lines, or as JSON."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import termios
import time
import tty
from abc import ABC, abstractmethod
from collections.abc import Callable
from types import FrameType
from typing import Any, Protocol, Self, TextIO

from fasaco_edge.client import phrases
from fasaco_edge.client.phrases import EventLog
from fasaco_edge.host.processes import stop_event
from fasaco_edge.text import json_line

END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Least time between two pages, and between two lines [s].
FRAME_S = 0.1
LINE_EVERY_S = 1.0
# Largest page: some terminals report sizes for which a page would take gigabytes.
MOST_COLUMNS, MOST_LINES = 800, 400


class WatchedView(Protocol):
    """The newest data of a robot or a fleet.

    Attributes:
        events: the latest events.
        trouble: why the bus cannot be reached; "" if it can.
    """

    events: EventLog
    trouble: str


class Watched(ABC):
    """A watch of one robot, or of a fleet.

    Attributes:
        most_wait_s: longest wait from ``is_known`` to ``is_whole`` [s].
        view: its newest data.
    """

    most_wait_s: float
    view: WatchedView

    @abstractmethod
    def take(self, timeout_s: float) -> bool:
        """Take in arrivals; wait up to ``timeout_s`` [s] for one; return whether one came."""

    @abstractmethod
    def documents(self) -> list[dict[str, object]]:
        """Return the JSON objects that are due after the last ``take``."""

    @abstractmethod
    def document(self) -> dict[str, object]:
        """Return the present state as a JSON object."""

    @abstractmethod
    def line(self, now: float) -> str:
        """Return the state in a line."""

    @abstractmethod
    def page(self, now: float, width: int, height: int, *keys: str) -> list[str]:
        """Return a page of lines; ``keys``: hints for its headline."""

    @abstractmethod
    def is_known(self) -> bool:
        """Return whether there is something to show."""

    @abstractmethod
    def is_whole(self) -> bool:
        """Return whether everything that a page shows is known."""


def watch_on_screen(
    watched: Watched, terminal: TextIO, go_on: Callable[[], bool] = lambda: True
) -> bool:
    """Show pages until q is typed, a signal arrives, or ``go_on`` returns False.

    ``go_on`` is called before each page. Return whether q was typed.

    Raises:
        OSError: the terminal is gone.
    """
    shown_at = (0, (0, 0), "")
    with stop_event(*END_SIGNALS) as stop, Screen(terminal) as screen:
        while not stop.is_set() and go_on():
            came = watched.take(0.0)
            now = phrases.steady_now()
            key = (int(now), screen.size(), watched.view.trouble)
            if came or key != shown_at:
                shown_at, size = key, key[1]
                screen.show(watched.page(now, *size, "q quits"), size)
            if "q" in screen.keys(FRAME_S).lower():
                return True
    return False


def watch_in_lines(watched: Watched) -> None:
    """Print events, and once a second the state, until a signal arrives."""
    # No line before the present state has arrived, which takes less than a second.
    printed, last_line, next_line_at = 0, "", phrases.steady_now() + LINE_EVERY_S
    with stop_event(*END_SIGNALS) as stop:
        while not stop.is_set():
            watched.take(FRAME_S)
            now = phrases.steady_now()
            for entry in watched.view.events.since(printed):
                _print_line(entry.at_s, entry.text)
            printed = watched.view.events.count
            if now >= next_line_at:
                next_line_at, line = now + LINE_EVERY_S, watched.line(now)
                if line != last_line:
                    last_line = line
                    _print_line(now, line)


def watch_as_json(watched: Watched) -> None:
    """Print JSON objects, each on a line, until a signal arrives."""
    with stop_event(*END_SIGNALS) as stop:
        while not stop.is_set():
            watched.take(FRAME_S)
            for document in watched.documents():
                print(json_line(document), flush=True)


def look_once(watched: Watched, timeout_s: float) -> bool:
    """Wait up to ``timeout_s`` [s] until enough is known for a page; return whether it is."""
    deadline = time.monotonic() + timeout_s
    with stop_event(*END_SIGNALS) as stop:
        while not watched.is_known():
            if stop.is_set() or time.monotonic() > deadline:
                return False
            watched.take(FRAME_S)
        deadline = time.monotonic() + watched.most_wait_s
        while not (stop.is_set() or watched.is_whole()) and time.monotonic() < deadline:
            watched.take(FRAME_S)
    return True


def _print_line(at_s: float, text: str) -> None:
    sys.stdout.write(f"{phrases.clock(at_s)}  {text}\n")
    sys.stdout.flush()


ENTER = "\x1b[?1049h\x1b[?25l\x1b[2J"
LEAVE = "\x1b[0m\x1b[?25h\x1b[?1049l"
# Synchronised output: terminals that support it show a whole page at once, others ignore it.
BEGIN_PAGE, END_PAGE = "\x1b[?2026h", "\x1b[?2026l"


class Screen:
    """Alternate screen of a terminal; sends only lines that have changed."""

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
        """Return the present numbers of columns and lines."""
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
            # Keys arrive at once and are not echoed; Ctrl-C and Ctrl-Z still send their signals.
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
        """Restore the terminal and stop, on Ctrl-Z; continue after ``fg``."""
        self._end()
        os.kill(os.getpid(), signal.SIGSTOP)
        self._begin()

    def _write(self, text: str) -> None:
        # Unbuffered: data left in the stream's buffer would fail later if the terminal is gone.
        left = text.encode(self._terminal.encoding, errors="replace")
        while left:
            left = left[os.write(self._terminal.fileno(), left) :]
