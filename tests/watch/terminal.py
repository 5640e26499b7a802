"""`fasaco-edge watch` in a pseudo-terminal, and the pages it drew there."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tests.support import terminal
from tests.support.processes import ENVIRONMENT, PROGRAM


class Terminal(terminal.Terminal):
    def __init__(self, *words: str, **options: Any) -> None:
        super().__init__("watch", *words, **options)

    def quit(self) -> None:
        """Quit by a key; the terminal must be as it was before."""
        self.type("q")
        assert self.end() == 0
        assert self.is_clean()


@contextmanager
def piped(*words: str) -> Iterator[subprocess.Popen[str]]:
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
