"""Missions in every building, from several starts, with several ranges and seeds, each judged."""

from __future__ import annotations

import itertools
from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.grids import MAP_FOOTPRINT, NamedGrid
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.harness import judged as judged_plan
from tests.benchmarks.online.buildings import Building, BuildingChoice, of_grid
from tests.benchmarks.online.contenders import DAEMON
from tests.benchmarks.online.judge import MissionRun, Reference, judged
from tests.benchmarks.online.mission import Conditions, CountedPlanning, OnlineMission, near_optimal
from tests.benchmarks.online.robot import Pace

# Full plans that are timed for each start.
FULL_PLANS = 3


@dataclass(frozen=True, slots=True)
class OnlinePlan:
    """What to measure: every combination.

    Attributes:
        choice: of buildings.
        starts: how many in each building.
        ranges_m: reaches of the scanner [m].
        seeds: how many, from 0 on, of the planner.
        pace: of the robot.
        with_turns: whether its walks are to take little time, or few steps alone.
        proposals: budget of a plan.
        planners: names of CONTENDERS.
    """

    choice: BuildingChoice
    starts: int
    ranges_m: tuple[float, ...]
    seeds: int
    pace: Pace
    with_turns: bool
    proposals: int
    planners: tuple[str, ...] = (DAEMON,)


def count(plan: OnlinePlan) -> int:
    """Return how many missions ``measure`` will yield."""
    choice = plan.choice
    buildings = len(choice.grids) + choice.generated
    return plan.seeds * len(plan.planners) * buildings * plan.starts * len(plan.ranges_m)


def measure(plan: OnlinePlan, say: Say) -> Generator[MissionRun, None, None]:
    """Yield every mission, kernels warm; each seed goes over all buildings before the next does.

    Raises:
        FasacoError: a building cannot be read, or a robot cannot go anywhere in it.
        WrongWalkError: a reference walk is not legal or not complete.
    """
    buildings = list(plan.choice.buildings())
    for building in buildings:
        if np.count_nonzero(building.reachable) < 2:
            raise BadConfiguration(f"{building.name}: there is nowhere to go from its start")
    say("loading kernels")
    warm_up()
    room = NamedGrid("room", CoverageLattice.from_free(np.ones((4, 5), bool)), (0, 0))
    for planner in plan.planners:
        warming = replace(plan, proposals=1, planners=(planner,))
        _run(warming, of_grid(room, MAP_FOOTPRINT.cell_m), 1.0, 0, None)
    references: dict[tuple[str, Cell], Reference] = {}
    for planner, seed in itertools.product(plan.planners, range(plan.seeds)):
        one = replace(plan, planners=(planner,))
        for building, number in itertools.product(buildings, range(plan.starts)):
            started = building.started_at(number)
            key = started.name, started.start
            if key not in references:
                say(f"{started.name}: reference")
                references[key] = _reference(plan, started)
            for range_m in plan.ranges_m:
                say(f"{planner}, seed {seed}: {started.name}, start {number}, {range_m:g} m")
                yield _run(one, started, range_m, seed, references[key])


def _reference(plan: OnlinePlan, building: Building) -> Reference:
    cost = plan.pace.cost(building.footprint.cell_m, with_turns=plan.with_turns)
    problem = CoverageProblem.of(building.lattice, building.start, cost=cost)
    verdict = judged_plan(problem, near_optimal(problem))
    planning = CountedPlanning(0, plan.proposals)
    metres = verdict.steps * building.footprint.cell_m
    return Reference(
        steps=verdict.steps,
        time_s=plan.pace.seconds(metres, verdict.turns_90 + 2 * verdict.turns_180),
        full_plan=sorted(planning.timed(problem)[1] for _ in range(FULL_PLANS))[FULL_PLANS // 2],
    )


def _run(
    plan: OnlinePlan,
    building: Building,
    range_m: float,
    seed: int,
    reference: Reference | None,
) -> MissionRun:
    (planner,) = plan.planners
    conditions = Conditions(
        range_m=range_m,
        pace=plan.pace,
        cost=plan.pace.cost(building.footprint.cell_m, with_turns=plan.with_turns),
        seat=CountedPlanning(seed, plan.proposals, planner),
    )
    mission = OnlineMission(building, conditions)
    mission.run()
    verdict, watch = judged(mission), mission.watch
    return MissionRun(
        building=building.name,
        cells=verdict.cells,
        start=building.start,
        range_m=range_m,
        seed=seed,
        ended=mission.state,
        done=mission.done,
        missed=verdict.missed,
        problems=(*verdict.problems, *dict.fromkeys(watch.faults)),
        steps=verdict.steps,
        revisits=verdict.revisits,
        quarters=verdict.quarters,
        time_s=mission.now,
        waiting_s=watch.waiting_s,
        reference=reference,
        reached=verdict.reached,
        plans=watch.requests,
        paths=watch.paths,
        held_up=watch.held_up,
        stale_m=watch.stale_m,
        replans=tuple(watch.replans),
        ingests=tuple(watch.ingests),
        kept=tuple(watch.kept),
        updates=tuple(watch.updates),
        planner=planner,
    )
