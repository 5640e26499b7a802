"""The demo in a terminal: one bar and a few figures; plain lines where there is no terminal."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any, Self

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from fasaco_edge.cli.terminal import err
from fasaco_edge.watching import phrases

PLAIN_LINE_EVERY_S = 5.0


class DemoView:
    """Shows the daemon's status as it comes in."""

    def __init__(self, title: str) -> None:
        self._console = err()
        self._bar = Progress(
            TextColumn("{task.description}", style="bold", markup=False),
            BarColumn(bar_width=28),
            TaskProgressColumn(),
            TextColumn("{task.fields[figures]}", markup=False),
            TimeElapsedColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task(title, total=1.0, figures="starting")
        self._printed_at = 0.0

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def show(self, status: dict[str, Any], elapsed_s: float) -> None:
        """Show one status."""
        coverage = status.get("coverage") or {}
        fraction, text = coverage.get("fraction", 0.0), _figures(status, coverage)
        self._bar.update(self._task, completed=fraction, figures=text)
        now = time.monotonic()
        if not self._console.is_terminal and now - self._printed_at >= PLAIN_LINE_EVERY_S:
            self._printed_at = now
            line = f"{elapsed_s:6.1f} s  {100 * fraction:5.1f} %  {text}"
            self._console.print(line, soft_wrap=True)


def _figures(status: dict[str, Any], coverage: dict[str, Any]) -> str:
    path = status.get("path") or {}
    return phrases.figures(
        status["state"],
        coverage.get("covered", 0),
        coverage.get("coverable", 0),
        path.get("revision", 0),
        path.get("remaining_steps", 0),
        status["plan"]["plans"],
        status["latency_ms"]["plan"] or 0.0,
    )
