"""The results of ``fasaco-edge plan``: files, and figures as JSON or text."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import writing
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.geojson import SUFFIX, lines_collection
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.text import percent
from fasaco_edge.wire.documents.json_text import encode_json

if TYPE_CHECKING:
    from fasaco_edge.offline.passes import PassPlans
    from fasaco_edge.offline.result import Plan
    from fasaco_edge.offline.rooms import RoomsUnderLine
    from fasaco_edge.planners.planner import ColonySnapshot

# Figures of the walk from cell to cell, in contrast to those of the line.
OF_WALK = frozenset(
    (
        *("steps", "revisits", "recovered_cells", "n_r_paper", "turns_90", "turns_180"),
        *("length_m", "cost_s", "lower_bound_steps", "lower_bound_cost_s", "gap"),
    )
)


def write_files(
    args: argparse.Namespace, planned: Plan | PassPlans, trails: Sequence[ColonySnapshot]
) -> None:
    """Write the requested files; with several passes, each row begins with the pass's number.

    Raises:
        BadConfiguration: a file cannot be written.
    """
    from fasaco_edge.offline.passes import PassPlans

    is_several = isinstance(planned, PassPlans)
    plans = planned.plans if isinstance(planned, PassPlans) else (planned,)
    first = "pass," if is_several else ""
    if args.path_out is not None:
        rows = _numbered([plan.cells for plan in plans], is_several)
        with writing(args.path_out) as file:
            np.savetxt(file, rows, "%d", ",", header=f"{first}row,col", comments="")
    if args.xy_out is not None:
        _write_lines(args.xy_out, plans, is_several)
    if args.png is not None:
        picture = (
            planned.plot() if isinstance(planned, PassPlans) else planned.plot(rooms=args.rooms)
        )
        with writing(args.png) as file:
            picture.save(file, "PNG")
    if args.pheromone_png is not None:
        _draw_pheromone(args.pheromone_png, plans[0], trails)


def _write_lines(file: Path, plans: Sequence[Plan], is_several: bool) -> None:
    """Write the lines of passes, or poses along a curve, as CSV or GeoJSON (by the suffix)."""
    curve = plans[0].curve
    lines, header = [plan.xy for plan in plans], ["x_m", "y_m"]
    if curve is not None:
        lines, header = [curve.poses], ["x_m", "y_m", "yaw_rad"]
    if file.suffix == SUFFIX:
        each = enumerate(zip(plans, lines, strict=True), 1)
        document = lines_collection(
            (line.tolist(), {"pass": number, "swept": plan.swept_share})
            for number, (plan, line) in each
        )
        with writing(file) as new:
            new.write_bytes(encode_json(document))
        return
    rows = _numbered(lines, is_several)
    form = ["%d"] * is_several + ["%.6f"] * (rows.shape[1] - is_several)
    with writing(file) as new:
        columns = ",".join(["pass"] * is_several + header)
        np.savetxt(new, rows, form, ",", header=columns, comments="")


def _numbered(tables: Sequence[NDArray[Any]], is_several: bool) -> NDArray[Any]:
    """Return all tables as one; if ``is_several``, each row begins with its table's number."""
    if not is_several:
        return tables[0]
    numbers = np.repeat(np.arange(1, len(tables) + 1), [len(rows) for rows in tables])
    return np.column_stack((numbers, np.vstack(tables)))


def _draw_pheromone(file: Path, planned: Plan, trails: Sequence[ColonySnapshot]) -> None:
    from fasaco_edge.offline.result import pheromone_picture_of

    if not trails or trails[0].tau is None:
        raise BadConfiguration(
            f"{file}: the search ended before its first cohort of ants",
            hint="give it a larger --budget, or none",
        )
    with writing(file) as new:
        pheromone_picture_of(planned, trails[0].tau).save(new, "PNG")


def print_plan(args: argparse.Namespace, planned: Plan | PassPlans) -> None:
    """Print the figures: all as JSON, all as a table, or the most important ones."""
    from fasaco_edge.offline.figures import floor_words
    from fasaco_edge.offline.passes import PassPlans
    from fasaco_edge.offline.summary import line_words, pass_words, rows_of, rows_of_passes

    figures: dict[str, Any] = planned.figures | {"map": str(args.map)}
    rooms = None if isinstance(planned, PassPlans) or not args.rooms else planned.rooms
    if rooms is not None:
        figures["rooms"] = [asdict(room) for room in rooms.rooms]
    if args.json:
        print_json(figures)
        return
    console, floor = terminal.out(), planned.floor
    figures.pop("passes", None)
    if args.long:
        figures["floor"] = "not known for a coverage grid" if floor is None else floor_words(floor)
        if not isinstance(planned, PassPlans):
            figures["curve"] = planned.curve_words or None
        driven = {"driven line": line_words(planned.drive), "floor": figures.pop("floor")}
        labelled = {f"walk {name}" if name in OF_WALK else name: figures[name] for name in figures}
        known = terminal.known(driven | labelled)
        console.print(terminal.figures((name.replace("_", " "), text) for name, text in known))
    elif isinstance(planned, PassPlans):
        console.print(terminal.summary(rows_of_passes(planned)))
    else:
        console.print(terminal.summary(rows_of(planned)))
    if isinstance(planned, PassPlans):
        for number, (name, plan) in enumerate(zip(planned.names, planned.plans, strict=True), 1):
            console.print(f"pass {number}, {name}: {pass_words(plan)}")
    if rooms is not None:
        console.print(_table(rooms))
    say_written(args)


def _table(under: RoomsUnderLine) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0))
    for name in ("room", "floor", "swept", "entered"):
        table.add_column(name, justify="right", style="cyan" if name == "room" else "")
    for room in under.rooms:
        swept = percent(room.swept_share)
        often = {0: "never", 1: "once"}.get(room.entered, f"{room.entered} times")
        table.add_row(str(room.room), f"{room.area_m2:,.1f} m2", swept, often)
    return table


def say_written(args: argparse.Namespace) -> None:
    """Print the names of written files, and the options for more output."""
    console = terminal.out()
    for name in ("path_out", "xy_out", "png", "pheromone_png"):
        if (file := getattr(args, name)) is not None:
            console.print(f"wrote {file}", soft_wrap=True)
    if not args.long:
        console.print("more: --long" + ("" if args.png else "; a picture: --png FILE"))
