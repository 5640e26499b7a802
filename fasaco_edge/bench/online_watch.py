"""What there is to note of a mission under way: times, what is kept of paths, what is stale."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.checking import MOVES
from fasaco_edge.grid.lattice import CoverageLattice

# How far ahead of the robot a path is to hold still [m].
NEXT_M = 5.0


class Elapsed(NamedTuple):
    """How long something took: by the clock, and of processors [ms].

    On a quiet machine both are the same, as there is one thread at work.
    """

    wall_ms: float
    cpu_ms: float


class Stopwatch:
    """Runs from its making on."""

    def __init__(self) -> None:
        self._wall_s, self._cpu_s = time.perf_counter(), time.process_time()

    def read(self) -> Elapsed:
        """Return how long it has run."""
        wall_s, cpu_s = time.perf_counter() - self._wall_s, time.process_time() - self._cpu_s
        return Elapsed(1e3 * wall_s, 1e3 * cpu_s)


@dataclass(slots=True)
class Watch:
    """Figures of a mission so far.

    Attributes:
        next_cells: so many steps are the next NEXT_M.
        ingests: of each step with a map, how long it took up to the decision.
        replans: of each path but the first, how long it took from the decision to it.
        kept: of each path that took the place of one still valid, the share of the next
            steps that stayed the same up to the first that did not.
        updates: of each map that left the next steps valid, whether they stayed the same.
        paths: how many were published.
        requests: how many plans were asked for.
        waiting_s: how long the robot stood without a way to go [s].
        held_up: how often it stood before an obstacle that its path led into.
        stale_m: way driven on a path that the newest map had blocked further on [m].
        faults: what the mission refused, and why.
    """

    next_cells: int
    ingests: list[Elapsed] = field(default_factory=list)
    replans: list[Elapsed] = field(default_factory=list)
    kept: list[float] = field(default_factory=list)
    updates: list[bool] = field(default_factory=list)
    paths: int = 0
    requests: int = 0
    waiting_s: float = 0.0
    held_up: int = 0
    stale_m: float = 0.0
    faults: list[str] = field(default_factory=list)

    def compare(
        self,
        before: NDArray[np.int32],
        after: NDArray[np.int32],
        lattice: CoverageLattice,
        *,
        with_path: bool,
        with_map: bool,
    ) -> None:
        """Note what is kept of the way ahead, from the robot's cell on.

        Args:
            before, after: int32 (n, 2), the way ahead then and now.
            lattice: as it is now.
            with_path, with_map: whether a path was published, and a map came.
        """
        last, then = before[: self.next_cells + 1], after[: self.next_cells + 1]
        if len(last) < 2 or not len(then) or not is_legal(last, lattice):
            return
        common = min(len(last), len(then))
        same = (last[:common] == then[:common]).all(axis=1)
        kept = max((common if same.all() else int(np.argmin(same))) - 1, 0) / (len(last) - 1)
        if with_path:
            self.kept.append(kept)
        if with_map:
            self.updates.append(kept == 1.0)


def is_legal(walk: NDArray[np.int32], lattice: CoverageLattice) -> bool:
    """Tell whether each step of a walk, int32 (n, 2), is allowed on ``lattice``."""
    window = lattice.window
    cells = walk - (window.row0, window.col0)
    if not ((cells >= 0) & (cells < lattice.steps.shape)).all():
        return False
    moves = np.diff(cells, axis=0)
    allowed = lattice.steps[tuple(cells[:-1].T)]
    legal = np.zeros(len(moves), bool)
    for direction, move in enumerate(MOVES):
        legal |= (moves == move).all(axis=1) & (allowed >> direction & 1).astype(bool)
    return bool(legal.all())
