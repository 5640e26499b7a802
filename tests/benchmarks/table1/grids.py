"""Grids of Table I, made from the maps that the paper's authors publish, by their rule.

``python -m tests.benchmarks.table1.grids grid.yaml basement.yaml`` writes ``paper_simulated.npy``
and ``paper_basement.npy``, each with its start beside it, for ``table1 --grids``. The maps are not
in this repository: fetch ``maps/grid.yaml``, ``grid.png``, ``basement.yaml`` and ``basement.png``
from github.com/nobleo/full_coverage_path_planner, on which the authors' code builds (Apache-2.0).

A cell is occupied if one of its pixels is; unknown pixels are free. Cells begin at the map's first
pixel. Cells that cannot be reached from the start do not count.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.cli.console.arguments import pair_of_floats
from fasaco_edge.errors import FasacoError, MapFileError, StartBlocked
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.grid.occupancy import OCCUPIED, OccupancyGrid
from fasaco_edge.kernels.lattice.reach import reachable_from
from tests.benchmarks.table1.paper import paper_map

# The authors' robot and tool have a radius of 0.3 m.
CELL_M = 0.6


@dataclass(frozen=True, slots=True)
class PublishedMap:
    """A map of the paper as its authors publish it.

    Attributes:
        file: its name there.
        pixels: its size (rows, cols).
        sha256: of its pixels as map_server has them (-1, 0, 100; int8, from the lowest row).
        grid: name of the grid that is made of it.
    """

    file: str
    pixels: tuple[int, int]
    sha256: str
    grid: str


PUBLISHED = (
    PublishedMap(
        "grid.yaml",
        (300, 300),
        "ac5f42daca44f2710dde8cc9ae5cedb051c0ee2f287737ebf07c25f2849ffc12",
        "paper_simulated",
    ),
    PublishedMap(
        "basement.yaml",
        (600, 600),
        "629c577448916f36ecaf356b5fea121c8052482ce994fa6b608f30d5a0a1ffde",
        "paper_basement",
    ),
)


def digest(truth: OccupancyGrid) -> str:
    """Return the SHA-256 of a map's pixels."""
    return hashlib.sha256(np.ascontiguousarray(truth.cells, np.int8).tobytes()).hexdigest()


def published(truth: OccupancyGrid) -> PublishedMap | None:
    """Return which of the paper's maps this is; None for any other."""
    return next((known for known in PUBLISHED if known.sha256 == digest(truth)), None)


def authors_grid(
    truth: OccupancyGrid, cell_m: float, start_xy: tuple[float, float]
) -> tuple[NDArray[np.bool_], Cell]:
    """Return the cells that can be reached, bool (rows, cols), and the start.

    Raises:
        StartBlocked: the start is off the map, or in an occupied cell.
    """
    size = max(int(cell_m / truth.geometry.resolution + 1e-6), 1)
    rows, cols = (-(-side // size) for side in truth.cells.shape)
    is_occupied = np.zeros((rows * size, cols * size), bool)
    is_occupied[: truth.cells.shape[0], : truth.cells.shape[1]] = truth.cells == OCCUPIED
    blocks = is_occupied.reshape(rows, size, cols, size)
    free: NDArray[np.bool_] = np.logical_not(np.logical_or.reduce(blocks, axis=(1, 3)))
    column, row = (int(at // size) for at in truth.geometry.to_pixels(*start_xy))
    if not (0 <= row < rows and 0 <= column < cols and free[row, column]):
        raise StartBlocked(f"the start {start_xy} m is off the map, or its cell is occupied")
    reached = reachable_from(CoverageLattice.from_free(free).steps, row, column)
    return reached.astype(bool), (row, column)


def write_grid(file: Path, cell_m: float, start_xy: tuple[float, float], folder: Path) -> str:
    """Write the grid of a map and its start; return a line that tells of it."""
    truth = read_map(find_map(file))
    known = published(truth)
    grid, start = authors_grid(truth, cell_m, start_xy)
    name = known.grid if known is not None else file.stem
    cells = int(np.count_nonzero(grid))
    target = folder / f"{name}.npy"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        np.save(target, grid)
        target.with_suffix(".json").write_text(json.dumps({"start": start}), encoding="utf-8")
    except OSError as error:
        raise MapFileError(f"{target}: {error.strerror}") from error
    paper = paper_map(name, cells)
    said = f"the paper's {paper.name}" if known and paper else "none of the paper's grids"
    rows, cols = truth.cells.shape
    return (
        f"{target}: {cells} cells of {cell_m:g} m, start {start[0]},{start[1]}; {said}"
        f" ({cols} x {rows} pixels, SHA-256 {digest(truth)})"
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Write grids and return the process's exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.table1.grids",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP.yaml")
    parser.add_argument(
        "--cell", type=float, default=CELL_M, metavar="M", help="edge of a cell [m] (default: 0.6)"
    )
    parser.add_argument(
        "--start-xy", type=pair_of_floats, default=(0.0, 0.0), metavar="X,Y", help="(default: 0,0)"
    )
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="(default: here)")
    args = parser.parse_args(argv)
    if not 0.0 < args.cell < math.inf:
        parser.error(f"argument --cell: must be above 0, got {args.cell:g}")
    try:
        for file in args.maps:
            print(write_grid(file, args.cell, args.start_xy, args.out))
    except FasacoError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
