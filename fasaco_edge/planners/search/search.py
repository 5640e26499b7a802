"""Search by colony and local search: a complete walk at once, then better ones until stopped.

1. The first complete walk, within milliseconds, is the cheapest of some simple walks
   (``first_walks``). A completed previous walk replaces it if it costs no more; then the cells just
   ahead of the robot change only for a gain.
2. Local search improves it, region by region on a large ground.
3. Perturbations follow, each with local search: ants rebuild a disc in every other one. If turns
   cost, windows of the walk are solved again in between (``windows``), most of the time if turns
   are expensive.

The search ends when it is stopped, when the walk meets its lower bound, or after many perturbations
without gain. Its work is counted; the same counts give the same walk.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

from fasaco_edge.kernels.windows.window import LINES, PLACES
from fasaco_edge.planners.bound import GLANCE, THOROUGH, LowerBound
from fasaco_edge.planners.cost import MICROSECONDS, SearchWork
from fasaco_edge.planners.paper.baselines import first_walks
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath, Saved
from fasaco_edge.planners.planner import Observer, SearchProgress
from fasaco_edge.planners.problem import CoverageProblem, FramedGround, graph_of
from fasaco_edge.planners.search.current_walk import CurrentWalk
from fasaco_edge.planners.search.effort import effort_for
from fasaco_edge.planners.search.search_trail import SearchTrail
from fasaco_edge.planners.search.walk_region import stream_of
from fasaco_edge.planners.search.windows import WindowSearch, is_dear, pays_whole, suits
from fasaco_edge.planners.walk_before import HELD_CELLS, completed

# Proposals between two pauses: about a millisecond.
PROPOSALS_AT_ONCE = 30_000

# Perturbations of each region in a pass, with several regions.
PERTURBATIONS_IN_PASS = 8

# With several regions the search ends after this many passes without gain.
GAINLESS_PASSES = 10

# Perturbations between two evaluations of the whole walk, with one region.
PERTURBATIONS_IN_VISIT = 64

# States that windows expand in a piece of work, in about two milliseconds; number of pieces after
# each round of perturbations, with expensive turns and with cheap turns.
EXPANSIONS_AT_ONCE = 30_000
DEAR_PIECES, PIECES = 50, 5
# This many windows without gain count as one perturbation.
WINDOWS_A_PERTURBATION = 10
# Beam width for solving the whole ground: WHOLE_STATES divided by the number of cells, within the
# limits. The cheapest of four solutions, one from each corner, is kept: it is better than the
# solution of one beam that is four times as wide.
WHOLE_STATES, LEAST_BEAM, MOST_BEAM = 8_000, 8, 100
CORNERS = (0, LINES, PLACES, LINES | PLACES)

# Seed that distinguishes the random stream of local search from the ants' streams.
LOCAL_SEARCH = 1 << 32


class ColonySearch:
    """A running search: a generator that pauses; the search can be abandoned at each pause."""

    def __init__(
        self,
        name: str,
        config: ColonyConfig,
        problem: CoverageProblem,
        observe: Observer,
        *,
        has_ants: bool,
    ) -> None:
        self._began = time.perf_counter()
        self._name, self._seed = name, config.seed
        self._problem, self._observe = problem, observe
        self._graph = graph_of(problem)
        self._framed = FramedGround.of(problem)
        self._effort = effort_for(problem.cost, has_ants=has_ants)
        self._random = stream_of(config.seed, LOCAL_SEARCH)
        self._trail = SearchTrail(problem, config)
        self._walk = CurrentWalk(problem, self._framed, self._trail)
        self._first_walks = 0
        self._first_walk_s = 0.0
        # Cost of the first walk [us].
        self._first_us = 0
        self._bound: LowerBound | None = None
        self._perturbed_in_pass = 0

    def run(self) -> Iterator[None]:
        """Search to the end; pause after each piece of work."""
        yield from self._begin()
        if not self._is_proven():
            yield from self._begin_better()
        walk = self._walk
        while not self._is_proven():
            before = self._work
            yield from self._perturb()
            yield from self._solve_windows()
            most = GAINLESS_PASSES * self._perturbed_in_pass
            if walk.is_whole:
                most = self._effort.patience
            # A round did no work: the walk exceeds its memory, or lies in no region.
            if walk.since_gain >= most or self._work == before:
                return

    def progress(self) -> SearchProgress:
        """Return the progress."""
        best_us, steps = self._walk.progress()
        least_s = 0.0 if self._bound is None else self._bound.cost_s
        return SearchProgress(self._work, best_us / MICROSECONDS, steps, least_s)

    def path(self) -> CoveragePath:
        """Return the best walk."""
        self._walk.put_back()
        # A search that was stopped at once has no bound yet.
        bound = self._bound or self._tighten(GLANCE)
        return CoveragePath(
            self._problem.cells_of(self._framed.unframed(self._walk.best)),
            planner=self._name,
            seed=self._seed,
            work=self._work,
            cost_s=self._walk.best_us / MICROSECONDS,
            lower_bound_steps=bound.steps,
            lower_bound_cost_s=bound.cost_s,
            first_walk_s=self._first_walk_s,
            saved=self._saved(),
            trail=self._trail.changed(),
        )

    def _saved(self) -> Saved:
        saved_us = (self._first_us or self._walk.best_us) - self._walk.best_us
        return Saved.of(saved_us, self._trail.rules.velocities, self._walk.region.saved_by_ants_us)

    @property
    def _work(self) -> SearchWork:
        return self._walk.work + SearchWork(ants=self._first_walks)

    def _is_proven(self) -> bool:
        if self._bound is None:
            return False
        if self._walk.least_us <= self._bound.cost_us:
            return True
        cost = self._problem.cost
        only_steps = not (cost.quarter_turn_us or cost.is_priced)
        return only_steps and self.progress().steps == self._bound.steps

    def _tighten(self, work: int) -> LowerBound:
        """Improve the lower bound by this much work; return it."""
        self._bound = self._bound or LowerBound(self._problem)
        self._bound.tighten(work)
        return self._bound

    def _begin(self) -> Iterator[None]:
        for walk in first_walks(self._problem, self._graph):
            cost_us = self._problem.cost_us(walk)
            self._first_walks += 1
            if not self._first_walk_s:
                self._first_walk_s = time.perf_counter() - self._began
            if self._walk.is_empty or cost_us < self._walk.cost_us:
                self._walk.begin(self._framed.framed(walk), cost_us)
            yield
        self._offer_walk_before()
        self._first_us = self._walk.cost_us
        self._walk.allocate_region()
        self._tighten(GLANCE)

    def _offer_walk_before(self) -> None:
        """Start from the previous walk, if it costs no more than the first."""
        problem, before = self._problem, self._problem.before
        if before is None or not len(before):
            return
        walk = completed(problem, self._framed, before, HELD_CELLS)
        cost_us = problem.cost_us(walk, self._framed)
        if cost_us <= self._walk.cost_us:
            self._walk.begin(walk, cost_us)
            # With several regions, the first visits of a region are not the first of the walk.
            self._walk.held = HELD_CELLS if self._walk.is_whole else 0

    def _begin_better(self) -> Iterator[None]:
        """Improve the first walk; where turns cost enough, solve the ground as one window, too."""
        yield from self._improve()
        windows = self._window_search()
        if windows is None:
            self._tighten(THOROUGH)
        elif pays_whole(self._problem.cost) and not self._is_proven() and self._walk.load_windows():
            beam = min(max(WHOLE_STATES // self._problem.cells, LEAST_BEAM), MOST_BEAM)
            for mirrored in CORNERS:
                yield from windows.solve_whole(beam, mirrored, self._random)
            self._walk.put_back_windows()
            yield from self._solve_windows()

    def _improve(self) -> Iterator[None]:
        """Improve the whole walk, without perturbations; twice with several regions."""
        effort = self._effort
        for _ in range(1 if self._walk.is_whole else 2):
            for region in self._walk.regions():
                at_each = effort.proposals * region.best_length // len(effort.temperatures_us)
                for temperature_us in effort.temperatures_us:
                    for proposals in _pieces(at_each, PROPOSALS_AT_ONCE):
                        region.improve(temperature_us, proposals, self._random)
                        yield
                        if self._is_proven():
                            return
                region.go_back()

    def _perturb(self) -> Iterator[None]:
        """Perturb the walk in every region."""
        rules = self._effort.rules
        times = PERTURBATIONS_IN_VISIT if self._walk.is_whole else PERTURBATIONS_IN_PASS
        self._perturbed_in_pass = 0
        for region in self._walk.regions():
            proposals = rules.proposals * region.best_length
            if rules.radius >= 0:
                proposals = min(proposals, PROPOSALS_AT_ONCE // 4)
            for piece in _pieces(times, max(PROPOSALS_AT_ONCE // proposals, 1)):
                region.perturb(rules, piece, self._random)
                self._walk.since_gain += piece
                self._perturbed_in_pass += piece
                yield
                if self._is_proven():
                    return

    def _solve_windows(self) -> Iterator[None]:
        """Solve windows of the walk again, if turns cost; resume the last windows."""
        windows = None if self._is_proven() else self._window_search()
        if windows is None or not self._walk.load_windows():
            return
        solved = windows.solved
        for _ in range(DEAR_PIECES if is_dear(self._problem.cost) else PIECES):
            windows.solve(EXPANSIONS_AT_ONCE, self._random)
            yield
            if self._is_proven():
                break
        self._walk.since_gain += (windows.solved - solved) // WINDOWS_A_PERTURBATION
        self._walk.put_back_windows()

    def _window_search(self) -> WindowSearch | None:
        """Return the search in windows; None if the problem does not suit it."""
        if self._walk.windows is None and suits(self._problem):
            return self._walk.open_windows(self._tighten(THOROUGH))
        return self._walk.windows

    def show(self) -> None:
        """Show the observer the trail; the search is over."""
        self._observe(self._trail.snapshot(self._work.ants, self._walk.best.size - 1))


def _pieces(total: int, largest: int) -> Iterator[int]:
    """Yield whole numbers up to ``largest`` that add up to ``total``."""
    for begun in range(0, total, largest):
        yield min(largest, total - begun)
