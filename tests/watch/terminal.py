"""`fasaco-edge watch` in a pseudo-terminal, and everything it wrote there."""

from __future__ import annotations

import codecs
import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import termios
import time
from collections.abc import Callable
from typing import Any, Self

from fasaco_edge.watch.live import END_PAGE
from tests.support.processes import ENVIRONMENT, PROGRAM
from tests.watch.grids import plain

# Nothing takes so long but on a machine that is busy with much else [s].
TIMEOUT_S = 150.0
_LINE = re.compile(r"\x1b\[(\d+);1H")


class Terminal:
    """A terminal with a command in it; closed, with the command ended, on every way out."""

    def __init__(self, *words: str, columns: int = 80, lines: int = 24, **env: str) -> None:
        self.written = ""
        # What is read may end within a character.
        self._decoder = codecs.getincrementaldecoder("utf-8")()
        self._master, self._slave = pty.openpty()
        self.resize(columns, lines)
        self.mode = self._mode()
        environment = {k: v for k, v in ENVIRONMENT.items() if k not in ("NO_COLOR", "COLUMNS")}
        self.process = subprocess.Popen(
            # In a session of its own, whose terminal this is: Ctrl-C is a signal then.
            ["setsid", "--ctty", *PROGRAM, "watch", *words],
            stdin=self._slave,
            stdout=self._slave,
            stderr=self._slave,
            env=environment | {"TERM": "xterm-256color", "COLORTERM": "truecolor"} | env,
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
        fcntl.ioctl(self._slave, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))

    def type(self, keys: str) -> None:
        """Type something."""
        os.write(self._master, keys.encode())

    def read(self, timeout_s: float = 0.05) -> None:
        """Take in what was written."""
        while select.select([self._master], [], [], timeout_s)[0]:
            self.written += self._decoder.decode(os.read(self._master, 65536))

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
        """Return the lines that are seen now."""
        # Of the last page, that may have been read in part, no more than what is whole.
        whole = self.written.rpartition(END_PAGE)[0]
        page = whole.rpartition("\x1b[2J")[2].replace(END_PAGE, "")
        parts = _LINE.split(page)
        lines: dict[int, str] = {}
        for number, text in zip(parts[1::2], parts[2::2], strict=True):
            lines[int(number)] = plain(text)
        return [lines[number] for number in sorted(lines)]

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
        """Tell whether the terminal is as it was before."""
        left, shown = self.written.rfind("\x1b[?1049l"), self.written.rfind("\x1b[?25h")
        entered, hidden = self.written.rfind("\x1b[?1049h"), self.written.rfind("\x1b[?25l")
        return 0 <= entered < left and 0 <= hidden < shown and self._mode() == self.mode

    def _mode(self) -> list[Any]:
        return termios.tcgetattr(self._slave)
