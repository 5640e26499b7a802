"""Living trail: pheromone on every step of the lattice, kept during a whole mission.

The ants of each plan, and of each attempt in spare time, start from the trail, and leave it changed
to the next ants. The equations are those of Carr and Wang 2022:

* equation (7), local update: applied by each ant (``kernels.ants``) and at each change of the map.
  Driving a step also halves its pheromone;
* equation (8), global update: ants apply it along discs that they rebuilt, each published plan
  along its path; the other steps at the path's cells fade by (7).

Delta phi = (distinct cells x step cost) / path cost, about 1 at best, as in
``planners.paper.fasaco``; a step that a path takes twice is strengthened once.

A trail spans the lattice's window of cells; new steps begin at tau0, removed steps vanish. The time
of an update depends on the length of the path or the size of the change. Values are float32 and
computed one by one, so they are equal on every machine. This module imports no numba, so that a
ledger, which holds a trail, can be read without it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window

# Pull of a driven step towards tau0, equal to equation (7) applied by about seven ants.
DRIVEN = 0.5
# Lambda of the mean branching factor (Gambardella and Dorigo 1995): a direction is within reach of
# the strongest if its pheromone is at least weakest + LAMBDA * (strongest - weakest).
LAMBDA = 0.05

# Direction of a step by index 3 * rows + columns + 4.
_DIRECTION = np.array([0, 3, 0, 2, 0, 0, 0, 1, 0])
_BITS = np.array([1, 2, 4, 8], np.uint8)

Tau = NDArray[np.float32]
"""Pheromone on the step out of each cell in each direction, (rows, cols, 4); 0 for no step."""
Back = Callable[
    [NDArray[np.float64], NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]
]
"""Returns points x, y [m] before a motion of the map."""


@dataclass(frozen=True, slots=True)
class TrailRules:
    """Constants of the equations.

    Attributes:
        alpha: weight of the new value, equations (7) and (8).
        tau0: initial pheromone of every step.
    """

    alpha: float = 0.1
    tau0: float = 0.1


PAPERS_RULES = TrailRules()


@dataclass(frozen=True, slots=True, eq=False)
class TrailSnapshot:
    """An immutable copy of a trail.

    Attributes:
        window: its window of cells.
        tau: see ``Tau``; read-only.
    """

    window: Window
    tau: Tau

    def __post_init__(self) -> None:
        self.tau.flags.writeable = False

    def on(self, window: Window) -> Tau:
        """Return the trail on another window, 0 outside of its own."""
        return _carried(self.tau, self.window, window)


NOWHERE = Window(0, 0, 0, 0)
NO_TRAIL = TrailSnapshot(NOWHERE, np.empty((0, 0, 4), np.float32))


class LivingTrail:
    """The trail of a mission.

    Attributes:
        changes: counter of changes.
        ants: number of ants that have walked on it.
    """

    def __init__(self, rules: TrailRules, before: TrailSnapshot = NO_TRAIL) -> None:
        """Start with the trail ``before``."""
        self.changes = self.ants = 0
        self._rules = rules
        self._window, self._tau = before.window, before.tau

    def snapshot(self) -> TrailSnapshot:
        """Return a copy; the trail is copied on write."""
        return TrailSnapshot(self._window, self._tau)

    def follow(
        self, window: Window, steps: NDArray[np.uint8], changed: NDArray[np.int32] | None
    ) -> None:
        """Follow the lattice: removed steps vanish, new ones start at tau0.

        Args:
            window: window of the lattice.
            steps: step masks, (rows, cols).
            changed: int32 (n, 2), cells (row, col) changed since the last lattice; their remaining
                pheromone fades by equation (7). None if unknown: steps are compared.
        """
        if window != self._window:
            self._tau = _carried(self._tau, self._window, window)
            self._window = window
            self.changes += 1
        if changed is None:
            made = (self._tau > 0) != legal(steps)
            # The four directions of a cell as one word.
            places = np.flatnonzero(made.view(np.uint32))
        else:
            at = changed[_inside(changed, window)].astype(np.intp)
            places = (at[:, 0] - window.row0) * window.cols + at[:, 1] - window.col0
        if not len(places):
            return
        flat, tau0 = self._writable().reshape(-1, 4), np.float32(self._rules.tau0)
        then = flat.take(places, axis=0)
        after = np.where(then > 0, self._faded(then, self._rules.alpha), tau0)
        after *= legal(steps.ravel().take(places))
        flat[places] = after

    def take(self, walked: TrailSnapshot, ants: int) -> None:
        """Take over a trail that a number of ants have changed; removed steps stay removed."""
        self.ants += ants
        common = self._window.intersection(walked.window)
        if common is None:
            return
        held, found = self._writable()[common.slices_in(self._window)], walked.on(common)
        np.copyto(held, found, where=(held > 0) & (found > 0))

    def strengthen(self, cells: NDArray[np.int32], amount: float) -> None:
        """Strengthen a path's steps by equation (8); the other steps at its cells fade by (7).

        Args:
            cells: int32 (n, 2), the path's cells (row, col); cells off the lattice, and moves that
                are no legal step, are skipped.
            amount: delta phi.
        """
        moves = self._moves(cells)
        if not len(moves):
            return
        flat = self._writable().reshape(-1, 4)
        places = np.zeros(len(flat), np.bool_)
        places[moves >> 2] = True
        on_path = np.flatnonzero(places)
        then = flat.ravel().take(moves)
        # The four directions of a cell as one item.
        cell = flat.view(np.complex128).ravel()
        around = cell.take(on_path).view(np.float32)
        faded = self._faded(around, self._rules.alpha)
        faded *= around > 0
        cell[on_path] = faded.view(np.complex128)
        alpha = np.float32(self._rules.alpha)
        kept = np.float32(1) - alpha
        flat.ravel()[moves] = kept * then + alpha * np.float32(amount)

    def fade(self, cells: NDArray[np.int32]) -> None:
        """Halve the pheromone on driven steps between cells, int32 (n, 2)."""
        moves = self._moves(cells)
        if len(moves):
            flat = self._writable().ravel()
            flat[moves] = self._faded(flat[moves], DRIVEN)

    def move(self, before: TrailSnapshot, back: Back, turns: int, cell_m: float) -> None:
        """Move the trail with the map, cell by cell.

        Args:
            before: the trail before the motion.
            back: returns points before the motion.
            turns: counter-clockwise rotation of the map in quarter-turns.
            cell_m: edge of a cell [m].
        """
        window = self._window
        # Only cells with steps are moved; the four directions of a cell are one word.
        places = np.flatnonzero((self._tau > 0).view(np.uint32))
        if not len(places):
            return
        rows, cols = np.divmod(places, window.cols)
        x, y = back((cols + window.col0 + 0.5) * cell_m, (rows + window.row0 + 0.5) * cell_m)
        was = np.stack((np.floor(y / cell_m), np.floor(x / cell_m)), axis=-1).astype(np.int64)
        inside = _inside(was, before.window)
        row, col = (was[inside] - np.array((before.window.row0, before.window.col0))).T
        then = before.tau.reshape(-1, 4).take(row * before.window.cols + col, axis=0)
        then = np.roll(then, turns, axis=1)
        found = np.full((len(was), 4), self._rules.tau0, np.float32)
        found[inside] = np.where(then > 0, then, np.float32(self._rules.tau0))
        flat = self._writable().reshape(-1, 4)
        flat[places] = np.where(flat.take(places, axis=0) > 0, found, np.float32(0))

    def _writable(self) -> Tau:
        self.changes += 1
        if not self._tau.flags.writeable:
            self._tau = self._tau.copy()
        return self._tau

    def _faded(self, tau: Tau, weight: float) -> Tau:
        """Return pheromone pulled towards tau0, equation (7)."""
        part = np.float32(weight)
        faded: Tau = (np.float32(1) - part) * tau + part * np.float32(self._rules.tau0)
        return faded

    def _moves(self, cells: NDArray[np.int32]) -> NDArray[np.intp]:
        """Return the steps between cells as indices of the flattened trail."""
        rows, cols = np.ascontiguousarray(cells.T)
        up, right = np.diff(rows), np.diff(cols)
        row, col = rows[:-1] - self._window.row0, cols[:-1] - self._window.col0
        is_step = (np.abs(up) + np.abs(right) == 1) & _inside(cells[:-1], self._window)
        place = row.astype(np.intp) * self._window.cols + col
        moves = 4 * place + _DIRECTION.take(3 * up + right + 4, mode="clip")
        if not is_step.all():
            moves = moves[is_step]
        legal: NDArray[np.intp] = moves[self._tau.ravel().take(moves) > 0]
        return legal


def legal(steps: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which directions of step masks are legal, bool (..., 4)."""
    return (steps[..., np.newaxis] & _BITS).astype(np.bool_)


# Slices by direction: origins of its moves, and their destinations. One direction at a time is
# several times as fast as all four at once.
_AHEAD, _BEHIND = np.s_[1:], np.s_[:-1]
_MOVES: tuple[tuple[Any, Any], ...] = (
    (np.s_[:, _BEHIND], np.s_[:, _AHEAD]),
    (np.s_[_BEHIND], np.s_[_AHEAD]),
    (np.s_[:, _AHEAD], np.s_[:, _BEHIND]),
    (np.s_[_AHEAD], np.s_[_BEHIND]),
)


def mean_into(tau: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return the mean pheromone on the steps into each cell, float32 (rows, cols); 0 for none.

    Args:
        tau: (rows, cols, 4), 0 for no step; steps are legal both ways or not at all.
    """
    shape = tau.shape[:2]
    into, moves = np.zeros(shape), np.zeros(shape, np.uint8)
    for direction, (here, there) in enumerate(_MOVES):
        into[there] += tau[..., direction][here]
        # There are as many moves into a cell as out of it.
        moves += tau[..., direction] > 0
    return np.divide(into, moves, out=into, where=moves > 0).astype(np.float32)


def strongest_into(tau: Tau) -> NDArray[np.float32]:
    """Return the pheromone on the strongest step into each cell, float32 (rows, cols)."""
    into = np.zeros(tau.shape[:2], np.float32)
    for direction, (here, there) in enumerate(_MOVES):
        np.maximum(into[there], tau[..., direction][here], out=into[there])
    return into


def directions(tau: Tau) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Return the direction of the trail in each cell, and how dominant it is.

    Returns:
        The direction of the strongest step out of each cell, int8 (rows, cols), the first of
        equals, -1 for no step; and its share of the pheromone on all steps out of the cell,
        float32 (rows, cols), 0 for no step.
    """
    shape = tau.shape[:2]
    strongest, total = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    pointed = np.full(shape, -1, np.int8)
    for direction in range(4):
        layer = tau[..., direction]
        pointed[layer > strongest] = direction
        np.maximum(strongest, layer, out=strongest)
        total += layer
    return pointed, np.divide(strongest, total, out=strongest, where=total > 0)


def branching(tau: Tau) -> float:
    """Return the mean lambda-branching factor: directions within reach of the strongest.

    It is 1 if one direction dominates in every cell; 0 without steps.
    """
    layers = [tau[..., direction] for direction in range(4)]
    strongest = np.maximum(np.maximum(layers[0], layers[1]), np.maximum(layers[2], layers[3]))
    weakest = strongest.copy()
    for layer in layers:
        np.minimum(weakest, layer, out=weakest, where=layer > 0)
    least = weakest + np.float32(LAMBDA) * (strongest - weakest)
    within = sum(int(np.count_nonzero((layer > 0) & (layer >= least))) for layer in layers)
    cells = int(np.count_nonzero(strongest))
    return within / cells if cells else 0.0


def _inside(cells: NDArray[np.signedinteger], window: Window) -> NDArray[np.bool_]:
    rows, cols = cells[:, 0], cells[:, 1]
    inside: NDArray[np.bool_] = (
        (rows >= window.row0) & (rows < window.row1) & (cols >= window.col0) & (cols < window.col1)
    )
    return inside


def _carried(tau: Tau, old: Window, new: Window) -> Tau:
    if old == new:
        return tau
    result = np.zeros((new.rows, new.cols, 4), np.float32)
    common = new.intersection(old)
    if common is not None:
        result[common.slices_in(new)] = tau[common.slices_in(old)]
    return result
