"""A review as files for other programs: CSV with one header line, and NumPy arrays."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from msgspec.structs import astuple
from numpy.typing import NDArray

from fasaco_edge.review.panels import covered_share
from fasaco_edge.review.review import Review
from fasaco_edge.text import one_line

FORMULA = re.compile(r"[=@]|[+-](?![\d.]+(e[+-]?\d+)?\Z)")
PATH_COLUMNS = (
    *("at_s", "revision", "steps", "planner", "plan_ms"),
    *("planned_steps", "lower_bound_steps", "gap", "cost_s", "lower_bound_cost_s"),
    *("x_min", "y_min", "x_max", "y_max", "reason"),
)


def export(review: Review, folder: Path) -> None:
    """Write all series of a review into ``folder``, which is made if missing.

    =============  =======================================================================
    trail.csv      each pose [m, rad]
    paths.csv      each published path, and the rectangle in which the map had changed [m]
    plans.csv      each plan that was made, also those that became no path
    states.csv     the states of the mission
    coverage.csv   covered share of the cells coverable at the end
    plots.csv      all that was plotted: latencies, memory, fractions
    end.npz        map int8 and its origin (x, y, yaw) and resolution_m; visits uint16 and
                   reachable bool of the lattice with its first row, column and cell_m
    =============  =======================================================================

    Raises:
        OSError: a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, (columns, rows) in _tables(review).items():
        with (folder / f"{name}.csv").open("w", encoding="utf-8", newline="") as target:
            writer = csv.writer(target)
            writer.writerow(columns)
            writer.writerows([_cell(value) for value in row] for row in rows)
    _write_arrays(review, folder / "end.npz")


def _tables(review: Review) -> dict[str, tuple[Sequence[str], Iterable[Sequence[object]]]]:
    """Return columns and rows of each CSV file; times are since the recording began [s]."""
    data, none = review.data, (None,) * 4
    return {
        "trail": (
            ("at_s", "x_m", "y_m", "yaw_rad"),
            (
                (f"{at:.6f}", f"{x:.4f}", f"{y:.4f}", f"{yaw:.5f}")
                for at, (x, y, yaw) in zip(data.pose_s, data.poses, strict=True)
            ),
        ),
        "paths": (
            PATH_COLUMNS,
            (
                (
                    *(f"{at_s:.6f}", a.revision, a.steps, a.planner, plan_ms),
                    *(a.planned_steps, a.lower_bound_steps, a.gap),
                    *(a.planned_cost_s, a.lower_bound_cost_s),
                    *(astuple(a.changed) if a.changed else none),
                    a.reason,
                )
                for at_s, a, plan_ms in ((p.at_s, p.about, p.plan_ms) for p in data.paths)
            ),
        ),
        "plans": (
            ("at_s", "took_ms", "attempt", "used", "reason"),
            (
                (f"{p.at_s:.6f}", f"{p.took_ms:.3f}", int(p.is_attempt), int(p.is_used), p.reason)
                for p in data.plan_log.plans
            ),
        ),
        "states": (
            ("begin_s", "end_s", "state", "reason"),
            ((f"{s.begin_s:.6f}", f"{s.end_s:.6f}", s.name, s.reason) for s in review.states),
        ),
        "coverage": (
            ("at_s", "share"),
            (
                (f"{at:.6f}", f"{share:.6f}")
                for at, share in zip(*covered_share(review), strict=True)
            ),
        ),
        "plots": (
            ("at_s", "name", "value"),
            (
                (f"{at:.6f}", name, f"{value:.9g}")
                for name, points in sorted(review.record.plots.items())
                for at, value in points.tolist()
            ),
        ),
    }


def _cell(value: object) -> object:
    """Return a value that no spreadsheet takes for a formula, unless it is a number."""
    text = one_line(value) if isinstance(value, str) else value
    return f"'{text}" if isinstance(text, str) and FORMULA.match(text) else text


def _write_arrays(review: Review, file: Path) -> None:
    grid, lattice, drive = review.data.grid, review.lattice, review.drive
    arrays: dict[str, NDArray[np.generic]] = {}
    if grid is not None:
        origin = grid.geometry.origin
        arrays |= {
            "map": grid.cells,
            "map_origin": np.array((origin.x, origin.y, origin.yaw)),
            "map_resolution_m": np.array(grid.geometry.resolution),
        }
    if lattice is not None and drive is not None:
        arrays |= {
            "visits": drive.visits,
            "reachable": drive.reachable,
            "lattice_corner": np.array((lattice.window.row0, lattice.window.col0)),
            "cell_m": np.array(lattice.cell_m),
        }
    # As NumPy's own readers take it; its stub takes the first array for an option.
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
