"""Command in a pseudo-terminal: everything it wrote, and the visible screen."""

from __future__ import annotations

import codecs
import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import termios
import time
from collections.abc import Callable, Sequence
from typing import Any, Self

from tests.support.forked import Forked
from tests.support.processes import ENVIRONMENT, PROGRAM
from tests.support.screen import Screen

# Time limit [s]; only a very busy machine needs most of it.
TIMEOUT_S = 150.0
# Variables that a forked interpreter still reads from its environment.
FORKABLE = {"TERM", "COLORTERM", "NO_COLOR", "DISPLAY", "FASACO_CONNECT"}


class Terminal:
    """A terminal with a command; on exit, the command is killed and the terminal closed.

    The command is forked, see ``tests.support.forked``. It is started instead if ``executed``, if
    it is another program, or if an interpreter reads its environment at its start.
    """

    def __init__(
        self,
        *words: object,
        columns: int = 80,
        lines: int = 24,
        program: Sequence[str] = PROGRAM,
        executed: bool = False,
        **env: str,
    ) -> None:
        self.written = ""
        self.shown = Screen(columns)
        # A read may end inside a character.
        self._decoder = codecs.getincrementaldecoder("utf-8")()
        self._master, self._slave = pty.openpty()
        self.resize(columns, lines)
        self.mode = self._mode()
        environment = {k: v for k, v in ENVIRONMENT.items() if k not in ("NO_COLOR", "COLUMNS")}
        environment |= {"TERM": "xterm-256color", "COLORTERM": "truecolor"} | env
        command, device = (*program, *map(str, words)), os.ttyname(self._slave)
        self.process: subprocess.Popen[bytes] | Forked
        if program == PROGRAM and not executed and set(env) <= FORKABLE:
            self.process = Forked(command[1:], environment, device, device)
            return
        self.process = subprocess.Popen(
            # This is the terminal of the command's own session, so that Ctrl-C sends a signal.
            ["setsid", "--ctty", *command],
            stdin=self._slave,
            stdout=self._slave,
            stderr=self._slave,
            env=environment,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.hang_up()

    def hang_up(self) -> None:
        """Close the terminal, as a window is closed."""
        for end in (self._master, self._slave):
            if end >= 0:
                os.close(end)
        self._master = self._slave = -1

    def resize(self, columns: int, lines: int) -> None:
        """Give it another size."""
        self.shown.columns = columns
        fcntl.ioctl(self._slave, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))

    def type(self, keys: str) -> None:
        """Type something."""
        os.write(self._master, keys.encode())

    def read(self, timeout_s: float = 0.05) -> None:
        """Read the text that was written."""
        while select.select([self._master], [], [], timeout_s)[0]:
            text = self._decoder.decode(os.read(self._master, 65536))
            self.written += text
            self.shown.feed(text)

    def wait(self, holds: Callable[[str], bool]) -> str:
        """Wait until ``holds`` is true of the visible screen; return the screen."""
        deadline = time.monotonic() + TIMEOUT_S
        while not holds(screen := "\n".join(self.screen())):
            assert self.process.poll() is None, self.written[-2000:]
            assert time.monotonic() < deadline, screen
            self.read()
        return screen

    def wait_text(self, text: str) -> str:
        """Wait until the screen shows a text."""
        return self.wait(lambda screen: text in screen)

    def screen(self) -> list[str]:
        """Return the visible lines, and those scrolled off the top."""
        return self.shown.lines()

    def end(self, number: signal.Signals | None = None) -> int:
        """Send a signal; wait for the end, and return the exit code."""
        if number is not None:
            self.process.send_signal(number)
        deadline = time.monotonic() + 60.0
        while self.process.poll() is None:
            assert time.monotonic() < deadline, "does not end"
            self.read()
        self.read()
        return self.process.returncode

    def is_clean(self) -> bool:
        """Return whether the terminal has its first mode and screen again, and shows the cursor."""
        shown = self.shown
        return not (shown.hides_cursor or shown.is_alternate) and self._mode() == self.mode

    def _mode(self) -> list[Any]:
        return termios.tcgetattr(self._slave)
