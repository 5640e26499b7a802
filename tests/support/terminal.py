"""A command in a pseudo-terminal, everything it wrote there, and what a person sees of it."""

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

# Nothing takes so long but on a machine that is busy with much else [s].
TIMEOUT_S = 150.0
# What a forked interpreter still takes from its environment.
FORKABLE = {"TERM", "COLORTERM", "NO_COLOR", "DISPLAY", "FASACO_CONNECT"}


class Terminal:
    """A terminal with a command in it; closed, with the command ended, on every way out.

    The command is forked, see ``tests.support.forked``; unless it is to be ``executed``, is another
    program, or has an environment that an interpreter looks at when it starts.
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
        # What is read may end within a character.
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
            # In a session of its own, whose terminal this is: Ctrl-C is a signal then.
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
        """Take in what was written."""
        while select.select([self._master], [], [], timeout_s)[0]:
            text = self._decoder.decode(os.read(self._master, 65536))
            self.written += text
            self.shown.feed(text)

    def wait(self, holds: Callable[[str], bool]) -> str:
        """Wait until the screen is such; return it, as it is seen."""
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
        """Return the lines that are seen now, also those above the screen."""
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
        """Tell whether the terminal is as it was before: its mode, screen, and the cursor shown."""
        shown = self.shown
        return not (shown.hides_cursor or shown.is_alternate) and self._mode() == self.mode

    def _mode(self) -> list[Any]:
        return termios.tcgetattr(self._slave)
