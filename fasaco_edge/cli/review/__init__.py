"""``fasaco-edge review``: the report of a recorded mission, of two in comparison, or of a fleet."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import (
    Subcommand,
    check_outputs,
    naming,
    pair_of_floats,
    writing,
)
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.recording.read.torn import open_part
from fasaco_edge.review.document import explanations

if TYPE_CHECKING:
    from PIL import Image

    from fasaco_edge.bus.arrival import Arrival
    from fasaco_edge.grid.geometry import GridGeometry
    from fasaco_edge.judge.pixels import Mask
    from fasaco_edge.review.review import Review
    from fasaco_edge.wire.documents.settings import FleetSettings

DESCRIPTION = """\
Report what happened in a recorded mission, on one screen; with --long all figures, orders,
commands, replans, floor left and why, and faults. --at says what happened at a time, --point why a
spot was not swept. The report on a fleet has makespan, balance, floor swept again or only driven
through, waiting and messages; it takes --json and --png only. The parts of one run are read
together; if there are several runs, the newest is read. A file that a crash cut short is read up
to the damage; no file is changed.
"""


EXAMPLES = """\
examples:
  fasaco-edge review run00001-*.rrd                    one screen: swept, left over, troubles
  fasaco-edge review night.rrd --at 1:00 --png at.png  why did the robot turn here?
  fasaco-edge review night.rrd --point 2.55,0.24       why is this spot (x, y) [m] not swept?
  fasaco-edge review night.rrd --against last.rrd --png both.png
  fasaco-edge review night.rrd --export night
  fasaco-edge serve night.rrd                          the mission in a browser, at any time
"""

OF_A_FLEET = (
    "For a fleet it has: fleet, time_scale, duration_s, makespan_s, busy_balance, swept_balance, "
    "swept_m2 (by cells), through_m2, again_m2, again_share, waited_s, divisions, and robots: each "
    "with name, state, busy_s, waited_s, waits, longest_wait_s, driven_m, swept_m2, through_m2, "
    "again_m2, messages_s, kb_s, peak_kb_s, plans, plan_ms_p50, plan_ms_p99."
)


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
    # The comparison is negated to catch NaN.
    if not 0 <= value < 1e9:
        raise argparse.ArgumentTypeError(f"must be MM:SS, H:MM:SS or seconds, got {text!r}")
    return value


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recordings",
        nargs="+",
        type=Path,
        metavar="FILE.rrd",
        help="the parts of one run; if a robot has several runs, the newest is read",
    )
    parser.add_argument(
        "--against",
        nargs="+",
        action="extend",
        type=Path,
        metavar="FILE",
        help="the parts of another run to compare with",
    )
    parser.add_argument("--long", action="store_true", help="print everything, not only one screen")
    parser.add_argument(
        "--at",
        type=_time,
        metavar="MM:SS",
        help="show this time since the recording began: robot, floor that it sweeps next, paths "
        "before and after, plan and who found it, changes of the map, commands; --png draws it",
    )
    parser.add_argument(
        "--point",
        type=pair_of_floats,
        action="append",
        metavar="X,Y",
        help="say why this spot [m] was not swept: never seen, too narrow, in a keep-out zone, "
        "poses missing, missed and by how much, or not worth its time; may be repeated; --png "
        "draws it",
    )
    parser.add_argument("--json", action="store_true", help="print JSON, described below")
    parser.add_argument(
        "--png",
        type=Path,
        metavar="FILE",
        help="write a picture of the run, or of both runs with --against",
    )
    parser.add_argument(
        "--export",
        type=Path,
        metavar="DIR",
        help="write tables as CSV: trail, paths and their points, states, coverage, pheromone, "
        "plots; columns.csv describes all columns, with units; map and swept floor as .npz",
    )


def run(args: argparse.Namespace) -> int:
    """Print the report, and write the requested files."""
    recordings = [*args.recordings, *(args.against or ())]
    check_outputs((args.png,), recordings)
    _check_together(args)
    for file in recordings:
        with open_part(file):  # raises if a file is not a recording, before slow imports
            pass
    from fasaco_edge.cli.console.recordings import files_of_a_run
    from fasaco_edge.recording.read.frames import is_fleet_recording

    args.recordings = files_of_a_run(args.recordings)
    if args.against:
        args.against = files_of_a_run(args.against)

    if is_fleet_recording(args.recordings[0]):
        from fasaco_edge.cli.fleet_wing import print_fleet

        return print_fleet(args)
    import msgspec

    from fasaco_edge.cli.review.screen import print_comparison, print_review
    from fasaco_edge.review.comparison import side_by_side
    from fasaco_edge.review.conversion import document_of

    review = _read(args.recordings, "recording")
    if args.at is not None or args.point:
        return _answer(args, review)
    other = _read(args.against, "the other run") if args.against else None
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
    if args.export:
        from fasaco_edge.review.output.export import export

        with naming(args.export):
            written = export(review, args.export)
        width = max(len(str(file)) for file, _ in written)
        for file, what in written:
            terminal.err().print(f"{file!s:{width}}  {what}", soft_wrap=True, highlight=False)
    if args.png:
        from fasaco_edge.review.output.pictures import draw_review

        _save(draw_review([review, other] if other else [review]), review, args.png)
    return 0


def _check_together(args: argparse.Namespace) -> None:
    asked = "--point" if args.at is None else "--at"
    for option in ("against", "export", "long"):
        if (args.at is not None or args.point) and getattr(args, option):
            raise BadConfiguration(
                f"--{option} does not go with {asked}", hint="run the command once for each"
            )
    if args.export is not None and args.export.exists() and not args.export.is_dir():
        raise BadConfiguration(f"cannot write {args.export}: that is a file", hint="name a folder")


def _answer(args: argparse.Namespace, review: Review) -> int:
    """Print the answers about a moment and about spots; draw them on request."""
    import msgspec

    from fasaco_edge.recording.read.robot_clock import clock
    from fasaco_edge.review.instant import instant_at
    from fasaco_edge.review.output import answers
    from fasaco_edge.review.output.pictures import draw_instant, draw_spots
    from fasaco_edge.review.spot import explain

    if args.at is not None and args.at > review.duration_s:
        raise BadConfiguration(
            f"--at: the recording is {clock(review.duration_s)} long",
            hint="times count from the beginning of the recording, as in its review",
        )
    console, clock_of_robot = terminal.out(), review.record.clock
    shown = None if args.at is None else instant_at(review, args.at)
    spots = explain(review, args.point or ())
    if args.json:
        found: dict[str, object] = {"at": shown.instant if shown else None, "points": spots}
        found["time_scale"] = clock_of_robot.scale
        print_json(msgspec.to_builtins(found))
    else:
        if clock_of_robot.words:
            console.print(f"{clock_of_robot.words}: times are the robot's")
        if shown is not None:
            console.print(f"at {clock(args.at)}", style="bold")
            console.print(terminal.figures(answers.instant_rows(shown.instant)))
        for spot in spots:
            console.print(terminal.figures(answers.spot_rows(spot)))
    if args.png:
        picture = draw_instant(review, shown) if shown else draw_spots(review, spots)
        _save(picture, review, args.png)
    return 0


def _save(picture: Image.Image | None, review: Review, path: Path) -> None:
    if picture is None:
        raise BadConfiguration(
            f"no picture: {review.no_lattice or 'there is no map yet, or no pose'}",
            hint="the answer is complete without --png",
        )
    with writing(path) as file:
        picture.save(file, "PNG")
    terminal.err().print(f"wrote {path}", soft_wrap=True)


def _read(paths: Sequence[Path], name: str) -> Review:
    from fasaco_edge.review.review import read_review

    with terminal.progress() as bar:
        task = bar.add_task(name, total=None)

        def tell(what: str, done: int, total: int) -> None:
            bar.update(task, description=f"{name}: {what}", completed=done, total=total)

        return read_review(paths, tell, _by_others)


def _by_others(
    turns: Iterable[Arrival], fleet: FleetSettings, geometry: GridGeometry
) -> Mask | None:
    from fasaco_edge.cli.fleet_wing import swept_by_others

    return swept_by_others(turns, fleet, geometry)


def _epilog() -> str:
    """Return examples, and a description of the JSON document from its docstring."""
    lines = [
        EXAMPLES,
        "members of the JSON document; times are the robot's seconds since the recording began:",
    ]
    for line in explanations():
        lines += textwrap.wrap(line, 96, initial_indent="  ", subsequent_indent="      ")
    lines += textwrap.wrap(
        "With --against it has two of them, `recording` and `against`, their different settings, "
        "`setup`, and whether their figures can be compared, `compare`.",
        96,
    )
    lines += textwrap.wrap(OF_A_FLEET, 96)
    return "\n".join(lines)


COMMAND = Subcommand(
    description=DESCRIPTION,
    run=run,
    add_options=_add_options,
    epilog=_epilog(),
)
