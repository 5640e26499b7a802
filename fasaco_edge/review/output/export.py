"""The export of a review for other programs: CSV or Parquet tables, and NumPy arrays."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.host.durable import whole
from fasaco_edge.recording.arrow import pa
from fasaco_edge.review.output.tables import Column, Table, tables_of
from fasaco_edge.review.review import Review
from fasaco_edge.text import one_line

FORMULA = re.compile(r"[=@]|[+-](?![\d.]+(e[+-]?\d+)?\Z)")
CSV, PARQUET = FORMATS = ("csv", "parquet")
TYPES = {"float": pa.float64(), "int": pa.int64(), "bool": pa.bool_(), "text": pa.string()}
DESCRIPTION = "columns"
"""The table that describes the columns of the other tables."""


def export(review: Review, folder: Path, form: str = CSV) -> list[tuple[Path, str]]:
    """Write all tables of a review into ``folder``; return each file, and a phrase about it.

    Also written are columns.csv, which describes the columns and their units, and end.npz: map
    (int8), its origin (x [m], y [m], yaw [rad]) and resolution [m]; visits (uint16) of the
    lattice, its first row and column, and the edge of its cells [m].

    Args:
        review: the review.
        folder: created if missing.
        form: CSV or PARQUET.

    Raises:
        OSError: a file cannot be written.
        UnreadableRecording: a file of the recording is gone.
    """
    folder.mkdir(parents=True, exist_ok=True)
    described, written = [], []
    for table in tables_of(review):
        file = folder / f"{table.name}.{form}"
        if form == CSV:
            _write_csv(table, file)
        else:
            _write_parquet(table, file)
        written.append((file, f"a row is {table.about}"))
        described += [(file.name, table.about, *column) for column in table.columns]
    columns = (
        Column("file", "text", "", "its name"),
        Column("row", "text", "", "what one of its rows is"),
        Column("column", "text", "", "its name"),
        Column("type", "text", "", "float, int, bool or text"),
        Column("unit", "text", "", "of its values"),
        Column("description", "text", "", "what it is"),
    )
    # This table is CSV even with Parquet, for people to read.
    columns_of, arrays = folder / f"{DESCRIPTION}.csv", folder / "end.npz"
    _write_csv(Table(DESCRIPTION, "", columns, described), columns_of)
    _write_arrays(review, arrays)
    return [
        (columns_of, "what the columns of the tables hold, in what units: begin here"),
        *written,
        (arrays, "the map at the end, and how often each cell was covered, for NumPy"),
    ]


def _write_csv(table: Table, file: Path) -> None:
    with whole(file) as new, new.open("w", encoding="utf-8", newline="") as target:
        writer = csv.writer(target)
        writer.writerow(column.name for column in table.columns)
        writer.writerows([_cell(value) for value in row] for row in table.rows)


def _write_parquet(table: Table, file: Path) -> None:
    from pyarrow import parquet  # noqa: PLC0415

    schema = pa.schema(
        [
            pa.field(
                column.name,
                TYPES[column.kind],
                metadata={"unit": column.unit, "description": column.about},
            )
            for column in table.columns
        ],
        metadata={"description": table.about},
    )
    with whole(file) as new, parquet.ParquetWriter(new, schema) as writer:
        rows: list[Sequence[object]] = []
        for row in table.rows:
            rows.append([one_line(value) if isinstance(value, str) else value for value in row])
            if len(rows) == ROWS:
                writer.write_batch(_batch(rows, schema))
                rows = []
        writer.write_batch(_batch(rows, schema))


# Limit on the rows held in memory.
ROWS = 50_000


def _batch(rows: list[Sequence[object]], schema: pa.Schema) -> pa.RecordBatch:
    values = zip(*rows, strict=True) if rows else ((),) * len(schema)
    arrays = [pa.array(column, kind) for column, kind in zip(values, schema.types, strict=True)]
    return pa.record_batch(arrays, schema=schema)


def _cell(value: object) -> object:
    """Return a value that no spreadsheet takes for a formula."""
    if isinstance(value, bool):
        return int(value)
    text = one_line(value) if isinstance(value, str) else value
    return f"'{text}" if isinstance(text, str) and FORMULA.match(text) else text


def _write_arrays(review: Review, file: Path) -> None:
    grid, lattice, visits = review.data.grid, review.lattice, review.visits
    arrays: dict[str, NDArray[np.generic]] = {}
    if grid is not None:
        origin = grid.geometry.origin
        arrays |= {
            "map": grid.cells,
            "map_origin": np.array((origin.x, origin.y, origin.yaw)),
            "map_resolution_m": np.array(grid.geometry.resolution),
        }
    if lattice is not None and visits is not None:
        arrays |= {
            "visits": visits,
            "lattice_corner": np.array((lattice.window.row0, lattice.window.col0)),
            "cell_m": np.array(lattice.cell_m),
        }
    # NumPy's type stub mistakes the first array for an option.
    with whole(file) as new:
        np.savez_compressed(new, **arrays)  # type: ignore[arg-type]
