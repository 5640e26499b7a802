"""The tables of a review: columns with units, and rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import astuple as astuple_of
from dataclasses import dataclass
from typing import NamedTuple

import msgspec
import numpy as np
from msgspec.structs import astuple

from fasaco_edge.mission.orders.order import order_document
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.drawn import DrawnGrid, DrawnLine, drawings
from fasaco_edge.review.orders import command_words
from fasaco_edge.review.review import Review

# Limit on the pheromone fields of a table, besides the last one.
MOST_FIELDS = 64


class Column(NamedTuple):
    """A column: name, type ("float", "int", "bool" or "text"), unit, meaning."""

    name: str
    kind: str
    unit: str
    about: str


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """A table; unknown values of a row are None.

    Attributes:
        name: name of its file.
        about: meaning of a row.
        columns: the columns, in order.
        rows: the rows; may be iterated once only.
    """

    name: str
    about: str
    columns: tuple[Column, ...]
    rows: Iterable[tuple[object, ...]]


AT = Column("at_s", "float", "s", "when, since the recording began, by the robot's clock")
X = Column("x_m", "float", "m", "in the map frame")
Y = Column("y_m", "float", "m", "in the map frame")
REVISION = Column("revision", "int", "", "counts the published paths")
REASON = Column("reason", "text", "", "why, as the daemon says it")


def tables_of(review: Review) -> Iterator[Table]:
    """Yield all tables.

    Raises:
        UnreadableRecording: a file of the recording is gone.
    """
    yield _trail(review)
    yield from _paths(review)
    yield from _mission(review)
    yield _floor(review)
    yield _pheromone(review)


def _trail(review: Review) -> Table:
    columns = (AT, X, Y, Column("yaw_rad", "float", "rad", "counter-clockwise from the x axis"))
    data = review.data
    rows = (
        (round(at, 6), round(x, 4), round(y, 4), round(yaw, 5))
        for at, (x, y, yaw) in zip(data.pose_s, data.poses, strict=True)
    )
    return Table("trail", "a pose of the robot", columns, rows)


def _paths(review: Review) -> Iterator[Table]:
    box = (
        Column(name, "float", "m", f"{side} edge of the part of the map that had changed")
        for name, side in zip(
            ("x_min", "y_min", "x_max", "y_max"), ("left", "lower", "right", "upper"), strict=True
        )
    )
    columns = (
        AT,
        REVISION,
        Column("steps", "int", "", "steps from point to point of the path"),
        Column("planner", "text", "", 'which planned it; "" where no plan was needed'),
        Column("plan_ms", "float", "ms", "duration of planning"),
        Column("planned_steps", "int", "", "steps of the walk as planned"),
        Column("lower_bound_steps", "int", "", "no walk has fewer"),
        Column("gap", "float", "", "cost_s / lower_bound_cost_s - 1"),
        Column("cost_s", "float", "s", "time to drive the walk as planned"),
        Column("lower_bound_cost_s", "float", "s", "no walk takes less"),
        *box,
        REASON,
    )
    data, none = review.data, (None,) * 4
    rows = (
        (
            *(round(path.at_s, 6), about.revision, about.steps, about.planner, path.plan_ms),
            *(about.planned_steps, about.lower_bound_steps, about.gap),
            *(about.planned_cost_s, about.lower_bound_cost_s),
            *(astuple(about.changed) if about.changed else none),
            about.reason,
        )
        for path, about in ((path, path.about) for path in data.paths)
    )
    yield Table("paths", "a published path", columns, rows)
    place = Column("number", "int", "", "of the point on its path, from 0")
    yield Table(
        "path_points",
        "a corner of a path, as the recorder drew it: straight on to the next",
        (AT, REVISION, place, X, Y),
        _points(review),
    )


def _points(review: Review) -> Iterator[tuple[object, ...]]:
    record, seen = review.record, set[int]()
    for _, line in drawings([part.path for part in record.parts], entities.PATH):
        # Each part repeats the path in force at its beginning.
        if isinstance(line, DrawnLine) and line.revision not in seen and len(line.xy):
            seen.add(line.revision)
            at_s = round(record.clock.seconds(line.at_ns), 6)
            for number, (x, y) in enumerate(line.xy.tolist()):
                yield at_s, line.revision, number, round(x, 4), round(y, 4)


def _mission(review: Review) -> Iterator[Table]:
    columns: tuple[Column, ...] = (
        AT,
        Column("command", "text", "", "its name"),
        Column("words", "text", "", "what it asked for"),
        Column("order", "text", "JSON", "of a start, as in protocol/schema/mission.json"),
    )
    commands = (
        (
            round(at_s, 6),
            name,
            command_words(name, order),
            msgspec.json.encode(order_document(order)).decode() if name == "start" else None,
        )
        for at_s, name, order in review.data.commands
    )
    yield Table("commands", "a command to the mission", columns, commands)
    columns = (
        Column("begin_s", "float", "s", "since the recording began"),
        Column("end_s", "float", "s", "since the recording began"),
        Column("state", "text", "", "of the mission"),
        REASON,
    )
    states = ((round(s.begin_s, 6), round(s.end_s, 6), s.name, s.reason) for s in review.states)
    yield Table("states", "a state of the mission", columns, states)
    yield _rooms(review)
    share = Column("share", "float", "", "of the cells coverable at the end")
    covered = ((round(at, 6), round(part, 6)) for at, part in review.covered_share.tolist())
    yield Table("coverage", "the share covered at a time", (AT, share), covered)
    columns = (
        AT,
        Column("name", "text", "", "of the plot, with its unit where it has one"),
        Column("value", "float", "", "what was plotted: it lasts until the next row of that name"),
    )
    plots = (
        (round(at, 6), name, value)
        for name, points in sorted(review.record.plots.items())
        for at, value in points.tolist()
    )
    yield Table("plots", "a value that was plotted", columns, plots)


def _rooms(review: Review) -> Table:
    columns = (
        Column("room", "int", "", "its number"),
        Column("name", "text", "", "given by people"),
        Column("area_m2", "float", "m2", "of its free floor, as the daemon says it"),
        Column("seconds", "float", "s", "of work in it, standstill included"),
        Column("entered", "int", "", "how often the robot came into it"),
        Column("swept_share", "float", "", "of its reachable floor, by recorded poses"),
        Column("left_m2", "float", "m2", "reachable floor in it that was not swept"),
        Column("counted_share", "float", "", "swept, as the daemon counted last"),
        Column("passes", "int", "", "the newest pass of the last order that named it"),
        Column("skip", "bool", "", "whether orders for everything leave it out"),
    )
    return Table("rooms", "a room", columns, (astuple_of(room) for room in review.rooms))


def _floor(review: Review) -> Table:
    columns = (
        X,
        Y,
        Column("swept", "bool", "", "whether the tool passed over it"),
        Column("area_m2", "float", "m2", "of the pixel"),
    )
    about = "a pixel of the floor that the tool can reach, on the map at the end"
    return Table("floor", about, columns, _pixels(review))


def _pixels(review: Review) -> Iterator[tuple[object, ...]]:
    floor = review.floor
    if floor is None:
        return
    geometry = floor.geometry
    area_m2 = round(geometry.resolution**2, 9)
    for row, col in np.argwhere(floor.reachable).tolist():
        x, y = geometry.to_map(col + 0.5, row + 0.5)
        yield round(x, 4), round(y, 4), bool(floor.swept[row, col]), area_m2


def _pheromone(review: Review) -> Table:
    columns = (
        AT,
        X,
        Y,
        Column(
            "level",
            "int",
            "",
            "1 to 255 on a log scale: pheromone = min * (max / min) ** ((level - 1) / 254), by the "
            f"last values of {entities.PHEROMONE_RANGE}/min and /max in plots until at_s",
        ),
    )
    about = "pheromone of a cell at one of up to 65 times, spread over the recording"
    return Table("pheromone", about, columns, _levels(review))


def _levels(review: Review) -> Iterator[tuple[object, ...]]:
    record = review.record
    # A limited number of fields at regular intervals, and the last one.
    every = -(-len(record.field_ns) // MOST_FIELDS) or 1
    wanted = {*record.field_ns[::every], *record.field_ns[-1:]}
    for _, field in drawings([part.path for part in record.parts], entities.PHEROMONE):
        if not isinstance(field, DrawnGrid) or field.at_ns not in wanted:
            continue
        wanted.remove(field.at_ns)
        at_s = round(record.clock.seconds(field.at_ns), 6)
        rows, cols = np.nonzero(field.pixels)
        middles = cols.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5
        x, y = field.geometry.to_map(*middles)
        levels = field.pixels[rows, cols].tolist()
        for place_x, place_y, level in zip(x.tolist(), y.tolist(), levels, strict=True):
            yield at_s, round(place_x, 4), round(place_y, 4), level
