"""The export of a review for other programs: tables as CSV, maps as NumPy arrays."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec.structs import astuple
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.host.durable import whole
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.timeline import grids_in, lines_in, read_drawings
from fasaco_edge.review.review import Review
from fasaco_edge.text import one_line

FORMULA = re.compile(r"[=@]|[+-](?![\d.]+(e[+-]?\d+)?\Z)")
# Limit on the pheromone fields of a table, besides the last one.
MOST_FIELDS = 64


class Column(NamedTuple):
    """A column: name, unit, meaning."""

    name: str
    unit: str
    about: str


class Table(NamedTuple):
    """A table: name of its file, meaning of a row, columns, rows; unknown values are None."""

    name: str
    about: str
    columns: tuple[Column, ...]
    rows: Iterable[Sequence[object]]


AT = Column("at_s", "s", "time since the recording began, by the robot's clock")
X, Y = (Column(f"{axis}_m", "m", f"{axis} in the map frame") for axis in "xy")
REVISION = Column("revision", "", "number of the published path")
REASON = Column("reason", "", "reason given by the daemon")


def export(review: Review, folder: Path) -> list[tuple[Path, str]]:
    """Write tables and arrays of a review into ``folder``; return each file, and a phrase about it.

    columns.csv describes the columns and their units; end.npz holds arrays as of the end, see
    ``_write_arrays``.

    Args:
        review: the review.
        folder: created if missing.

    Raises:
        OSError: a file cannot be written.
        UnreadableRecording: a file of the recording is gone.
    """
    folder.mkdir(parents=True, exist_ok=True)
    described, written = [], []
    for table in _tables(review):
        file = folder / f"{table.name}.csv"
        _write_csv(file, [column.name for column in table.columns], table.rows)
        written.append((file, f"a row is {table.about}"))
        described += [(file.name, table.about, *column) for column in table.columns]
    columns_of, arrays = folder / "columns.csv", folder / "end.npz"
    _write_csv(columns_of, ("file", "row", "column", "unit", "description"), described)
    _write_arrays(review, arrays)
    return [
        (columns_of, "meaning and unit of each table's columns: begin here"),
        *written,
        (arrays, "map, swept floor and visited cells at the end, for NumPy"),
    ]


def _write_csv(file: Path, names: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with whole(file) as new, new.open("w", encoding="utf-8", newline="") as target:
        writer = csv.writer(target)
        writer.writerow(names)
        writer.writerows([_cell(value) for value in row] for row in rows)


def _cell(value: object) -> object:
    """Return a value that no spreadsheet takes for a formula."""
    text = one_line(value) if isinstance(value, str) else value
    return f"'{text}" if isinstance(text, str) and FORMULA.match(text) else text


def _write_arrays(review: Review, file: Path) -> None:
    """Write the arrays: row 0 is the lowest, origins are x [m], y [m], yaw [rad].

    There are the map, int8, and the floor, bool, whose pixels may be finer, each with its origin
    and the edge of a pixel [m]; and the visits to each cell, uint16, with row and column of the
    first cell on the lattice, and the edge of a cell [m].
    """
    grid, floor, lattice, visits = review.data.grid, review.floor, review.lattice, review.visits
    arrays: dict[str, NDArray[np.generic]] = {}
    if grid is not None:
        arrays |= {"map": grid.cells, **_place("map", grid.geometry)}
    if floor is not None:
        arrays |= {"reachable": floor.reachable, "swept": floor.swept}
        arrays |= _place("floor", floor.geometry)
    if lattice is not None and visits is not None:
        arrays |= {
            "visits": visits,
            "lattice_corner": np.array((lattice.window.row0, lattice.window.col0)),
            "cell_m": np.array(lattice.cell_m),
        }
    # NumPy's type stub mistakes the first array for an option.
    with whole(file) as new:
        np.savez_compressed(new, **arrays)  # type: ignore[arg-type]


def _place(name: str, geometry: GridGeometry) -> dict[str, NDArray[np.float64]]:
    origin = geometry.origin
    return {
        f"{name}_origin": np.array((origin.x, origin.y, origin.yaw)),
        f"{name}_resolution_m": np.array(geometry.resolution),
    }


def _tables(review: Review) -> Iterator[Table]:
    data = review.data
    yield Table(
        "trail",
        "a pose of the robot",
        (AT, X, Y, Column("yaw_rad", "rad", "heading, counter-clockwise from the x axis")),
        (
            (round(at, 6), round(x, 4), round(y, 4), round(yaw, 5))
            for at, (x, y, yaw) in zip(data.pose_s, data.poses, strict=True)
        ),
    )
    yield _paths(review)
    yield Table(
        "path_points",
        "a corner of a path, which leads straight on to the next corner",
        (AT, REVISION, Column("number", "", "number of the corner on its path, from 0"), X, Y),
        _points(review),
    )
    begin, end = (
        Column(f"{name}_s", "s", f"{name} of the state, since the recording began")
        for name in ("begin", "end")
    )
    yield Table(
        "states",
        "a period of a mission's state",
        (begin, end, Column("state", "", "state of the mission"), REASON),
        ((round(s.begin_s, 6), round(s.end_s, 6), s.name, s.reason) for s in review.states),
    )
    yield Table(
        "coverage",
        "the share covered at a time",
        (AT, Column("share", "", "covered cells over the cells coverable at the end")),
        ((round(at, 6), round(part, 6)) for at, part in review.covered_share.tolist()),
    )
    yield Table(
        "plots",
        "a plotted value",
        (
            AT,
            Column("name", "", "name of the plot"),
            Column("value", "", "plotted value, in force until the next row of that name"),
        ),
        (
            (round(at, 6), name, value)
            for name, points in sorted(review.record.plots.items())
            for at, value in points.tolist()
        ),
    )
    level = (
        "1 to 255 on a log scale: pheromone = min * (max / min) ** ((level - 1) / 254), by the "
        f"last values of {entities.PHEROMONE_RANGE}/min and /max in plots until at_s"
    )
    yield Table(
        "pheromone",
        "pheromone of a cell at one of up to 65 times, spread over the recording",
        (AT, X, Y, Column("level", "", level)),
        _levels(review),
    )


def _paths(review: Review) -> Table:
    sides = zip(("x_min", "y_min", "x_max", "y_max"), ("left", "lower", "right", "upper"),
                strict=True)  # fmt: skip
    columns = (
        AT,
        REVISION,
        Column("steps", "", "steps from point to point of the path"),
        Column("planner", "", "planner of the path; empty if no plan was needed"),
        Column("plan_ms", "ms", "duration of planning"),
        Column("planned_steps", "", "steps of the walk as planned"),
        Column("lower_bound_steps", "", "least steps of any walk"),
        Column("gap", "", "cost_s / lower_bound_cost_s - 1"),
        Column("cost_s", "s", "time to drive the walk as planned"),
        Column("lower_bound_cost_s", "s", "least time of any walk"),
        *(Column(name, "m", f"{side} edge of the changed part of the map") for name, side in sides),
        REASON,
    )
    rows = (
        (
            *(round(path.at_s, 6), about.revision, about.steps, about.planner, path.plan_ms),
            *(about.planned_steps, about.lower_bound_steps, about.gap),
            *(about.planned_cost_s, about.lower_bound_cost_s),
            *(astuple(about.changed) if about.changed else (None,) * 4),
            about.reason,
        )
        for path, about in ((path, path.about) for path in review.data.paths)
    )
    return Table("paths", "a published path", columns, rows)


def _points(review: Review) -> Iterator[Sequence[object]]:
    record, seen = review.record, set[int]()
    for line in read_drawings(record.drawn.get(entities.PATH, ()), lines_in, record.anchor):
        # Each part repeats the path in force at its beginning.
        if line.revision not in seen and len(line.xy):
            seen.add(line.revision)
            at_s = round(record.clock.seconds(line.at_ns), 6)
            for number, (x, y) in enumerate(line.xy.tolist()):
                yield at_s, line.revision, number, round(x, 4), round(y, 4)


def _levels(review: Review) -> Iterator[Sequence[object]]:
    record = review.record
    places = record.drawn.get(entities.PHEROMONE, ())
    # A limited number of fields at regular intervals, and the last one.
    every = -(-len(places) // MOST_FIELDS) or 1
    wanted = dict.fromkeys((*places[::every], *places[-1:]))
    for field in read_drawings(wanted, grids_in, record.anchor):
        at_s = round(record.clock.seconds(field.at_ns), 6)
        rows, cols = np.nonzero(field.pixels)
        middles = cols.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5
        x, y = field.geometry.to_map(*middles)
        levels = field.pixels[rows, cols].tolist()
        for place_x, place_y, level in zip(x.tolist(), y.tolist(), levels, strict=True):
            yield at_s, round(place_x, 4), round(place_y, 4), level
