"""Terminal output: tables on standard output, progress bars on standard error."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from fasaco_edge.text import lines, one_line


class CleanConsole(Console):
    """A console to which a string is one line of plain text: no mark-up, nothing that controls."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, highlight=False, markup=False, emoji=False)

    def render_str(self, text: str, **options: Any) -> Text:  # noqa: ANN401 - as rich has them
        """Return a string as text; before it is laid out, so that its width is right."""
        return super().render_str(one_line(text), **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the sanitized output, also of text from other renderables."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=lines(segment.text))


def out() -> Console:
    """Return the console for results."""
    return CleanConsole()


def err() -> Console:
    """Return the console for progress and remarks."""
    return CleanConsole(stderr=True)


def progress(*, counted: bool = True) -> Progress:
    """Return a progress bar that leaves nothing behind; ``counted`` shows how much is done."""
    count = (MofNCompleteColumn(),) if counted else ()
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=32),
        *count,
        TimeElapsedColumn(),
        console=err(),
        transient=True,
        disable=not err().is_terminal,
    )


def figures(rows: Iterable[tuple[str, str]]) -> Table:
    """Return a table of names and values."""
    table = Table(show_header=False)
    table.add_column(style="cyan")
    table.add_column()
    for name, value in rows:
        table.add_row(name, value)
    return table
