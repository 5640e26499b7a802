"""The living trail: pheromone on every step of the lattice, for as long as a mission lasts.

The equations are those of Carr and Wang 2022 (``kernels.ants.colony``). Where they speak of ants,
this trail has paths, which come one after the other while the map fills:

* equation (8), global update: each planned path that is published strengthens the steps it takes;
* equation (7), local update: what the path's cells have beside those steps fades, and so does what
  the map has changed; a step that was driven loses half at once.

Deviations: the paper evaporates with each ant, of which there are a thousand to a plan. Here a
path is one. Delta phi of (8) is the path's distinct cells at a step each over what it costs, about
1 at best, as in ``planners.paper.fasaco``; a step that a path takes twice is strengthened once.

A trail lies in cells of the map frame: a window follows the lattice's, steps that come begin at
tau0, steps that go vanish. What an update costs goes with the path or the change. All is float32
and done value by value: the same on every machine. Free of the compiler: the ledger holds a trail.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window

# A step that was driven is pulled so far towards tau0: by (7) as about seven ants would.
DRIVEN = 0.5
# Directions are within reach of the strongest from this share of the way from the weakest to it
# on: lambda of the mean branching factor (Gambardella and Dorigo 1995).
LAMBDA = 0.05

# Direction of a step by 3 * rows + columns + 4.
_DIRECTION = np.array([0, 3, 0, 2, 0, 0, 0, 1, 0])
_BITS = np.array([1, 2, 4, 8], np.uint8)

Tau = NDArray[np.float32]
"""Pheromone on the step out of each cell in each direction, (rows, cols, 4); 0 for no step."""
Back = Callable[
    [NDArray[np.float64], NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]
]
"""Returns where points x, y [m] were before the map moved."""


@dataclass(frozen=True, slots=True)
class TrailRules:
    """Constants of the equations.

    Attributes:
        alpha: weight of what is new, equations (7) and (8).
        tau0: pheromone that every step begins with.
    """

    alpha: float = 0.1
    tau0: float = 0.1


PAPERS_RULES = TrailRules()


@dataclass(frozen=True, slots=True, eq=False)
class TrailSnapshot:
    """A trail at a moment; shares nothing that will change.

    Attributes:
        window: the cells it spans.
        tau: see ``Tau``; read-only.
    """

    window: Window
    tau: Tau

    def __post_init__(self) -> None:
        self.tau.flags.writeable = False

    def on(self, window: Window) -> Tau:
        """Return the trail on another window, 0 beyond this one."""
        return _carried(self.tau, self.window, window)


NOWHERE = Window(0, 0, 0, 0)
NO_TRAIL = TrailSnapshot(NOWHERE, np.empty((0, 0, 4), np.float32))


class LivingTrail:
    """The trail of a mission.

    Attributes:
        changes: goes up with each change.
    """

    def __init__(self, rules: TrailRules, before: TrailSnapshot = NO_TRAIL) -> None:
        """Begin with what was ``before``."""
        self.changes = 0
        self._rules = rules
        self._window, self._tau = before.window, before.tau

    def snapshot(self) -> TrailSnapshot:
        """Return the trail as it is now; it is copied once it changes."""
        return TrailSnapshot(self._window, self._tau)

    def follow(
        self, window: Window, steps: NDArray[np.uint8], changed: NDArray[np.int32] | None
    ) -> None:
        """Follow the lattice: what it no longer has vanishes, what is new begins at tau0.

        Args:
            window: of the lattice.
            steps: step masks, (rows, cols).
            changed: int32 (n, 2), cells (row, col) that have changed since the lattice before;
                there the rest of the trail fades by equation (7). None where that is not known:
                steps are compared.
        """
        if window != self._window:
            self._tau = _carried(self._tau, self._window, window)
            self._window = window
            self.changes += 1
        if changed is None:
            made = (self._tau > 0) != _legal(steps)
            # The four directions of a cell at once.
            places = np.flatnonzero(made.view(np.uint32))
        else:
            at = changed[_inside(changed, window)].astype(np.intp)
            places = (at[:, 0] - window.row0) * window.cols + at[:, 1] - window.col0
        if not len(places):
            return
        flat, tau0 = self._writable().reshape(-1, 4), np.float32(self._rules.tau0)
        then = flat.take(places, axis=0)
        after = np.where(then > 0, self._faded(then, self._rules.alpha), tau0)
        after *= _legal(steps.ravel().take(places))
        flat[places] = after

    def strengthen(self, cells: NDArray[np.int32], amount: float) -> None:
        """Strengthen the steps of a path by equation (8); beside them its cells fade by (7).

        Args:
            cells: int32 (n, 2), the path's cells (row, col); what lies beyond the lattice, and
                what is no step there, is left out.
            amount: delta phi.
        """
        moves = self._moves(cells)
        if not len(moves):
            return
        flat = self._writable().reshape(-1, 4)
        places = np.zeros(len(flat), np.bool_)
        places[moves // 4] = True
        on_path = np.flatnonzero(places)
        then = flat.ravel().take(moves)
        around = flat.take(on_path, axis=0)
        flat[on_path] = self._faded(around, self._rules.alpha) * (around > 0)
        alpha = np.float32(self._rules.alpha)
        kept = np.float32(1) - alpha
        flat.ravel()[moves] = kept * then + alpha * np.float32(amount)

    def fade(self, cells: NDArray[np.int32]) -> None:
        """Let the steps between cells that were driven, int32 (n, 2), lose half."""
        moves = self._moves(cells)
        if len(moves):
            flat = self._writable().ravel()
            flat[moves] = self._faded(flat[moves], DRIVEN)

    def move(self, before: TrailSnapshot, back: Back, turns: int, cell_m: float) -> None:
        """Take the trail from before the map moved, cell by cell from where each was.

        Args:
            before: the trail on the map as it was.
            back: where a place was.
            turns: quarter-turns, counter-clockwise, that the map has made.
            cell_m: edge of a cell [m].
        """
        window = self._window
        # Only cells that have steps; the four directions of a cell at once.
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
        is_step = (np.abs(up) + np.abs(right) == 1) & _inside(cells[:-1], self._window)
        row, col = rows[:-1] - self._window.row0, cols[:-1] - self._window.col0
        place = row.astype(np.intp) * self._window.cols + col
        moves = (4 * place + _DIRECTION.take(3 * up + right + 4, mode="clip"))[is_step]
        legal: NDArray[np.intp] = moves[self._tau.ravel().take(moves) > 0]
        return legal


def _legal(steps: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which directions of step masks are legal, bool (..., 4)."""
    return (steps[..., np.newaxis] & _BITS).astype(np.bool_)


# By direction: from where its moves lead, and to where. One array at a time is several times as
# fast as all four directions at once.
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
        tau: (rows, cols, 4), 0 for no step; a step is legal both ways or not at all.
    """
    shape = tau.shape[:2]
    into, moves = np.zeros(shape), np.zeros(shape, np.uint8)
    for direction, (here, there) in enumerate(_MOVES):
        into[there] += tau[..., direction][here]
        # Moves in are as many as moves out.
        moves += tau[..., direction] > 0
    return np.divide(into, moves, out=into, where=moves > 0).astype(np.float32)


def strongest_into(tau: Tau) -> NDArray[np.float32]:
    """Return the pheromone on the strongest step into each cell, float32 (rows, cols)."""
    into = np.zeros(tau.shape[:2], np.float32)
    for direction, (here, there) in enumerate(_MOVES):
        np.maximum(into[there], tau[..., direction][here], out=into[there])
    return into


def directions(tau: Tau) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Return where the trail points to, and how decided it is, cell by cell.

    Returns:
        The direction of the strongest step out of each cell, int8 (rows, cols), of equals the
        first; -1 where there is no step. And its share of the pheromone on all steps out of the
        cell, float32 (rows, cols), 0 where there is none.
    """
    shape = tau.shape[:2]
    strongest, total = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    pointed = np.full(shape, -1, np.int8)
    for direction in range(4):
        way = tau[..., direction]
        pointed[way > strongest] = direction
        np.maximum(strongest, way, out=strongest)
        total += way
    return pointed, np.divide(strongest, total, out=strongest, where=total > 0)


def branching(tau: Tau) -> float:
    """Return the mean lambda-branching factor: directions within reach of the strongest.

    1 where every cell has one direction that stands out; 0 where there is no step.
    """
    ways = [tau[..., direction] for direction in range(4)]
    strongest = np.maximum(np.maximum(ways[0], ways[1]), np.maximum(ways[2], ways[3]))
    weakest = strongest.copy()
    for way in ways:
        np.minimum(weakest, way, out=weakest, where=way > 0)
    least = weakest + np.float32(LAMBDA) * (strongest - weakest)
    within = sum(int(np.count_nonzero((way > 0) & (way >= least))) for way in ways)
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
