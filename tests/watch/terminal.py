"""`fasaco-edge watch` in a pseudo-terminal, and the pages it drew there."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

from fasaco_edge.watch.live import END_PAGE
from tests.support import terminal
from tests.support.processes import ENVIRONMENT, PROGRAM
from tests.watch.grids import plain

_LINE = re.compile(r"\x1b\[(\d+);1H")


class Terminal(terminal.Terminal):
    """A terminal with ``watch`` in it."""

    def __init__(self, *words: str, columns: int = 80, lines: int = 24, **env: str) -> None:
        super().__init__("watch", *words, columns=columns, lines=lines, **env)

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

    def is_clean(self) -> bool:
        """Tell whether the terminal is as it was before, and shows what it did."""
        left, entered = self.written.rfind("\x1b[?1049l"), self.written.rfind("\x1b[?1049h")
        hidden = self.written.rfind("\x1b[?25l")
        return 0 <= entered < left and hidden >= 0 and super().is_clean()


@contextmanager
def piped(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Run ``watch`` into pipes; whatever happens meanwhile, it is over afterwards."""
    with subprocess.Popen(
        [*PROGRAM, "watch", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT | {"PYTHONUNBUFFERED": "1"},
    ) as process:
        try:
            yield process
        finally:
            process.kill()
