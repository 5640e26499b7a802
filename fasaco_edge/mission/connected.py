"""Connected areas of a grid: cells of one kind that hang together by their edges.

By runs, row for row: an area as large as a room has no more of them than rows, so that plain
Python joins them in no time (union-find).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class ConnectedArea:
    """An area.

    Attributes:
        kind: of its cells.
        cells: how many they are.
        runs: its pieces (row, first column, column after the last), row by row.
    """

    kind: int
    cells: int
    runs: tuple[tuple[int, int, int], ...]

    @property
    def inner_cell(self) -> tuple[int, int]:
        """A cell (row, column) of it: the middle of its longest run."""
        row, first, last = max(self.runs, key=lambda run: run[2] - run[1])
        return row, (first + last - 1) // 2


def connected_areas(kinds: NDArray[np.uint8]) -> list[ConnectedArea]:
    """Return the areas of all kinds but 0 in a grid, uint8 (rows, cols), the largest first."""
    runs = _runs(kinds)
    parents = list(range(len(runs)))
    above = 0
    for index, (row, first, last, kind) in enumerate(runs):
        # Of the row before, go on from the first run that may still touch one.
        while above < index and (runs[above][0] < row - 1 or _is_left_of(runs[above], row, first)):
            above += 1
        for other in range(above, index):
            other_row, other_first, _, other_kind = runs[other]
            if other_row == row or other_first >= last:
                break
            if other_kind == kind:
                parents[_root(parents, other)] = _root(parents, index)
    members: dict[int, list[tuple[int, int, int, int]]] = {}
    for index, run in enumerate(runs):
        members.setdefault(_root(parents, index), []).append(run)
    areas = [
        ConnectedArea(
            kind=pieces[0][3],
            cells=sum(last - first for _, first, last, _ in pieces),
            runs=tuple((row, first, last) for row, first, last, _ in pieces),
        )
        for pieces in members.values()
    ]
    return sorted(areas, key=lambda area: (-area.cells, area.runs))


def _runs(kinds: NDArray[np.uint8]) -> list[tuple[int, int, int, int]]:
    """Return (row, first column, column after the last, kind) of all runs, in order."""
    if not kinds.size:
        return []
    begins = np.ones(kinds.shape, bool)
    begins[:, 1:] = kinds[:, 1:] != kinds[:, :-1]
    starts = np.flatnonzero(begins)
    ends = np.append(starts[1:], kinds.size)
    found = kinds.ravel()[starts]
    wanted = found > 0
    rows, firsts = np.divmod(starts[wanted], kinds.shape[1])
    lengths = (ends - starts)[wanted]
    columns = (rows, firsts, firsts + lengths, found[wanted])
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _is_left_of(run: tuple[int, int, int, int], row: int, column: int) -> bool:
    return run[0] == row - 1 and run[2] <= column


def _root(parents: list[int], index: int) -> int:
    while parents[index] != index:
        parents[index] = parents[parents[index]]
        index = parents[index]
    return index
