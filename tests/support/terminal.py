"""A command in a pseudo-terminal, everything it wrote there, and what a person sees of it."""

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
from collections.abc import Callable, Sequence
from typing import Any, Self

from tests.support.processes import ENVIRONMENT, PROGRAM

# Nothing takes so long but on a machine that is busy with much else [s].
TIMEOUT_S = 150.0
# What commands write that show progress; colours, and whether the cursor is shown.
_ESCAPE = re.compile(r"\x1b\[([0-9;?]*)([A-Za-z])")


class Terminal:
    """A terminal with a command in it; closed, with the command ended, on every way out."""

    def __init__(
        self,
        *words: object,
        columns: int = 80,
        lines: int = 24,
        program: Sequence[str] = PROGRAM,
        **env: str,
    ) -> None:
        self.written = ""
        self.columns = columns
        # What is read may end within a character.
        self._decoder = codecs.getincrementaldecoder("utf-8")()
        self._master, self._slave = pty.openpty()
        self.resize(columns, lines)
        self.mode = self._mode()
        environment = {k: v for k, v in ENVIRONMENT.items() if k not in ("NO_COLOR", "COLUMNS")}
        self.process = subprocess.Popen(
            # In a session of its own, whose terminal this is: Ctrl-C is a signal then.
            ["setsid", "--ctty", *program, *map(str, words)],
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
        """Return the lines that are seen now, also those above the screen."""
        return seen(self.written, self.columns)

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
        """Tell whether the terminal is as it was before: its mode, and the cursor shown."""
        hidden, shown = self.written.rfind("\x1b[?25l"), self.written.rfind("\x1b[?25h")
        return hidden <= shown and self._mode() == self.mode

    def _mode(self) -> list[Any]:
        return termios.tcgetattr(self._slave)


def seen(written: str, columns: int) -> list[str]:
    """Return the lines that a terminal of endless height shows of what was written to it.

    Raises:
        AssertionError: for an escape that no command which shows progress has a use for.
    """
    # As a terminal whose driver makes of a line end a carriage return as well.
    rows, row, column, at = [""], 0, 0, 0
    while at < len(written):
        escape = _ESCAPE.match(written, at)
        if escape is not None:
            at = escape.end()
            match escape.groups():
                case (_, "m") | ("?25", "l" | "h"):
                    pass
                case (count, "A"):
                    row = max(row - int(count or 1), 0)
                case ("2", "K"):
                    rows[row] = ""
                case _:
                    raise AssertionError(f"what is {escape[0]!r} for?")
            continue
        sign, at = written[at], at + 1
        if sign == "\r":
            column = 0
        elif sign == "\n":
            row += 1
        else:
            assert sign.isprintable(), f"what is {sign!r} for?"
            if column == columns:
                row, column = row + 1, 0
            rows += [""] * (row + 1 - len(rows))
            rows[row] = f"{rows[row]:{column}}"[:column] + sign + rows[row][column + 1 :]
            column += 1
        rows += [""] * (row + 1 - len(rows))
    return [text.rstrip() for text in rows]
