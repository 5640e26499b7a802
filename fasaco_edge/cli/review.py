"""``fasaco-edge review``: what happened in a recorded mission, or in two."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from fasaco_edge.cli.console.arguments import Command
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.review.document import explanations

if TYPE_CHECKING:
    from fasaco_edge.review.review import Review

DESCRIPTION = """\
Tell what happened in a recorded mission: coverage over time, replans and why they came, the
worst moments, faults. Parts of one run are taken together. Files are only read, also those that
a crash cut short: of them, what is whole is told.
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recordings", nargs="+", type=Path, metavar="FILE.rrd", help="the parts of one run"
    )
    parser.add_argument(
        "--against",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="the parts of another run, to be set beside it",
    )
    parser.add_argument("--json", action="store_true", help="print a JSON document, see below")
    parser.add_argument(
        "--png", type=Path, metavar="FILE", help="write a picture of the (first) run"
    )
    parser.add_argument(
        "--html", type=Path, metavar="FILE", help="write a page, one file that needs no net"
    )
    parser.add_argument(
        "--export",
        type=Path,
        metavar="DIR",
        help="write CSV files of trail, paths, states, coverage and plots, and the map as .npz",
    )
    parser.add_argument("--view", action="store_true", help="open the recording in Rerun's viewer")


def run(args: argparse.Namespace) -> int:
    """Review."""
    from fasaco_edge.cli.console.arguments import check_output, writing
    from fasaco_edge.cli.review_report import print_comparison, print_review
    from fasaco_edge.review.comparison import side_by_side
    from fasaco_edge.review.document import document_of

    for file in (args.png, args.html):
        check_output(file)
    review = _read(args.recordings, "recording")
    other = _read(args.against, "the other one") if args.against else None
    told = document_of(review)
    if args.json:
        both = side_by_side(told, document_of(other)) if other else msgspec.to_builtins(told)
        print_json(both)
    elif other:
        print_comparison(told, document_of(other))
    else:
        print_review(review, told)
    if args.png:
        from fasaco_edge.review.pictures import draw_review

        with writing(args.png):
            draw_review(review).save(args.png, "PNG")
    if args.html:
        from fasaco_edge.review.page import page_of

        with writing(args.html):
            args.html.write_text(page_of(review, other), encoding="utf-8")
    if args.export:
        from fasaco_edge.review.export import export

        with writing(args.export):
            export(review, args.export)
    if args.view:
        from fasaco_edge.recording.read.repair import view

        view([*args.recordings, *(args.against or ())])
    return 0


def _read(paths: Sequence[Path], name: str) -> Review:
    from fasaco_edge.cli.console import terminal
    from fasaco_edge.review.review import read_review

    with terminal.progress() as bar:
        task = bar.add_task(name, total=None)

        def tell(what: str, done: int, total: int) -> None:
            bar.update(task, description=f"{name}: {what}", completed=done, total=total)

        return read_review(paths, tell)


def _epilog() -> str:
    """Return what the JSON document holds: one way to say it, for help and for readers."""
    lines = ["the JSON document holds, with times in seconds since the recording began:"]
    for line in explanations():
        lines += textwrap.wrap(line, 96, initial_indent="  ", subsequent_indent="      ")
    lines += textwrap.wrap(
        "With --against it holds two of them, `recording` and `against`, and of all numbers that "
        "both have the `difference`, the first less the second.",
        96,
    )
    return "\n".join(lines)


COMMAND = Command(
    description=DESCRIPTION,
    run=run,
    add_options=_add_options,
    epilog=_epilog(),
)
