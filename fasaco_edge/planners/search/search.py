"""A search by colony and local search: a walk at once, then better ones until it is stopped.

1. One or more simple walks, the cheapest kept: the first complete walk, within milliseconds
   (``first_walks``). A walk that was still to be driven is made complete, and kept if it is as
   good: then what lies just ahead of the robot changes only where something is gained.
2. Local search improves it, region by region where the ground is large.
3. Perturbations, each followed by local search, go on from there; where turns cost, windows of
   the walk are solved anew in between (``windows``), most of the time if turns are dear.
4. Where perturbations gain nothing any more, the next ants of the colony walk; the
   walk of the best of them goes through 2 and 3, and the trail is strengthened along
   the best walk of all, by equation (8): ants begin where the search has been good.

The search ends when it is stopped, when the walk meets its lower bound, when all ants
have walked, or on a large ground, where no ants restart it, when perturbations gain
nothing any more. Its work is counted; the same counts give the same walk.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from fasaco_edge.planners.bound import GLANCE, THOROUGH, LowerBound
from fasaco_edge.planners.cost import MICROSECONDS, SearchWork
from fasaco_edge.planners.paper.baselines import first_walks
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.paper.fasaco import Colony, Group, groups_of, snapshot_of
from fasaco_edge.planners.path import CoveragePath, Saved
from fasaco_edge.planners.planner import Observer, SearchProgress
from fasaco_edge.planners.problem import CoverageProblem, FramedGround, graph_of
from fasaco_edge.planners.search.effort import effort_for
from fasaco_edge.planners.search.regions import (
    EDGE,
    WalkRegion,
    is_one_region,
    regions_of,
    stream_of,
)
from fasaco_edge.planners.search.windows import WindowSearch, is_dear, suits
from fasaco_edge.planners.walk_before import HELD_CELLS, completed, has_walk

# Proposals between two pauses: about a millisecond.
PROPOSALS_AT_ONCE = 30_000

# Perturbations of a region in a pass, where there are several regions.
PERTURBATIONS_IN_PASS = 8

# Where there are several regions the search ends after so many passes without gain.
GAINLESS_PASSES = 10

# Perturbations between two looks at the whole walk, where it is one region.
PERTURBATIONS_IN_VISIT = 64

# States that windows expand between two pauses: about two milliseconds. Pauses in a round of
# windows, which follows each visit of perturbations: where turns are dear, and else.
EXPANSIONS_AT_ONCE = 30_000
DEAR_PIECES, PIECES = 50, 5
# So many windows without gain count as a perturbation.
WINDOWS_A_PERTURBATION = 10
# States that the whole ground is solved with at first, where turns are dear: so many over its
# cells, within a range; some times as many if none leads on.
WHOLE_STATES, LEAST_BEAM, MOST_BEAM, WIDER = 8_000, 8, 100, 4

# Cells that the bound solves in bands for each pause, and at once: some 3 % of the time where
# turns are dear, 10 to 20 % else.
BAND_CELLS, BAND_CELLS_AT_ONCE = 40, 256

# Visits of a walk that local search has memory for.
VISITS_PER_CELL = 4

# Distinguishes the random stream from those of the ants.
LOCAL_SEARCH = 1 << 32

# How often the walk may cross the rim of a region.
JUMPS = 8 * EDGE


# What a search restarts from where perturbations gain nothing any more: the colony's next
# ants; the same on a trail that nothing strengthens; or never.
ANTS, FLAT, NEVER = RESTARTS = ("ants", "flat", "never")


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """How ants search, and in whose name.

    Attributes:
        planner: the name that paths carry.
        colony: of the ants.
        threads: that ants walk on.
        restarts: one of ``RESTARTS``.
    """

    planner: str
    colony: ColonyConfig
    threads: int
    restarts: str


class Search:
    """A running search: a generator of pauses, at which it may be abandoned."""

    def __init__(
        self,
        settings: SearchSettings,
        problem: CoverageProblem,
        pool: ThreadPoolExecutor,
        observe: Observer,
    ) -> None:
        self._began = time.perf_counter()
        self._settings, self._problem, self._pool, self._observe = settings, problem, pool, observe
        self._graph = graph_of(problem)
        self._framed = FramedGround.of(problem)
        self._prices = self._framed.prices
        self._effort = effort_for(problem.cost)
        self._is_whole = is_one_region(self._framed.rows, self._framed.cols, problem.cells)
        self._random = stream_of(settings.colony.seed, LOCAL_SEARCH)
        self._ants = 0
        self._first_walk_s = 0.0
        # Costs of the first walk, and of the best one when ants walked for the first time.
        self._first_us = 0
        self._before_ants_us: int | None = None
        self._bound: LowerBound | None = None
        # Whether the search has begun in earnest; cells to be solved in bands for the bound.
        self._has_begun, self._owed = False, 0
        # The walk under way and the best of those before it, in framed cells.
        self._walk, self._walk_us = np.empty(0, np.int32), 0
        self._best, self._best_us = self._walk, 0
        self._since_gain = self._perturbed_in_pass = 0
        self._passes = 0
        # So many visits of the walk change only where something is gained.
        self._held = 0
        self._groups = groups_of(settings.colony, problem.cells)
        self._colony: Colony | None = None
        self._cohort, self._velocity = 0, settings.colony.velocities[0]
        self._region = WalkRegion(0, 0, 0, 0)
        self._windows: WindowSearch | None = None
        # Windows of the walk are being solved, and not put back yet.
        self._in_windows = False

    def run(self) -> Iterator[None]:
        """Search until nothing is left to do; pause after each piece of work."""
        for _ in self._search():
            if self._has_begun and self._bound is not None:
                self._owed += BAND_CELLS
                if self._owed >= BAND_CELLS_AT_ONCE:
                    self._bound.tighten_in_bands(self._owed)
                    self._owed = 0
            yield

    def _search(self) -> Iterator[None]:
        yield from self._begin()
        if not self._is_proven():
            yield from self._begin_better()
        self._has_begun = True
        may_restart = self._is_whole and self._settings.restarts != NEVER
        while not self._is_proven():
            before = self._work
            yield from self._perturb()
            yield from self._solve_windows()
            # The walk is too long for its memory, or in no region: nothing could be perturbed.
            stuck = self._work == before
            if not self._is_whole and self._since_gain >= GAINLESS_PASSES * self._perturbed_in_pass:
                return
            if stuck or (self._since_gain >= self._effort.patience and may_restart):
                group = next(self._groups, None) if may_restart else None
                if group is None:
                    return
                yield from self._restart(group)

    def progress(self) -> SearchProgress:
        """Return how far the search is.

        What a region has gained counts before it is put back; but not where turns cost, as
        the turns at its rim are known only then.
        """
        best_us, steps = self._best_us, self._best.size - 1
        exact = self._is_whole or not self._prices.quarter_turn_us
        if self._region.is_loaded and exact:
            here_us = self._walk_us + self._region.gain_us
            if here_us < best_us:
                best_us, steps = here_us, self._walk.size - 1 + self._region.longer_by
        least_s = 0.0 if self._bound is None else self._bound.cost_s
        if self._windows is not None and self._in_windows and self._windows.best_us < best_us:
            best_us, steps = self._windows.best_us, self._windows.best_steps
        return SearchProgress(self._work, best_us / MICROSECONDS, steps, least_s)

    def path(self) -> CoveragePath:
        """Return the best walk."""
        self._unload()
        self._put_back_windows()
        # A search that was stopped at once has no bound yet.
        bound = self._bound or self._tighten(GLANCE)
        return CoveragePath(
            self._problem.cells_of(self._framed.unframed(self._best)),
            planner=self._settings.planner,
            seed=self._settings.colony.seed,
            work=self._work,
            cost_s=self._best_us / MICROSECONDS,
            lower_bound_steps=bound.steps,
            lower_bound_cost_s=bound.cost_s,
            first_walk_s=self._first_walk_s,
            saved=self._saved(),
        )

    def _saved(self) -> Saved:
        first_us, last_us = self._first_us or self._best_us, self._best_us
        between_us = last_us if self._before_ants_us is None else self._before_ants_us
        return Saved(
            ants=(between_us - last_us) / MICROSECONDS,
            local_search=(first_us - between_us) / MICROSECONDS,
        )

    @property
    def _work(self) -> SearchWork:
        windows = 0 if self._windows is None else self._windows.solved
        return self._region.work + SearchWork(ants=self._ants, perturbations=windows)

    def _is_proven(self) -> bool:
        """Return whether no walk can be better."""
        if self._bound is None:
            return False
        if self._best_us <= self._bound.cost_us:
            return True
        windows = self._windows if self._in_windows else None
        if windows is not None and windows.best_us <= self._bound.cost_us:
            return True
        return not self._prices.quarter_turn_us and self.progress().steps == self._bound.steps

    def _tighten(self, work: int) -> LowerBound:
        """Return the lower bound after so much more work on it."""
        self._bound = self._bound or LowerBound(self._problem)
        self._bound.tighten(work)
        return self._bound

    def _new_region(self) -> WalkRegion:
        framed, cells = self._framed, self._problem.cells
        if self._is_whole:
            # Few cells may lie far apart: then most of the walk is between them.
            visits = max(VISITS_PER_CELL * cells, 2 * self._walk.size)
            return WalkRegion(framed.rows, framed.cols, visits, 1)
        return WalkRegion(EDGE, EDGE, VISITS_PER_CELL * EDGE * EDGE, JUMPS)

    def _begin(self) -> Iterator[None]:
        for walk in first_walks(self._problem, self._graph):
            cost_us = self._problem.cost_us(walk)
            self._ants += 1
            if not self._first_walk_s:
                self._first_walk_s = time.perf_counter() - self._began
            if not self._walk.size or cost_us < self._walk_us:
                self._walk, self._walk_us = self._framed.framed(walk), cost_us
                self._best, self._best_us = self._walk, self._walk_us
            yield
        self._offer_walk_before()
        self._first_us = self._walk_us
        self._region = self._new_region()
        self._tighten(GLANCE)

    def _offer_walk_before(self) -> None:
        """Begin with the walk that was still to be driven, if it costs no more than the first."""
        problem, before = self._problem, self._problem.before
        if before is None or not has_walk(problem):
            return
        walk = completed(problem, self._framed, before, HELD_CELLS)
        cost_us = problem.cost_us(walk)
        if cost_us <= self._walk_us:
            self._walk, self._walk_us = walk, cost_us
            self._best, self._best_us = walk, cost_us
            # Only in one region the first visits are those of the walk.
            self._held = HELD_CELLS if self._is_whole else 0

    def _regions(self) -> Iterator[None]:
        """Load each region of the next pass in turn."""
        for box in regions_of(self._framed, self._problem.cells, self._passes):
            if self._region.load(self._framed, self._walk, box):
                self._region.hold(self._held)
                yield
                self._unload()
        self._passes += 1

    def _unload(self) -> None:
        """Put the region's best walk back, if that is a gain or costs nothing."""
        if not self._region.is_loaded:
            return
        walk = self._region.put_back()
        cost_us = self._problem.cost_us(walk)
        if cost_us < self._walk_us:
            self._since_gain = 0
        if cost_us <= self._walk_us:
            self._walk, self._walk_us = walk, cost_us
        if cost_us < self._best_us:
            self._best, self._best_us = walk, cost_us

    def _begin_better(self) -> Iterator[None]:
        """Improve the first walk by moves; where turns are dear, the ground as one window, too."""
        yield from self._improve()
        windows = self._window_search()
        if windows is None:
            self._tighten(THOROUGH)
        elif is_dear(self._problem.cost) and not self._is_proven() and self._load_windows():
            beam = min(max(WHOLE_STATES // self._problem.cells, LEAST_BEAM), MOST_BEAM)
            for states in (beam, WIDER * beam):
                before_us = windows.best_us
                yield from windows.solve_whole(states, self._random)
                if windows.best_us < before_us:
                    break
            self._put_back_windows()
            yield from self._solve_windows()

    def _improve(self) -> Iterator[None]:
        """Improve the whole walk, without perturbations; twice where there are several regions."""
        effort = self._effort
        for _ in range(1 if self._is_whole else 2):
            for _ in self._regions():
                at_each = effort.proposals * self._region.best_length // len(effort.temperatures_us)
                for temperature_us in effort.temperatures_us:
                    for proposals in _pieces(at_each, PROPOSALS_AT_ONCE):
                        self._region.improve(temperature_us, proposals, self._random)
                        yield
                        if self._is_proven():
                            return
                self._region.go_back()

    def _perturb(self) -> Iterator[None]:
        """Perturb the walk in every region."""
        rules = self._effort.rules
        times = PERTURBATIONS_IN_VISIT if self._is_whole else PERTURBATIONS_IN_PASS
        self._perturbed_in_pass = 0
        for _ in self._regions():
            proposals = rules.proposals * self._region.best_length
            if rules.radius >= 0:
                proposals = min(proposals, PROPOSALS_AT_ONCE // 4)
            for piece in _pieces(times, max(PROPOSALS_AT_ONCE // proposals, 1)):
                self._region.perturb(rules, piece, self._random)
                self._since_gain += piece
                self._perturbed_in_pass += piece
                yield
                if self._is_proven():
                    return

    def _solve_windows(self) -> Iterator[None]:
        """Solve windows of the walk anew, if turns cost; continue where they were left."""
        windows = None if self._is_proven() else self._window_search()
        if windows is None or not self._load_windows():
            return
        solved = windows.solved
        for _ in range(DEAR_PIECES if is_dear(self._problem.cost) else PIECES):
            windows.solve(EXPANSIONS_AT_ONCE, self._random)
            yield
            if self._is_proven():
                break
        self._since_gain += (windows.solved - solved) // WINDOWS_A_PERTURBATION
        self._put_back_windows()

    def _window_search(self) -> WindowSearch | None:
        """Return the search in windows; None where there can be none."""
        if self._windows is None and suits(self._problem):
            self._windows = WindowSearch(self._problem, self._framed, self._tighten(THOROUGH))
        return self._windows

    def _load_windows(self) -> bool:
        """Let windows continue from the walk, or where they were left; return whether they can."""
        self._in_windows = self._windows is not None and self._windows.load(self._walk)
        return self._in_windows

    def _put_back_windows(self) -> None:
        """Take the best walk of the windows over, if it is better."""
        if self._windows is None or not self._in_windows:
            return
        self._in_windows = False
        cost_us = self._windows.best_us
        if cost_us >= self._walk_us:
            return
        self._walk, self._walk_us = self._windows.walk(), cost_us
        self._since_gain = 0
        if cost_us < self._best_us:
            self._best, self._best_us = self._walk, cost_us

    def _restart(self, group: Group) -> Iterator[None]:
        """Let the next ants walk, on a trail strengthened along the best walk; improve theirs."""
        colony = self._colony_of_ants()
        if self._before_ants_us is None:
            self._before_ants_us = self._best_us
        if self._settings.restarts == ANTS:
            self._strengthen(colony)
        walk, self._walk_us = colony.walk(group.velocity, group.streams)
        self._walk = self._framed.framed(walk)
        self._ants += len(group.streams)
        self._since_gain = self._held = 0
        self._cohort, self._velocity = group.cohort, group.velocity
        yield
        yield from self._improve()

    def show(self) -> None:
        """Offer the trail to the observer, strengthened along the best walk; the search is over."""
        colony = self._colony_of_ants()
        self._strengthen(colony)
        steps = self._best.size - 1
        cohort, velocity = self._cohort, self._velocity
        self._observe(snapshot_of(self._problem, colony.trail, cohort, velocity, self._ants, steps))

    def _colony_of_ants(self) -> Colony:
        if self._colony is None:
            self._colony = Colony(
                self._settings.colony,
                self._problem,
                self._graph,
                self._pool,
                self._settings.threads,
            )
        return self._colony

    def _strengthen(self, colony: Colony) -> None:
        colony.offer(self._framed.unframed(self._best), self._best_us)
        colony.strengthen()


def _pieces(total: int, largest: int) -> Iterator[int]:
    """Yield whole numbers up to ``largest`` that add up to ``total``."""
    for begun in range(0, total, largest):
        yield min(largest, total - begun)
