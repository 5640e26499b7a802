"""Independent judge of coverage walks.

It shares no code with the planners and kernels that it judges: it has its own directions,
reachability and counts, all in numpy. To find the reachable cells, it labels the connected parts of
the grid, whereas the kernels search from the start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Cell = tuple[int, int]

# Bit 0 to 3 of a step mask: east, north (row + 1), west, south.
MOVES = np.array(((0, 1), (1, 0), (0, -1), (-1, 0)), np.int64)
NO_MOVE = 4

# Of each kind of problem so many are told one by one.
TOLD = 3


@dataclass(frozen=True, slots=True)
class WalkVerdict:
    """What there is to say of a walk.

    Attributes:
        legal: it starts at the start, ends at the end if there is one to end at, and each
            of its steps is allowed by the mask.
        complete: every wanted cell that can be reached from the start is visited.
        steps: entries of the walk beyond the first.
        revisits: entries of the walk beyond the first at each cell.
        turns_90: quarter-turns between two steps that follow each other.
        turns_180: steps straight back.
        problems: what is wrong and where, the first few of each kind; empty if and only if
            the walk is legal and complete.
    """

    legal: bool
    complete: bool
    steps: int
    revisits: int
    turns_90: int
    turns_180: int
    problems: tuple[str, ...]


def check_walk(
    steps: NDArray[np.uint8],
    wanted: NDArray[np.bool_],
    walk: NDArray[np.integer],
    start: Cell,
    end: Cell | None = None,
) -> WalkVerdict:
    """Judge a walk; all cells are (row, col) of the arrays.

    Args:
        steps: step masks, uint8 (rows, cols), bit ``1 << direction`` (east, north, west,
            south) where a step is allowed; a step is allowed both ways or not at all.
        wanted: what was to be covered, bool (rows, cols); need not be reachable.
        walk: the cells in order, integers (n, 2).
        start: where the walk has to start.
        end: where it has to end; None lets it end anywhere.

    Raises:
        ValueError: the question itself is malformed: shapes or types do not fit, start or
            end lies outside the arrays, or the masks allow a step off the arrays or a
            step without the way back.
    """
    _check_question(steps, wanted, walk, start, end)
    cells = walk.astype(np.int64)
    inside = np.all((cells >= 0) & (cells < steps.shape), axis=1)
    visited = np.zeros(steps.shape, bool)
    visited[tuple(cells[inside].T)] = True
    missed = wanted & ~visited & reachable(steps, start)
    directions = _directions(cells)
    illegal = _wrong_ends(cells, start, end) + _wrong_steps(steps, cells, inside, directions)
    distinct = int(np.count_nonzero(visited)) + len(np.unique(cells[~inside], axis=0))
    before, after = directions[:-1], directions[1:]
    moving = (before != NO_MOVE) & (after != NO_MOVE)
    quarters = (after - before) % 4
    return WalkVerdict(
        legal=not illegal,
        complete=not missed.any(),
        steps=max(len(cells) - 1, 0),
        revisits=len(cells) - distinct,
        turns_90=int(np.count_nonzero(moving & (quarters % 2 == 1))),
        turns_180=int(np.count_nonzero(moving & (quarters == 2))),
        problems=tuple(illegal + _told("reachable but never visited", np.argwhere(missed))),
    )


def reachable(steps: NDArray[np.uint8], start: Cell) -> NDArray[np.bool_]:
    """Return which cells a walk from ``start`` can come to, bool (rows, cols).

    Cells in a row that are linked from west to east form a run; runs linked from south to
    north are joined until none is left to join. The work depends on the number of joins,
    not on the length of the way, so that a maze costs little more than a hall.
    """
    linked_to_west = (steps >> 2 & 1).astype(bool)
    run = np.cumsum(~linked_to_west).reshape(steps.shape) - 1
    linked_to_north = (steps[:-1] >> 1 & 1).astype(bool)
    part = _joined(int(run[-1, -1]) + 1, run[:-1][linked_to_north], run[1:][linked_to_north])
    mask: NDArray[np.bool_] = part[run] == part[run[start]]
    return mask


def _joined(nodes: int, one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the smallest node that each node hangs together with, int64 (nodes,).

    Each round hooks every part below the lowest of its neighbours and then lets all nodes
    point at their part's lowest node (Shiloach and Vishkin 1982, in essence).
    """
    lowest = np.arange(nodes)
    while True:
        one, other = lowest[one], lowest[other]
        apart = one != other
        if not apart.any():
            return lowest
        one, other = one[apart], other[apart]
        np.minimum.at(lowest, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(further := lowest[lowest], lowest):
            lowest = further


def _directions(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the direction of each step, int64 (n - 1,); NO_MOVE where it is no such step."""
    moves = np.diff(cells, axis=0)
    directions = np.full(len(moves), NO_MOVE)
    for direction, move in enumerate(MOVES):
        directions[(moves == move).all(axis=1)] = direction
    return directions


def _wrong_ends(cells: NDArray[np.int64], start: Cell, end: Cell | None) -> list[str]:
    if not len(cells):
        return ["the walk is empty"]
    problems = []
    first, last = _cell(cells[0]), _cell(cells[-1])
    if first != start:
        problems.append(f"starts at {first} instead of {start}")
    if end is not None and last != end:
        problems.append(f"ends at {last} instead of {end}")
    return problems


def _wrong_steps(
    steps: NDArray[np.uint8],
    cells: NDArray[np.int64],
    inside: NDArray[np.bool_],
    directions: NDArray[np.int64],
) -> list[str]:
    problems = _told("outside the grid", cells[~inside])
    moves = directions != NO_MOVE
    still = (cells[1:] == cells[:-1]).all(axis=1)
    problems += _told_steps("stands still", cells, still)
    problems += _told_steps("jumps", cells, ~moves & ~still)
    judged = np.flatnonzero(moves & inside[:-1] & inside[1:])
    allowed = steps[tuple(cells[judged].T)] >> directions[judged] & 1
    forbidden = np.zeros(len(moves), bool)
    forbidden[judged[allowed == 0]] = True
    return problems + _told_steps("takes a step the mask forbids", cells, forbidden)


def _told(what: str, cells: NDArray[np.int64]) -> list[str]:
    return _first_few([f"{what}: {_cell(cell)}" for cell in cells[:TOLD]], what, len(cells))


def _told_steps(what: str, cells: NDArray[np.int64], wrong: NDArray[np.bool_]) -> list[str]:
    found = np.flatnonzero(wrong)
    told = [
        f"{what}: step {i + 1}, {_cell(cells[i])} to {_cell(cells[i + 1])}" for i in found[:TOLD]
    ]
    return _first_few(told, what, len(found))


def _first_few(told: list[str], what: str, found: int) -> list[str]:
    return [*told, f"{what}: {found - len(told)} more"] if found > len(told) else told


def _cell(pair: NDArray[np.int64]) -> Cell:
    return int(pair[0]), int(pair[1])


def _check_question(
    steps: NDArray[np.uint8],
    wanted: NDArray[np.bool_],
    walk: NDArray[np.integer],
    start: Cell,
    end: Cell | None,
) -> None:
    rows, cols = shape = steps.shape
    if wanted.shape != shape or wanted.dtype != bool or steps.dtype != np.uint8:
        raise ValueError(
            f"steps must be uint8 and wanted bool, both (rows, cols), got {steps.dtype} {shape} "
            f"and {wanted.dtype} {wanted.shape}"
        )
    if walk.ndim != 2 or walk.shape[1] != 2 or not np.issubdtype(walk.dtype, np.integer):
        raise ValueError(f"walk must be integers (n, 2), got {walk.dtype} {walk.shape}")
    for name, cell in (("start", start), ("end", end)):
        if cell is not None and not (0 <= cell[0] < rows and 0 <= cell[1] < cols):
            raise ValueError(f"{name} {cell} lies outside the {rows} x {cols} grid")
    east, north, west, south = (np.pad(steps >> bit & 1, 1) for bit in range(4))
    # Padded, cell (row, col) of the eastward comparison is cell (row, col - 1), and so on.
    for (up, right), there, back in (
        ((0, 1), east[1:-1, :-1], west[1:-1, 1:]),
        ((1, 0), north[:-1, 1:-1], south[1:, 1:-1]),
    ):
        for row, col in np.argwhere(there != back)[:1].tolist():
            one, other = (row - up, col - right), (row, col)
            raise ValueError(f"the step between {one} and {other} is allowed one way only")
