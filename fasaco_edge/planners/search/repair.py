"""Repair of the previous walk, after the problem has changed.

The walk is completed, then improved around the changes. Its valid parts stay as they are, cell by
cell: a change is accepted only for a gain, and at first the next ``HELD_CELLS`` cells change only
where the map has changed. So the path is stable where the map is. Apart from a few passes over the
walk, all work is local, and its time depends on the change.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import NothingToCover
from fasaco_edge.kernels.local_search.regions import changed_cells
from fasaco_edge.planners.bound import GLANCE, lower_bound_of
from fasaco_edge.planners.cost import MICROSECONDS, NO_WORK, SearchWork
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath, Saved, common_beginning
from fasaco_edge.planners.planner import SearchProgress, StoppingCriterion
from fasaco_edge.planners.problem import CoverageProblem, FramedGround
from fasaco_edge.planners.search.effort import RepairEffort, repair_for
from fasaco_edge.planners.search.regions import Neighbourhood, neighbourhoods, spot
from fasaco_edge.planners.search.search_trail import SearchTrail
from fasaco_edge.planners.search.walk_region import WalkRegion, stream_of
from fasaco_edge.planners.walk_before import HELD_CELLS, completed_from, framed_cells

# Perturbations between two pauses.
PERTURBATIONS_AT_ONCE = 8
# Limit on the perturbations of a neighbourhood, in case no move can be proposed in it.
MOST_PERTURBATIONS = 100
# Share of the first repair's proposals that a second repair makes, which keeps the path ahead.
FEW = 0.2

# Attempts to improve a valid walk: stride between the first spots of two attempts; approximate
# number of cells of a spot; number of passes over all spots without gain that ends the search.
STRIDE, SPOT_CELLS, PASSES = 997, 400, 4

# Largest number of cells for which a lower bound is computed, and a second repair is made: with
# more, the bound would take most of a repair's time, and a second repair would double this time.
BOUNDED_CELLS = 2_000


def repaired(
    problem: CoverageProblem,
    name: str,
    config: ColonyConfig,
    stop: StoppingCriterion,
    *,
    has_ants: bool = True,
) -> CoveragePath:
    """Return a complete walk that keeps the valid parts of ``problem.before``.

    Args:
        problem: with a walk ``before``, see ``CoverageProblem.can_repair``.
        name: name of the planner.
        config: seed, and constants of the ants.
        stop: stopping criterion.
        has_ants: whether ants make every other perturbation.
    """
    effort = repair_for(problem.cost, has_ants=has_ants)
    repair = _Repair(problem, config, effort)
    is_stopped = _run(repair, stop)
    path = repair.path(name, config.seed)
    if problem.whole is not None:
        return path
    assert problem.before is not None
    next_cells = problem.before[: HELD_CELLS + 1]
    held = common_beginning(next_cells, repair.completed)
    is_large = problem.cells > BOUNDED_CELLS
    if is_stopped or is_large or common_beginning(next_cells, path.cells) >= held:
        return path
    return _steady(problem, config, effort, path, held - 1, repair.completed_us, stop)


def _run(repair: _Repair, stop: StoppingCriterion) -> bool:
    """Run a repair; return whether it was stopped."""
    return any(stop(repair.progress()) for _ in repair.run())


def _steady(
    problem: CoverageProblem,
    config: ColonyConfig,
    effort: RepairEffort,
    path: CoveragePath,
    held: int,
    completed_us: int,
    stop: StoppingCriterion,
) -> CoveragePath:
    """Return a path that begins with ``held`` steps of the previous walk, if it is similarly good.

    A repair may change the path just ahead where a change farther ahead would gain as much. So only
    the walk after these steps is repaired. Few perturbations are enough, as more of them would not
    keep more steps.
    The result costs no more than the completed walk.
    """
    assert problem.before is not None
    try:
        rest = replace(problem.after(held), whole=None)
    except NothingToCover:
        return path
    few = replace(effort, proposals=int(FEW * effort.proposals), held=0)
    repair = _Repair(rest, config, few, path.work)
    _run(repair, stop)
    other = repair.path(path.planner, path.seed)
    cells = np.concatenate((problem.before[:held], other.cells))
    cost_us = problem.price_us(cells)
    path_us = problem.price_us(path.cells)
    if cost_us > min(path_us + effort.steady_us, max(path_us, completed_us)):
        return replace(path, work=other.work)
    cost_s = cost_us / MICROSECONDS
    saved = Saved(local_search=(completed_us - cost_us) / MICROSECONDS)
    return replace(path, cells=cells, work=other.work, cost_s=cost_s, saved=saved)


class _Repair:
    """A running repair; like ``search.Search`` it can be paused between two pieces of work.

    Attributes:
        completed: int32 (n, 2), the walk's next cells before improvement.
        completed_us: cost of the completed walk [us].
    """

    def __init__(
        self,
        problem: CoverageProblem,
        config: ColonyConfig,
        effort: RepairEffort,
        work: SearchWork = NO_WORK,
    ) -> None:
        assert problem.before is not None
        began = time.perf_counter()
        self._problem, self._trail = problem, SearchTrail(problem, config)
        self._framed = FramedGround.of(problem)
        self._effort = effort
        before = framed_cells(problem, self._framed, problem.before)
        self._walk = completed_from(problem, self._framed, before, HELD_CELLS)
        self.completed = problem.cells_of(self._framed.unframed(self._walk[: HELD_CELLS + 1]))
        self._first_walk_s = time.perf_counter() - began
        self._changed = _changed(self._framed, before, self._walk)
        self.completed_us = self._cost_us = problem.cost_us(self._walk, self._framed)
        has_bound = problem.only_better or problem.cells <= BOUNDED_CELLS
        self._bound = lower_bound_of(problem, GLANCE) if has_bound else None
        self._random = stream_of(config.seed, len(self._walk))
        # Work on earlier regions, and the region that is being improved.
        self._work = work
        self._region: WalkRegion | None = None
        self._saved_by_ants_us = np.zeros(len(config.velocities), np.int64)

    def run(self) -> Iterator[None]:
        """Improve the walk, one neighbourhood after the other; pause after each piece of work."""
        for place in self._places():
            region = place.walk_region(self._walk, self._trail)
            if region.load(self._framed, self._walk, place.box):
                self._region = region
                yield from self._improve(region, place)
                self._unload()

    def _places(self) -> Iterator[Neighbourhood]:
        """Yield the places to improve: around the changes; or spots, until nothing is gained."""
        if not self._problem.only_better:
            yield from neighbourhoods(self._framed, self._walk[:HELD_CELLS], self._changed)
            return
        gainless = 0
        for number in itertools.count(STRIDE * self._problem.attempt):
            if self._is_proven():
                return
            before_us = self._cost_us
            yield spot(self._framed, self._walk, number)
            gainless = gainless + 1 if self._cost_us == before_us else 0
            if gainless * SPOT_CELLS > PASSES * len(self._walk):
                return

    def _improve(self, region: WalkRegion, place: Neighbourhood) -> Iterator[None]:
        """Improve around the changes, then perturb; pause after each piece.

        Moves at equal cost change a walk without gain, so at first none may change the cells just
        ahead of the robot.
        """
        for held in (HELD_CELLS, 0) if place.is_first else (0,):
            region.hold(held)
            region.touch_up(place.changed, self._effort.rules, self._random)
            yield
        before = region.work.proposals
        for _ in range(0, MOST_PERTURBATIONS, PERTURBATIONS_AT_ONCE):
            done = region.work.proposals - before
            if done >= self._effort.proposals or self._is_proven():
                return
            region.hold(HELD_CELLS if place.is_first and done < self._effort.held else 0)
            region.perturb(self._effort.rules, PERTURBATIONS_AT_ONCE, self._random)
            yield

    def _is_proven(self) -> bool:
        if self._bound is None:
            return False
        progress = self.progress()
        return progress.cost_s <= progress.lower_bound_cost_s

    def _unload(self) -> None:
        """Put the region that is being improved back into the walk."""
        if self._region is None:
            return
        self._walk, self._work = self._region.put_back(), self._work + self._region.work
        self._cost_us = self._problem.cost_us(self._walk, self._framed)
        self._saved_by_ants_us += self._region.saved_by_ants_us
        self._region = None

    def progress(self) -> SearchProgress:
        """Return the progress."""
        cost_us, steps, work = self._cost_us, self._walk.size - 1, self._work
        if self._region is not None:
            cost_us += self._region.gain_us
            steps += self._region.longer_by
            work += self._region.work
        return SearchProgress(work, cost_us / MICROSECONDS, steps, self._least_s)

    @property
    def _least_s(self) -> float:
        return 0.0 if self._bound is None else self._bound.cost_s

    def path(self, name: str, seed: int) -> CoveragePath:
        """Return the present walk."""
        self._unload()
        progress = self.progress()
        return CoveragePath(
            self._problem.cells_of(self._framed.unframed(self._walk)),
            planner=name,
            seed=seed,
            work=progress.work,
            cost_s=progress.cost_s,
            lower_bound_steps=0 if self._bound is None else self._bound.steps,
            lower_bound_cost_s=self._least_s,
            first_walk_s=self._first_walk_s,
            saved=self._saved(),
            trail=self._trail.changed(),
        )

    def _saved(self) -> Saved:
        saved_us = self.completed_us - self._cost_us
        return Saved.of(saved_us, self._trail.rules.velocities, self._saved_by_ants_us)


def _changed(
    framed: FramedGround, before: NDArray[np.int32], walk: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Return the new walk's cells at changed steps, int32 (n,), in its order.

    A step is changed if one of the walks takes it more often. The steps that the robot
    has driven meanwhile are not part of the old walk, so they do not count.
    """
    ground = framed.ground
    listed = np.empty(2 * (before.size + walk.size), np.int32)
    times = np.zeros((ground.bound, 2), np.int32)
    size = changed_cells(ground, before, walk, times, listed)
    place = np.full(ground.bound, -1, np.int32)
    place[walk[::-1]] = np.arange(walk.size - 1, -1, -1, dtype=np.int32)
    visits = np.unique(place[listed[:size]])
    return walk[visits[visits >= 0]]
