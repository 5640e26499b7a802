"""Ledgers for tests, and their content."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from fasaco_edge.daemon.ledger.file import LedgerFile, LoadedLedger
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.coverage.ledger import TILE, CoverageLedger, LedgerSnapshot
from fasaco_edge.mission.coverage.swept_floor import SweptFloor

CELL_M = 0.3
# File names of the newest and the previous ledger.
NAMES = ("robot.ledger", "robot.ledger.previous")
Cell = tuple[int, int]


def driven(*cells: Cell, cell_m: float = CELL_M, frame: str = "map") -> LedgerSnapshot:
    """Return the ledger of a robot that visited cells (row, col) in this order."""
    ledger, floor = CoverageLedger(cell_m, frame), SweptFloor(cell_m)
    for row, col in cells:
        pose = Pose2D((col + 0.5) * cell_m, (row + 0.5) * cell_m)
        ledger.record(pose)
        floor.record(pose)
    return replace(ledger.snapshot(), floor=floor.snapshot())


def lane(length: int) -> LedgerSnapshot:
    """Return the ledger of a drive along cells (0, 0), (0, 1) and so on."""
    return driven(*((0, col) for col in range(length)))


def visits_of(ledger: LedgerSnapshot) -> dict[Cell, int]:
    """Return the number of visits of each visited cell (row, col)."""
    return {
        (int(row) + TILE * i, int(col) + TILE * j): int(tile[row, col])
        for (i, j), tile in ledger.tiles.items()
        for row, col in np.argwhere(tile)
    }


def contents(ledger: LedgerSnapshot | None) -> object:
    """Return the content of a ledger in a comparable form."""
    if ledger is None:
        return None
    swept = {place: tile.tobytes() for place, tile in ledger.floor.tiles.items()}
    visits = visits_of(ledger)
    return ledger.cell_m, ledger.frame, ledger.total, ledger.under_tool, visits, swept


def load(folder: Path) -> LoadedLedger:
    """Return the ledger that a starting daemon loads from a folder."""
    return LedgerFile(folder, "robot").load(CELL_M)


def names(folder: Path) -> list[str]:
    """Return the names of all files in a folder."""
    return sorted(path.name for path in folder.iterdir())
