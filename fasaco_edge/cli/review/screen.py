"""The screens of ``fasaco-edge review``: one run in short or in full, or two side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from fasaco_edge.cli.console import terminal
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.review.comparison import (
    compared_rows,
    setup_differences,
    setup_words,
)
from fasaco_edge.review.document import ReviewDocument
from fasaco_edge.review.figures import figures
from fasaco_edge.review.output import rows
from fasaco_edge.review.output.answers import verdicts
from fasaco_edge.text import one_line

if TYPE_CHECKING:
    from fasaco_edge.review.review import Review

EIGHTHS, PLAIN_EIGHTHS = " ▁▂▃▄▅▆▇█", " ..::++##"
PLOT_WIDTH, PLOT_HEIGHT, SCREEN_PLOT_HEIGHT = 64, 6, 4
MOST_VERDICTS = 4
# Longest shown value of a setting; a keep-out mask has kilobytes [characters].
MOST_OF_SETTING = 80


def print_review(review: Review, document: ReviewDocument, *, full: bool) -> None:
    """Print a review and its document, in full or on one screen."""
    console = terminal.out()
    colours = {True: "green", False: "red", None: "yellow"}
    every = verdicts(document)
    shown_verdicts = every if full else every[:MOST_VERDICTS]
    for complete, text in shown_verdicts:
        verdict = Text(one_line(text), colours[complete])
        if full:
            console.print(f"{document.recording}:", verdict, style="bold", soft_wrap=True)
        else:
            console.print(verdict)
    if len(every) > len(shown_verdicts):
        console.print(f"and {len(every) - MOST_VERDICTS} more orders")
    _print_curve(console, review, PLOT_HEIGHT if full else SCREEN_PLOT_HEIGHT)
    found = rows.screen_rows(review, document)
    if not full:
        shown = _fitting(console, found, [text for _, text in shown_verdicts])
        console.print(terminal.summary(shown))
        left_out = len(found) - len(shown)
        more = f"{left_out} more row{'s' * (left_out != 1)}" if left_out else "more"
        console.print(f"{more}: --long; a time: --at MM:SS; a spot: --point X,Y; a page: serve")
        return
    console.print(terminal.summary([*found, *rows.card_rows(document)]))
    console.print(terminal.figures([(each.name, each.text) for each in figures(document)]))
    for title, columns, cells in rows.tables(review, document):
        _print_table(console, title, columns, cells)
    _print_remarks(console, document)


def _fitting(
    console: Console, found: list[tuple[str, str]], above: Sequence[str]
) -> list[tuple[str, str]]:
    """Return the first rows, as many as fit on the terminal."""

    def height(shown: RenderableType) -> int:
        return len(console.render_lines(shown))

    # 2 lines for title and times of the curve, and 2 for the last line and the prompt.
    room = console.height - sum(map(height, above)) - (2 + SCREEN_PLOT_HEIGHT) - 2
    shown = list(found)
    while console.is_terminal and len(shown) > 1 and height(terminal.summary(shown)) > room:
        shown.pop()
    return shown


def print_comparison(one: ReviewDocument, other: ReviewDocument) -> None:
    """Print the figures of two documents side by side."""
    console = terminal.out()
    names = (one.recording, other.recording)
    setup = setup_differences(one, other)
    _say(console, setup_words(setup), style="bold")
    shown = [(what, *(one_line(text, MOST_OF_SETTING) for text in texts)) for what, *texts in setup]
    _print_table(console, "Set-up", ("", *names), shown)
    compared = compared_rows(one, other)
    _print_table(console, "Two runs", ("", *names, "difference"), compared)
    for document in (one, other):
        for _, text in rows.clock_rows(document):
            _say(console, f"{document.recording}: its clock is {text}")
        _print_remarks(console, document)


def _print_curve(console: Console, review: Review, height: int) -> None:
    at_s, shares = review.covered_share.T
    if not len(at_s):
        return
    marks = EIGHTHS if console.encoding.startswith("utf") else PLAIN_EIGHTHS
    lines = curve(at_s, shares, review.duration_s, PLOT_WIDTH, height, marks)
    labels = ["100 %", *[""] * (height - 2), "0 %"]
    console.print(Text("Coverage over time", "bold"), "of the cells coverable at the end")
    for label, line in zip(labels, lines, strict=True):
        console.print(f"{label:>6}", Text(line, "cyan"))
    end = clock(review.duration_s)
    console.print(f"{'':>6} 0:00{end:>{PLOT_WIDTH - 4}}")


def _print_remarks(console: Console, document: ReviewDocument) -> None:
    for part in document.files:
        if part.torn_bytes:
            torn = f"torn, its last {part.torn_bytes} bytes are lost"
            console.print(f"{part.path}: {torn}", soft_wrap=True)
    for remark in document.remarks:
        _say(console, f"recorder: {remark}")
    for line in rows.unknown_lines(document):
        _say(console, line)


def _say(console: Console, text: str, style: str = "") -> None:
    """Print a text, wrapped only on a terminal."""
    console.print(text, style=style, soft_wrap=not console.is_terminal)


def _print_table(
    console: Console, title: str, columns: Sequence[str], cells: Sequence[Sequence[str]]
) -> None:
    if not cells:
        return
    if not columns:
        console.print(title, style="bold")
        console.print(terminal.figures([(name, text) for name, text in cells]))
        return
    table = Table(title=title, title_justify="left", title_style="bold")
    for index, column in enumerate(columns):
        last = index == len(columns) - 1 and index > 1
        table.add_column(column, overflow="fold", justify="left" if last or not index else "right")
    for row in cells:
        table.add_row(*row)
    console.print(table)


def curve(
    at_s: NDArray[np.float64],
    shares: NDArray[np.float64],
    end_s: float,
    width: int,
    height: int,
    marks: str = EIGHTHS,
) -> list[str]:
    """Return a curve of a share over time as lines of text, from top to bottom.

    Args:
        at_s: float64 (n,), ascending times at which the share changes [s].
        shares: float64 (n,), values from these times on, 0 to 1; before the first time it is 0.
        end_s: time at the right end [s]; the left end is 0.
        width, height: size of the curve [characters].
        marks: nine characters, from empty to full.
    """
    places = (np.arange(width) + 1) / width * end_s
    index = np.searchsorted(at_s, places, side="right")
    levels = np.concatenate(([0.0], shares))[index]
    eighths = np.rint(np.clip(levels, 0, 1) * height * 8).astype(int)
    # Only a value of 0 is drawn empty, and only a value of 1 full.
    eighths[(levels > 0) & (eighths == 0)] = 1
    eighths[(levels < 1) & (eighths == 8 * height)] -= 1
    return [
        "".join(marks[min(max(eighth - 8 * row, 0), 8)] for eighth in eighths.tolist())
        for row in reversed(range(height))
    ]
