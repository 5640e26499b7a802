"""The terminal: tables on standard output, progress bars and questions on standard error."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import sys
import sysconfig
import textwrap
import time
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.constrain import Constrain
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.segment import Segment
from rich.style import StyleType
from rich.table import Table
from rich.text import Text

from fasaco_edge.cli.console.streams import printed_by
from fasaco_edge.host.processes import first_signal_calls
from fasaco_edge.text import lines, one_line

# Usual width of a terminal, and widths of the columns of progress, without the space before each
# [characters].
USUAL_WIDTH, WIDE_BAR, NARROW_BAR, CLOCK, COUNT = 80, 32, 16, 7, 13
LEAST_DESCRIPTION = 8
# Least width of text beside an indent [characters].
LEAST_ROOM = 24
# Period of lines in place of a progress bar [s].
SAY_S = 20.0
# Space for the ``^C`` that a terminal prints [characters].
RIGHT_MARGIN = 2


class CleanConsole(Console):
    """A console that prints a string as one line of plain text, without control characters."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, highlight=False, markup=False, emoji=False)
        if self.is_dumb_terminal and self.file.isatty() and "COLUMNS" not in os.environ:
            # Rich assumes 80 columns for such a terminal.
            size = os.get_terminal_size(self.file.fileno())
            self.width, self.height = size.columns or self.width, size.lines or self.height

    def render_str(self, text: str, **options: Any) -> Text:  # noqa: ANN401 - as rich has them
        """Return a string as sanitized text; done before the layout, which needs its width."""
        return super().render_str(one_line(text), **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the sanitized output of any renderable."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=lines(segment.text))


@cache
def out() -> Console:
    """Return the console for results."""
    return CleanConsole()


@cache
def err() -> Console:
    """Return the console for progress and remarks, shared so that lines go above a progress bar."""
    return CleanConsole(stderr=True)


def can_draw(console: Console) -> bool:
    """Return whether a console is a terminal that can move its cursor."""
    # If the environment asks for colour, Rich treats any stream as a terminal.
    return console.is_interactive and console.file.isatty() and bool(os.environ.get("TERM"))


class ProgressLines(Progress):
    """Lines at the bottom of the terminal that show progress, and vanish at the end.

    Printed and logged text appears above them. On a terminal that cannot move its cursor they are
    ``disable``d, and nothing is written.
    """

    def __init__(self, *columns: ProgressColumn | str, expand: bool = False) -> None:
        console = err()
        super().__init__(
            *columns,
            console=console,
            expand=expand,
            transient=True,
            # Rich's own redirection would write escape sequences into CleanStream.
            redirect_stdout=False,
            redirect_stderr=False,
            disable=not can_draw(console),
        )
        self._while_shown = ExitStack()

    def start(self) -> None:
        """Show the lines."""
        if self.disable:
            return
        super().start()
        self._while_shown.enter_context(printed_by(self._print_above))
        # SIGTERM would end the process at once, and leave the cursor hidden.
        if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
            self._while_shown.enter_context(first_signal_calls(signal.SIGTERM, self._terminate))

    def stop(self) -> None:
        """Remove the lines."""
        if not self.disable:
            super().stop()
            self._while_shown.close()

    def get_renderable(self) -> RenderableType:
        """Return the text shown, with space beside it for ``^C``."""
        return Constrain(super().get_renderable(), max(err().width - RIGHT_MARGIN, 1))

    def _print_above(self, text: str) -> None:
        self.console.print(Text(text), soft_wrap=True)

    def _terminate(self) -> None:
        self.live.stop()
        os.kill(os.getpid(), signal.SIGTERM)


class Description(TextColumn):
    """The description of a task, truncated so that bar and clock keep their width."""

    def __init__(self, beside: int, style: StyleType = "none") -> None:
        """``beside``: width of the other columns, with the space before each [characters]."""
        super().__init__("{task.description}", style=style, markup=False)
        self._beside = beside

    def render(self, task: Task) -> Text:
        """Return the truncated text."""
        text = super().render(task)
        room = err().width - RIGHT_MARGIN - self._beside
        text.truncate(max(room, LEAST_DESCRIPTION), overflow="ellipsis")
        return text


class ProgressBar(ProgressLines):
    """A progress bar; without a terminal that can draw it, a line every ``SAY_S``, so that a log
    shows that long work goes on."""

    def __init__(self, *columns: ProgressColumn | str, counted: bool) -> None:
        super().__init__(*columns)
        self._said_at, self._is_counted = time.monotonic(), counted

    def update(self, task_id: TaskID, **changes: Any) -> None:  # noqa: ANN401 - as rich has them
        """Change a task, as ``Progress.update``."""
        super().update(task_id, **changes)
        if self.disable and time.monotonic() - self._said_at >= SAY_S:
            self._said_at, task = time.monotonic(), self._tasks[task_id]
            shows_count = self._is_counted and task.total
            count = f" ({task.completed:.0f} of {task.total:.0f})" if shows_count else ""
            err().print(f"{task.description}{count}", soft_wrap=True)


def progress(*, counted: bool = True) -> Progress:
    """Return a progress bar; ``counted``: whether it shows numbers."""
    count = (MofNCompleteColumn(),) if counted else ()
    bar = WIDE_BAR if err().width >= USUAL_WIDTH else NARROW_BAR
    return ProgressBar(
        Description(beside=bar + CLOCK + 2 + (COUNT + 1 if counted else 0)),
        BarColumn(bar_width=bar),
        *count,
        TimeElapsedColumn(),
        counted=counted,
    )


def figures(rows: Iterable[tuple[str, str]]) -> Table:
    """Return a table of names and values."""
    table = Table(show_header=False)
    table.add_column(style="cyan")
    table.add_column()
    for name, value in rows:
        table.add_row(name, value)
    return table


def known(document: Mapping[str, object]) -> list[tuple[str, str]]:
    """Return names and values of a document's members as text, without null ones."""
    return [
        (name, ", ".join(f"{key} {part}" for key, part in value.items()))
        if isinstance(value, Mapping)
        else (name, str(value))
        for name, value in document.items()
        if value is not None
    ]


def summary(rows: Iterable[tuple[str, str]]) -> Table:
    """Return a table of names and values without borders."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="cyan", no_wrap=True)
    table.add_column()
    for name, words in rows:
        table.add_row(name, words)
    return table


def wrapped(console: Console, text: str, begin: str = "", below: str = "") -> str:
    """Return a line wrapped at words for a console that is a terminal, else as one line.

    ``begin``, ``below``: what the first line and the others begin with.
    """
    room = max(console.width, len(below) + LEAST_ROOM) if console.is_terminal else sys.maxsize
    rows = textwrap.wrap(
        one_line(text),
        room,
        initial_indent=begin,
        subsequent_indent=below,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(rows)


def say(console: Console, text: str, begin: str = "", below: str = "") -> None:
    """Print a line as ``wrapped``: whole words stay whole, and a file gets one line."""
    console.print(Text(wrapped(console, text, begin, below)), soft_wrap=True)


def command(name: str = "fasaco-edge") -> str:
    """Return the command that runs a program of this installation in the current folder."""
    path, found = Path(sysconfig.get_path("scripts"), name), shutil.which(name)
    if not path.exists() or (found is not None and path.samefile(found)):
        return name
    here = Path.cwd()
    return shlex.quote(str(path.relative_to(here) if path.is_relative_to(here) else path))


def may_ask() -> bool:
    """Return whether a user can read and answer a question."""
    return sys.stdin.isatty() and sys.stderr.isatty()


def agrees(*facts: str) -> bool:
    """Print facts, and ask whether to continue; any answer but yes means no."""
    console = err()
    for fact in facts:
        console.print(fact)
    console.print("Go on? [y/N] ", end="")
    return sys.stdin.readline().strip().lower() in ("y", "yes")
