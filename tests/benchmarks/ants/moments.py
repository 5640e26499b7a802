"""Moments of missions: problems that their planner was asked to solve, answered again.

A mission in an unknown building asks for repairs, and in spare time for a better path. Each of
these problems is answered by ants on the mission's living trail, on a new trail (uniform at first),
on a flat one (never changed), and without ants. So are searches of very large known buildings,
where, as in repairs, no windows are solved by dynamic programming; and a colony's walk over a known
building is compared with the simple walks that a search begins with.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.mission.events import PlanReady, PlanRequest
from fasaco_edge.mission.path.plan_requests import (
    LEAST_SHARE,
    LEAST_STEPS,
    NEW_WALK_SHARE,
    most_s,
)
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.cost import MICROSECONDS, CoverageCost, SearchWork
from fasaco_edge.planners.grids import NamedGrid
from fasaco_edge.planners.paper.baselines import first_walks
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import StoppingCriterion, WorkLimit, ignore, never
from fasaco_edge.planners.problem import CoverageProblem, graph_of
from fasaco_edge.planners.registry import planner_of
from tests.benchmarks.buildings import building
from tests.benchmarks.harness import ProcessorBudget, check_covered, grid_name, planner_for
from tests.benchmarks.online.buildings import Building, BuildingChoice
from tests.benchmarks.online.mission import Conditions, OnlineMission
from tests.benchmarks.online.robot import Pace

# Windows take memory for each cell of a lattice: one of this many cells is searched without them.
LARGE_CELLS = 260_000
RANGE_M, SPARE_SHARE = 3.0, 0.05
PACE = Pace(speed_m_s=0.25, turn_s=1.5)
# Time that a repair is said to take, and proposals of each plan, in a mission that is recorded: it
# is to be the same on every machine.
REPAIR_S, PROPOSALS = 0.01, 1_000_000
# Seeds of answers; those of recorded missions are smaller.
FIRST_SEED = 100

REPAIR, SPOT, REST, LARGE = KINDS = (
    "repair", "attempt around a spot", "attempt at the rest", "very large lattice",
)  # fmt: skip
FIRST = "first walk"
LIVING, NEW, FLAT, NONE = VARIANTS = "living", "new", "flat", "none"
# Of first walks: price of a quarter-turn [steps], the colony, and processor time of searches that
# begin with them, the colony's included [s].
FIRST_TURN, FIRST_ANTS, FIRST_Q0 = 5.0, 64, 0.9
FIRST_BUDGETS_S = (0.02, 0.05, 0.2, 1.0)


@dataclass(frozen=True, slots=True)
class MomentsPlan:
    """What to record, and how to answer it.

    Attributes:
        choice: buildings of missions.
        missions: in each building, from different starts.
        most: of each building and kind, this many moments at most.
        seeds: answers of each variant to each moment.
        with_turns: whether turns cost.
        large: searches of very large buildings.
        large_s: processor time of each [s].
        first: grids to compare first walks on, in place of missions.
    """

    choice: BuildingChoice
    missions: int
    most: dict[str, int]
    seeds: int
    with_turns: bool
    large: int
    large_s: float
    first: Sequence[NamedGrid]


class Moment(NamedTuple):
    """A problem that a planner had to solve, of one of ``KINDS``, and the building's name."""

    place: str
    kind: str
    problem: CoverageProblem


@dataclass(frozen=True, slots=True)
class Answer:
    """One plan.

    Attributes:
        cost_s: cost of the walk ahead; if an attempt found no better one, of the present walk [s].
        saved_s: what an attempt saves on the present walk [s].
        taken_s: the same; 0 if a mission would keep its path [s].
        by_ants_s, by_search_s: savings by ants and by local search, see ``Saved`` [s].
        ants, proposals: its work.
        processor_s: its processor time [s].
    """

    cost_s: float
    saved_s: float = 0.0
    taken_s: float = 0.0
    by_ants_s: float = 0.0
    by_search_s: float = 0.0
    ants: int = 0
    proposals: int = 0
    processor_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Replay:
    """A moment answered by each variant with one seed."""

    place: str
    kind: str
    seed: int
    answers: dict[str, Answer]


def measure(plan: MomentsPlan, say: Say) -> Generator[Replay, None, None]:
    """Yield each moment with its answers, once for each seed."""
    warm_up()
    for grid, seed in itertools.product(plan.first, range(FIRST_SEED, FIRST_SEED + plan.seeds)):
        say(f"{grid_name(grid.name)}: first walks")
        yield from _first_walks(grid, seed)
    for moment in _moments(plan, say):
        budget_s = plan.large_s if moment.kind == LARGE else most_s(moment.problem)
        variants = variants_of(moment.kind)
        for seed in range(FIRST_SEED, FIRST_SEED + plan.seeds):
            answers = {one: _answer(moment, one, seed, budget_s) for one in variants}
            yield Replay(moment.place, moment.kind, seed, answers)


def variants_of(kind: str) -> Sequence[str]:
    """Return the variants of a kind: a known building has no living trail."""
    if kind.startswith(FIRST):
        return NEW, NONE
    return VARIANTS[1:] if kind == LARGE else VARIANTS


def _first_walks(grid: NamedGrid, seed: int) -> Iterator[Replay]:
    """Yield a first walk by ants, and searches from it, with those of simple walks."""
    place, price = grid_name(grid.name), CoverageCost(1.0, FIRST_TURN)
    problem = CoverageProblem.of(grid.lattice, grid.start, cost=price)
    began = time.process_time()  # the colony walks in a thread of its own
    colony = planner_of("fasaco", ColonyConfig(ants=FIRST_ANTS, q0=FIRST_Q0, seed=seed))
    by_ants = colony.plan(problem, never, ignore)
    took_s = time.process_time() - began
    simple_s = min(map(problem.cost_us, first_walks(problem, graph_of(problem)))) / MICROSECONDS
    begun = replace(problem, before=by_ants.cells, is_full=True)
    answers = {NEW: _of(problem, by_ants, took_s), NONE: Answer(cost_s=simple_s)}
    yield Replay(place, FIRST, seed, answers)
    for budget_s in FIRST_BUDGETS_S:
        answers = {}
        for one, posed, left_s in ((NEW, begun, budget_s - took_s), (NONE, problem, budget_s)):
            path = planner_for(seed).plan(posed, ProcessorBudget(left_s))
            answers[one] = _of(problem, path, budget_s)
        yield Replay(place, f"{FIRST}, after {budget_s:g} s", seed, answers)


def _moments(plan: MomentsPlan, say: Say) -> Iterator[Moment]:
    for place in plan.choice.buildings():
        moments: list[Moment] = []
        for seed in range(plan.missions):
            say(f"{place.name}: mission {seed + 1}")
            moments += _recorded(place, seed, with_turns=plan.with_turns)
        for kind, most in plan.most.items():
            say(f"{place.name}: {kind}")
            found = [moment for moment in moments if moment.kind == kind]
            yield from found[:: max(-(-len(found) // most), 1)]
    for seed in range(plan.large):
        grid = building(LARGE_CELLS, seed)
        say(grid.name)
        cost = PACE.cost(grid.lattice.cell_m, with_turns=plan.with_turns)
        yield Moment(grid.name, LARGE, CoverageProblem.of(grid.lattice, grid.start, cost=cost))


def _recorded(place: Building, seed: int, *, with_turns: bool) -> list[Moment]:
    """Return the moments of a mission."""
    recorder = _Recorder(place.name, seed)
    cost = PACE.cost(place.footprint.cell_m, with_turns=with_turns)
    conditions = Conditions(RANGE_M, PACE, cost, recorder, spare_share=SPARE_SHARE)
    OnlineMission(place.started_at(seed), conditions).run()
    return recorder.moments


@dataclass(slots=True)
class _Recorder:
    """Planner of a mission that keeps each problem but those without a walk before."""

    place: str
    seed: int
    moments: list[Moment] = field(default_factory=list)

    def __call__(self, request: PlanRequest) -> PlanReady:
        problem, seconds, kind = request.problem, REPAIR_S, REPAIR
        if problem.only_better:
            seconds, kind = most_s(problem), REST if problem.is_full else SPOT
        if problem.only_better or problem.can_repair:
            self.moments.append(Moment(self.place, kind, problem))
        limit = WorkLimit(SearchWork(proposals=PROPOSALS))
        return PlanReady(request.number, planner_for(self.seed).plan(problem, limit), seconds)


def _answer(moment: Moment, variant: str, seed: int, budget_s: float) -> Answer:
    posed = moment.problem
    problem = posed if variant == LIVING else replace(posed, trail=None)
    planner = planner_for(seed, variant)
    # A repair ends by itself, after as many proposals with and without ants.
    stop: StoppingCriterion = WorkLimit(SearchWork(proposals=PROPOSALS))
    began = time.thread_time()
    if moment.kind != REPAIR:
        stop = ProcessorBudget(budget_s)
    path = planner.plan(problem, stop)
    processor_s = time.thread_time() - began
    whole = posed.whole or posed
    answer = _of(whole, path, processor_s)
    if not posed.only_better:
        return answer
    assert whole.before is not None
    before_s = whole.price_us(whole.before) / MICROSECONDS
    saved_s = max(before_s - answer.cost_s, 0.0)
    share = NEW_WALK_SHARE if posed.is_full else LEAST_SHARE
    is_taken = saved_s >= max(LEAST_STEPS * whole.cost.step_s, share * before_s)
    return replace(
        answer,
        cost_s=before_s - saved_s,
        saved_s=saved_s,
        taken_s=saved_s if is_taken else 0.0,
    )


def _of(problem: CoverageProblem, path: CoveragePath, processor_s: float) -> Answer:
    check_covered(problem, path.cells)
    return Answer(
        cost_s=problem.price_us(path.cells) / MICROSECONDS,
        by_ants_s=path.saved.ants,
        by_search_s=path.saved.local_search,
        ants=path.work.ants,
        proposals=path.work.proposals,
        processor_s=processor_s,
    )
