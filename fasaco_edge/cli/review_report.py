"""A review in a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fasaco_edge.cli.console import terminal
from fasaco_edge.review import rows
from fasaco_edge.review.comparison import (
    compared_rows,
    reason_counts,
    setup_differences,
    setup_words,
)
from fasaco_edge.review.pictures import EIGHTHS, PLAIN_EIGHTHS, covered_share, curve
from fasaco_edge.text import one_line

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from fasaco_edge.review.document import ReviewDocument
    from fasaco_edge.review.review import Review

PLOT_WIDTH, PLOT_HEIGHT = 64, 6
MOST_TROUBLES = 12


def print_review(review: Review, document: ReviewDocument) -> None:
    """Print all of a review, whose document is given, too."""
    from rich.text import Text

    console = terminal.out()
    colours = {True: "green", False: "red", None: "yellow"}
    for complete, text in rows.verdicts(document):
        verdict = Text(one_line(text), colours[complete])
        console.print(f"{document.recording}:", verdict, style="bold", soft_wrap=True)
    console.print(terminal.figures(rows.card_rows(document)))
    _print_curve(console, review)
    console.print(terminal.figures(rows.figure_rows(document)))
    _print_table(console, "Why replans came", rows.REASONS, rows.reason_rows(document))
    _print_table(console, "The slowest replans", rows.REPLANS, rows.replan_rows(review))
    moments = rows.moment_rows(review)
    _print_table(
        console, "Worst moments", ("what", "how much", "at", "what else is known"), moments
    )
    troubles = rows.trouble_rows(review.troubles)
    _print_table(console, "Troubles", ("state", "at", "for", "reason"), troubles[:MOST_TROUBLES])
    if len(troubles) > MOST_TROUBLES:
        console.print(f"and {len(troubles) - MOST_TROUBLES} more; all are in the JSON document")
    _print_table(console, "Refused messages", ("code", "messages"), rows.fault_rows(document))
    _print_remarks(console, document)


def print_comparison(one: ReviewDocument, other: ReviewDocument) -> None:
    """Print the figures of two documents side by side."""
    console = terminal.out()
    names = (one.recording, other.recording)
    console.print(setup_words(one, other), style="bold", soft_wrap=True)
    _print_table(console, "Set-up", ("", *names), setup_differences(one, other))
    compared = compared_rows(one, other)
    _print_table(console, "Two runs", ("", *names, "difference"), compared)
    counts = [
        (kind, str(mine), str(theirs), f"{mine - theirs:+d}")
        for kind, (mine, theirs) in reason_counts([one, other])
    ]
    _print_table(console, "Why replans came", ("reason", *names, "difference"), counts)
    for document in (one, other):
        _print_remarks(console, document)


def _print_curve(console: Console, review: Review) -> None:
    from rich.text import Text

    at_s, shares = covered_share(review)
    if not len(at_s):
        return
    marks = EIGHTHS if console.encoding.startswith("utf") else PLAIN_EIGHTHS
    lines = curve(at_s, shares, review.duration_s, PLOT_WIDTH, PLOT_HEIGHT, marks)
    labels = ["100 %", *[""] * (PLOT_HEIGHT - 2), "0 %"]
    console.print(Text("Coverage over time", "bold"), "of the cells coverable at the end")
    for label, line in zip(labels, lines, strict=True):
        console.print(f"{label:>6}", Text(line, "cyan"))
    end = rows.clock(review.duration_s)
    console.print(f"{'':>6} 0:00{end:>{PLOT_WIDTH - 4}}")


def _print_remarks(console: Console, document: ReviewDocument) -> None:
    for part in document.files:
        if part.torn_bytes:
            torn = f"torn, its last {part.torn_bytes} bytes are lost"
            console.print(f"{part.path}: {torn}", soft_wrap=True)
    for remark in document.remarks:
        console.print(f"recorder: {remark}", soft_wrap=True)
    for line in rows.unknown_lines(document):
        console.print(line, soft_wrap=True)


def _print_table(
    console: Console, title: str, columns: Sequence[str], cells: Sequence[Sequence[str]]
) -> None:
    from rich.table import Table

    if not cells:
        return
    table: Table = Table(title=title, title_justify="left", title_style="bold")
    for index, column in enumerate(columns):
        last = index == len(columns) - 1 and index > 1
        table.add_column(column, overflow="fold", justify="left" if last or not index else "right")
    for row in cells:
        table.add_row(*row)
    console.print(table)
