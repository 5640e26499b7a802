"""A review in a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from fasaco_edge.cli.console import terminal
from fasaco_edge.review.charts import EIGHTHS, PLAIN_EIGHTHS, covered_share, curve
from fasaco_edge.review.document import troubles
from fasaco_edge.review.rows import (
    MOST_REPLANS,
    REASONS,
    REPLANS,
    amount,
    card_rows,
    clock,
    compared_rows,
    figure_rows,
    reason_rows,
    replan_rows,
    setup_words,
    verdicts,
)
from fasaco_edge.review.setups import setup_differences
from fasaco_edge.text import one_line

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from fasaco_edge.review.review import Review

PLOT_WIDTH, PLOT_HEIGHT = 64, 6
MOST_TROUBLES = 12


def print_review(review: Review, told: dict[str, Any]) -> None:
    """Print all of a review; ``told`` is its document."""
    from rich.text import Text

    console = terminal.out()
    colours = {True: "green", False: "red", None: "yellow"}
    for complete, text in verdicts(told):
        said = Text(one_line(text), colours[complete])
        console.print(f"{told['recording']}:", said, style="bold", soft_wrap=True)
    console.print(terminal.figures(card_rows(told)))
    _print_curve(console, review)
    console.print(terminal.figures(figure_rows(told)))
    _print_table(
        console,
        "Why replans came",
        REASONS,
        reason_rows(told),
    )
    slowest = replan_rows(review.replans.slowest_first(MOST_REPLANS))
    _print_table(console, "The slowest replans", REPLANS, slowest)
    _print_table(
        console,
        "Worst moments",
        ("what", "how much", "at", "what else is known"),
        [
            (moment.what, amount(moment.value, moment.unit), clock(moment.at_s), moment.note)
            for moment in review.moments
        ],
    )
    found = troubles(review)
    _print_table(
        console,
        "Troubles",
        ("state", "at", "for", "reason"),
        [
            (span.name, clock(span.begin_s), f"{span.seconds:.1f} s", span.reason)
            for span in found[:MOST_TROUBLES]
        ],
    )
    if len(found) > MOST_TROUBLES:
        console.print(f"and {len(found) - MOST_TROUBLES} more; all are in the JSON document")
    _print_table(
        console,
        "Refused messages",
        ("code", "messages"),
        [(code, str(count)) for code, count in told["faults_by_code"].items()],
    )
    _print_remarks(console, told)


def print_comparison(told: dict[str, Any], other: dict[str, Any]) -> None:
    """Print the figures of two documents side by side."""
    console = terminal.out()
    names = (told["recording"], other["recording"])
    console.print(setup_words(told, other), style="bold", soft_wrap=True)
    _print_table(console, "Set-up", ("", *names), setup_differences(told, other))
    rows = compared_rows(told, other)
    _print_table(console, "Two runs", ("", *names, "difference"), rows)
    kinds = dict.fromkeys((*told["replans_by_reason"], *other["replans_by_reason"]))
    counts = [
        [document["replans_by_reason"].get(kind, 0) for document in (told, other)] for kind in kinds
    ]
    _print_table(
        console,
        "Why replans came",
        ("reason", *names, "difference"),
        [
            (kind, str(mine), str(theirs), f"{mine - theirs:+d}")
            for kind, (mine, theirs) in zip(kinds, counts, strict=True)
        ],
    )
    for document in (told, other):
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
    end = clock(review.duration_s)
    console.print(f"{'':>6} 0:00{end:>{PLOT_WIDTH - 4}}")


def _print_remarks(console: Console, told: dict[str, Any]) -> None:
    for part in told["files"]:
        if part["torn_bytes"]:
            console.print(
                f"{part['path']}: torn, its last {part['torn_bytes']} bytes are lost",
                soft_wrap=True,
            )
    for remark in told["remarks"]:
        console.print(f"recorder: {remark}", soft_wrap=True)
    for topic, count in told["unreadable"].items():
        console.print(f"{count} samples of {topic} cannot be read")
    for names, why in told["not_recorded"].items():
        console.print(f"not known: {names}: {why}", soft_wrap=True)


def _print_table(
    console: Console, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]
) -> None:
    from rich.table import Table

    rows = list(rows)
    if not rows:
        return
    table: Table = Table(title=title, title_justify="left", title_style="bold")
    for index, column in enumerate(columns):
        last = index == len(columns) - 1 and index > 1
        table.add_column(column, overflow="fold", justify="left" if last or not index else "right")
    for row in rows:
        table.add_row(*row)
    console.print(table)
