"""``fasaco-edge review``: what happened in a recorded mission, or in two."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import Command, pair_of_floats
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.review import rows
from fasaco_edge.review.comparison import (
    compared_rows,
    reason_counts,
    setup_differences,
    setup_words,
    side_by_side,
)
from fasaco_edge.review.document import ReviewDocument, explanations
from fasaco_edge.review.figures import document_of
from fasaco_edge.review.spot import spots_left
from fasaco_edge.review.wording import clock
from fasaco_edge.text import one_line

if TYPE_CHECKING:
    from fasaco_edge.review.review import Review

DESCRIPTION = """\
Report what happened in a recorded mission, on one screen; with --long all figures, orders,
commands, replans, floor left and why, worst moments and faults. With --at and --point it answers a
question: what was at a time, why a spot was not swept. Parts of one run are read together. Files
are only read; of files that a crash cut short, the whole part is used.
"""


def _time(text: str) -> float:
    """Read ``H:MM:SS``, ``MM:SS`` or seconds."""
    parts = text.split(":")
    try:
        if not 1 <= len(parts) <= 3:
            raise ValueError
        value = 0.0
        for part in parts:
            value = 60.0 * value + float(part)
    except ValueError:
        value = -1.0
    # A negated comparison, so that NaN is caught too.
    if not 0 <= value < 1e9:
        raise argparse.ArgumentTypeError(f"must be MM:SS, H:MM:SS or seconds, got {text!r}")
    return value


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recordings", nargs="+", type=Path, metavar="FILE.rrd", help="the parts of one run"
    )
    parser.add_argument(
        "--against",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="the parts of another run to compare with",
    )
    parser.add_argument(
        "--long", action="store_true", help="print all there is, and not only one screen of it"
    )
    parser.add_argument(
        "--at",
        type=_time,
        metavar="MM:SS",
        help="answer what was at this time since the recording began: robot, paths before and "
        "after, what of the map changed, commands, trail; --png draws it",
    )
    parser.add_argument(
        "--point",
        type=pair_of_floats,
        action="append",
        metavar="X,Y",
        help="answer why this spot [m] was not swept: never seen, too narrow, a keep-out zone, "
        "missed and by how much, not worth it; may be repeated; --png draws it",
    )
    parser.add_argument("--json", action="store_true", help="print JSON, described below")
    parser.add_argument(
        "--png", type=Path, metavar="FILE", help="write a picture of the (first) run"
    )
    parser.add_argument(
        "--html", type=Path, metavar="FILE", help="write a page, one file that needs no network"
    )
    parser.add_argument(
        "--export",
        type=Path,
        metavar="DIR",
        help="write tables: trail, paths and their points, plans, commands, states, coverage, "
        "floor swept, pheromone, plots; columns.csv says what they hold, in what units; the map "
        "as .npz",
    )
    parser.add_argument(
        "--export-as",
        choices=("csv", "parquet"),
        default="csv",
        help="what the tables are written as; Parquet keeps types and describes its columns itself "
        "(default: %(default)s)",
    )
    parser.add_argument("--view", action="store_true", help="open the recording in Rerun's viewer")


def run(args: argparse.Namespace) -> int:
    """Review."""
    from fasaco_edge.cli.console.arguments import check_outputs, naming, writing

    check_outputs((args.png, args.html), [*args.recordings, *(args.against or ())])
    review = _read(args.recordings, "recording")
    if args.at is not None or args.point:
        return _answer(args, review)
    other = _read(args.against, "the other one") if args.against else None
    document = document_of(review)
    if args.json:
        both = (
            side_by_side(document, document_of(other)) if other else msgspec.to_builtins(document)
        )
        print_json(both)
    elif other:
        print_comparison(document, document_of(other))
    else:
        print_review(review, document, full=args.long)
    if args.png:
        from fasaco_edge.review.pictures import draw_review

        with writing(args.png) as file:
            draw_review(review).save(file, "PNG")
    if args.html:
        from fasaco_edge.review.page import page_of

        with writing(args.html) as file:
            file.write_text(page_of(review, other), encoding="utf-8")
    if args.export:
        from fasaco_edge.review.export import export

        with naming(args.export):
            export(review, args.export, args.export_as)
    if args.view:
        from fasaco_edge.recording.read.repair import view

        view([*args.recordings, *(args.against or ())])
    return 0


def _answer(args: argparse.Namespace, review: Review) -> int:
    """Answer questions about a moment, and about spots."""
    from fasaco_edge.cli.console.arguments import writing
    from fasaco_edge.review.instant import scene_at
    from fasaco_edge.review.pictures import draw_scene, draw_spots
    from fasaco_edge.review.spot import explain

    if args.at is not None and args.at > review.duration_s:
        raise BadConfiguration(
            f"--at: the recording is {clock(review.duration_s)} long",
            hint="times count from the beginning of the recording, as in its review",
        )
    console = terminal.out()
    scene = None if args.at is None else scene_at(review, args.at)
    spots = explain(review, args.point or ())
    if args.json:
        found = {"at": scene.instant if scene else None, "points": spots}
        print_json(msgspec.to_builtins(found))
    else:
        if scene is not None:
            console.print(f"at {clock(args.at)}", style="bold")
            console.print(terminal.figures(rows.instant_rows(scene.instant)))
        for spot in spots:
            console.print(terminal.figures(rows.spot_rows(spot)))
    if args.png:
        picture = draw_scene(review, scene) if scene else draw_spots(review, spots)
        if picture is None:
            raise BadConfiguration(
                f"no picture: {review.no_lattice or 'there is no map yet'}",
                hint="the answer is complete without --png",
            )
        with writing(args.png) as file:
            picture.save(file, "PNG")
    return 0


def _read(paths: Sequence[Path], name: str) -> Review:
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


PLOT_WIDTH, PLOT_HEIGHT, SCREEN_PLOT_HEIGHT = 64, 6, 4
MOST_VERDICTS = 4


def print_review(review: Review, document: ReviewDocument, *, full: bool) -> None:
    """Print a review, whose document is given, too: in ``full``, or what fits on a screen."""
    console = terminal.out()
    colours = {True: "green", False: "red", None: "yellow"}
    verdicts = rows.verdicts(document)
    for complete, text in verdicts if full else verdicts[:MOST_VERDICTS]:
        verdict = Text(one_line(text), colours[complete])
        if full:
            console.print(f"{document.recording}:", verdict, style="bold", soft_wrap=True)
        else:
            console.print(_fitting(verdict, console.width))
    if not full:
        _print_screen(console, review, document, more=len(verdicts) - MOST_VERDICTS)
        return
    console.print(terminal.figures(rows.card_rows(document)))
    _print_curve(console, review, PLOT_HEIGHT)
    console.print(terminal.figures(rows.figure_rows(document)))
    _print_table(console, "Orders", rows.ORDERS, rows.order_rows(document))
    if commands := rows.command_rows(document):
        console.print("Commands", style="bold")
        console.print(terminal.figures(commands))
    _print_table(console, "Not reached", rows.UNREACHED, rows.unreached_rows(document))
    _print_table(console, "Floor left", rows.LEFT, rows.left_rows(document, spots_left(review)))
    _print_table(console, "Reasons of replans", rows.REASONS, rows.reason_rows(document))
    _print_table(console, "The slowest replans", rows.REPLANS, rows.replan_rows(review))
    _print_table(console, "Replans in order of time", rows.REPLANS, rows.replans_in_time(review))
    moments = rows.moment_rows(review)
    _print_table(console, "Worst moments", ("what", "how much", "at", "context"), moments)
    troubles = rows.trouble_rows(review.troubles)
    _print_table(console, "Troubles", ("state", "at", "for", "reason"), troubles)
    _print_table(console, "Charges", rows.CHARGES, rows.charge_rows(document))
    _print_table(console, "Refused messages", ("code", "messages"), rows.fault_rows(document))
    _print_remarks(console, document)


def _print_screen(console: Console, review: Review, document: ReviewDocument, *, more: int) -> None:
    """Print what matters most; with up to ``MOST_VERDICTS`` verdicts it takes 24 lines."""
    if more > 0:
        console.print(f"and {more} more orders")
    _print_curve(console, review, SCREEN_PLOT_HEIGHT)
    for name, text in rows.screen_rows(review, document):
        line = Text.assemble((f"{name:<12}", "cyan"), one_line(text))
        console.print(_fitting(line, console.width))
    hint = "more: --long; a moment: --at MM:SS; a spot: --point X,Y; a page: --html FILE"
    console.print(_fitting(Text(hint), console.width))


def _fitting(text: Text, width: int) -> Text:
    """Return a text that takes one line of the terminal."""
    if text.cell_len > width:
        text.truncate(width - 3)
        text.append("...")
    return text


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
    _print_table(console, "Reasons of replans", ("reason", *names, "difference"), counts)
    for document in (one, other):
        _print_remarks(console, document)


def _print_curve(console: Console, review: Review, height: int) -> None:
    from fasaco_edge.review.panels import EIGHTHS, PLAIN_EIGHTHS, covered_share, curve

    at_s, shares = covered_share(review)
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
        console.print(f"recorder: {remark}", soft_wrap=True)
    for line in rows.unknown_lines(document):
        console.print(line, soft_wrap=True)


def _print_table(
    console: Console, title: str, columns: Sequence[str], cells: Sequence[Sequence[str]]
) -> None:
    if not cells:
        return
    table = Table(title=title, title_justify="left", title_style="bold")
    for index, column in enumerate(columns):
        last = index == len(columns) - 1 and index > 1
        table.add_column(column, overflow="fold", justify="left" if last or not index else "right")
    for row in cells:
        table.add_row(*row)
    console.print(table)


COMMAND = Command(
    description=DESCRIPTION,
    run=run,
    add_options=_add_options,
    epilog=_epilog(),
)
