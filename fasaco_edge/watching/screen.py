"""A terminal's other screen: entered, written to, and left as it was found."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import termios
import tty
from types import FrameType
from typing import Any, Self, TextIO

ENTER = "\x1b[?1049h\x1b[?25l\x1b[2J"
LEAVE = "\x1b[0m\x1b[?25h\x1b[?1049l"
# Terminals that know it show a whole page at once, the others pass it over.
BEGIN_PAGE, END_PAGE = "\x1b[?2026h", "\x1b[?2026l"


class Screen:
    """Shows pages of lines; sends only lines that changed."""

    def __init__(self, terminal: TextIO) -> None:
        self._terminal = terminal
        self._keyboard = sys.stdin if sys.stdin is not None and sys.stdin.isatty() else None
        self._is_heard = True
        self._before: list[Any] | None = None
        self._shown: list[str] = []
        self._size = (0, 0)
        self._stop_as_ever: Any = None

    def __enter__(self) -> Self:
        self._stop_as_ever = signal.signal(signal.SIGTSTP, self._suspend)
        self._begin()
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGTSTP, self._stop_as_ever)
        self._end()

    def size(self) -> tuple[int, int]:
        """Return columns and lines, as they are now."""
        try:
            size = os.get_terminal_size(self._terminal.fileno())
        except OSError:
            return 80, 24
        return max(size.columns, 1), max(size.lines, 1)

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
        """Return what was typed; wait up to ``timeout_s`` [s] for it."""
        keyboard = [self._keyboard.fileno()] if self._keyboard and self._is_heard else []
        ready, _, _ = select.select(keyboard, [], [], timeout_s)
        if not ready:
            return ""
        try:
            typed = os.read(ready[0], 1024)
        except OSError:
            typed = b""
        if not typed:
            # Nobody types there any more; it would be ready for ever.
            self._is_heard = False
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
        """Stop as Ctrl-Z asks, with the terminal as it was; go on where ``fg`` does."""
        self._end()
        os.kill(os.getpid(), signal.SIGSTOP)
        self._begin()

    def _write(self, text: str) -> None:
        # Past the stream's buffer: what a terminal that is gone did not take must not wait there.
        left = text.encode(self._terminal.encoding, errors="replace")
        while left:
            left = left[os.write(self._terminal.fileno(), left) :]
