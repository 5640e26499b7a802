"""The view of a demo: the live map of ``watch`` on a terminal, a progress bar, or lines of text."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Protocol, Self

from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.table import Column

from fasaco_edge.cli.console.terminal import (
    CLOCK,
    NARROW_BAR,
    Description,
    ProgressLines,
    can_draw,
    err,
)
from fasaco_edge.client import phrases
from fasaco_edge.wire.documents.status import Status

PLAIN_LINE_EVERY_S = 5.0
WAIT_S = 0.25
# Size of a terminal from which a map in it can be read [characters].
LEAST_COLUMNS, LEAST_LINES = 60, 20
# Widths of a percentage, and of as many figures as a name of a robot leaves [characters].
PERCENT, LEAST_FIGURES = 5, 24


class DemoView(Protocol):
    """Shows a demo; a context manager."""

    def __enter__(self) -> Self:
        """Begin to show it."""

    def __exit__(self, *_: object) -> None:
        """Leave the terminal as it was."""

    def run(self, step: Callable[[float], bool]) -> None:
        """Call ``step`` until it returns True, each time with how long it may wait [s].

        Raises:
            KeyboardInterrupt: the user quits.
        """

    def show(self, robot: int, status: Status, elapsed_s: float) -> None:
        """Show one status of the robot with this number."""

    def say(self, text: str) -> None:
        """Show what happened in a line."""


def demo_view(title: str, robots: Sequence[str], endpoint: str) -> DemoView:
    """Return the view that fits the terminal.

    Args:
        title: name of the building.
        robots: names of the robots on the bus.
        endpoint: where their bus can be joined.
    """
    if _is_screen():
        try:
            from fasaco_edge.cli.demo.live_view import LiveView

            return LiveView(robots, endpoint)
        except ModuleNotFoundError as error:
            # Its folder may have been taken away.
            if not (error.name or "").startswith("fasaco_edge.watch"):
                raise
    return LinesView(robots if len(robots) > 1 else [title])


def _is_screen() -> bool:
    """Return whether standard error is a terminal for a map, and this process may type there."""
    if not can_draw(err()):
        return False
    terminal = err().file.fileno()
    size = os.get_terminal_size(terminal)
    if size.columns < LEAST_COLUMNS or size.lines < LEAST_LINES:
        return False
    try:
        # A process in the background is stopped when it changes the terminal's mode.
        return os.tcgetpgrp(terminal) == os.getpgrp()
    except OSError:  # it is not this session's terminal
        return False


class LinesView:
    """Shows the daemons' status as it comes in, a line a robot; without a terminal in plain lines.

    ``titles``: names of the lines.
    """

    def __init__(self, titles: Sequence[str]) -> None:
        self._bar = ProgressLines(
            Description(NARROW_BAR + PERCENT + CLOCK + LEAST_FIGURES + 4, style="bold"),
            BarColumn(bar_width=NARROW_BAR),
            TextColumn("{task.percentage:>3.0f} %", markup=False),
            TimeElapsedColumn(),
            # In a narrow terminal the figures are cut, and nothing else.
            TextColumn(
                "{task.fields[figures]}",
                markup=False,
                table_column=Column(ratio=1, no_wrap=True),
            ),
            expand=True,
        )
        self._titles = titles
        self._tasks = [self._bar.add_task(text, total=1.0, figures="starting") for text in titles]
        self._printed_at = [0.0] * len(titles)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def run(self, step: Callable[[float], bool]) -> None:
        """Call ``step`` until it returns True."""
        while not step(WAIT_S):
            pass

    def show(self, robot: int, status: Status, elapsed_s: float) -> None:
        """Show one status of the robot with this number."""
        fraction = status.coverage.fraction if status.coverage else 0.0
        text = phrases.figures(status)
        self._bar.update(self._tasks[robot], completed=fraction, figures=text)
        now = time.monotonic()
        if not self._bar.disable or now - self._printed_at[robot] < PLAIN_LINE_EVERY_S:
            return
        self._printed_at[robot] = now
        name = f"{self._titles[robot]}  " if len(self._tasks) > 1 else ""
        line = f"{elapsed_s:6.1f} s  {name}{100 * fraction:5.1f} % of cells  {text}"
        err().print(line, soft_wrap=True)

    def say(self, text: str) -> None:
        """Print a line above the bar."""
        err().print(text)
