"""Lower bounds of steps and turns against least costs, on small grounds by the hundred thousand.

    python -m tests.campaigns.turn_bound --grounds 100000

Takes minutes.

Each ground has thin walls, cells that need no visit, an end or none, and prices from turns that
are nearly free to those that are nearly all. What a best walk costs is found by dynamic
programming over sets of cells, which shares nothing with the planners. Exit code 1 if a bound is
above it.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.bound import MOST, LowerBound
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.problem import CoverageProblem
from tests import naive
from tests.support.grids import with_passages_closed

Cell = tuple[int, int]

PLENTY: Final = 10**15
HEADINGS = ((0, 1), (1, 0), (0, -1), (-1, 0))
# Cells that a best walk is looked for over: each one more doubles the work.
MOST_REQUIRED = 8
PRICES = ((1.0, 0.001), (1.0, 0.3), (1.2, 1.5), (1.0, 5.0), (1.0, 50.0), (0.123457, 0.765433))


@dataclass(frozen=True)
class Finding:
    """A ground, what a best walk over it costs [us], and the bounds met on the way."""

    problem: CoverageProblem
    least_us: int
    bounds_us: list[int]


def examine(random: np.random.Generator) -> Finding:
    """Draw a ground; return the bounds after an iteration or two, and after many."""
    problem = drawn_problem(random)
    bound = LowerBound(problem)
    bounds = [bound.cost_us]
    for iterations in (1, 20, MOST):
        bound.tighten(iterations * problem.lattice.states.size)
        bounds.append(bound.cost_us)
    return Finding(problem, least_cost_us(problem), bounds)


def drawn_problem(random: np.random.Generator) -> CoverageProblem:
    """Draw a lattice of up to 5 x 6 cells, some of them to be covered, a start, an end, prices."""
    floor = random.random(random.integers(1, (6, 7))) < random.choice((1.0, 0.85, 0.7))
    start = tuple(int(random.integers(size)) for size in floor.shape)
    floor[start] = True
    ground = CoverageLattice.from_free(floor)
    ground = with_passages_closed(ground, random.choice((0.0, 0.0, 0.2)), random)
    reachable = sorted(naive.distances(ground.steps, start))
    count = int(random.integers(1, MOST_REQUIRED + 1))
    if len(reachable) <= MOST_REQUIRED:
        count = len(reachable)
    chosen = {reachable[i] for i in random.permutation(len(reachable))[:count]}
    covered = np.ones(floor.shape, bool)
    for cell in chosen:
        covered[cell] = False
    end = {0: None, 1: start}.get(
        int(random.integers(3)), reachable[int(random.integers(len(reachable)))]
    )
    cost = CoverageCost(*PRICES[int(random.integers(len(PRICES)))])
    return CoverageProblem.of(ground, start, covered=covered, end=end, cost=cost)


def least_cost_us(problem: CoverageProblem) -> int:
    """Return what a best walk costs [us]: Held and Karp, 1962, over cells and headings."""
    around = naive.neighbours(problem.lattice.steps)
    start = problem.start
    cells = sorted(naive.distances(problem.lattice.steps, start))
    between, first = _ways(around, cells, start, problem.cost)
    required = [cells.index(tuple(cell)) for cell in np.argwhere(problem.to_cover).tolist()]
    required = [cell for cell in required if cells[cell] != start]
    states = np.array([[4 * cell + heading for heading in range(4)] for cell in required], int)
    states = states.reshape(-1)
    count = len(required)
    arrived = np.full((1 << count, 4 * count), PLENTY)
    for index in range(count):
        here = slice(4 * index, 4 * index + 4)
        arrived[1 << index, here] = first[states[here]]
    for done, index in product(range(1, 1 << count), range(count)):
        if not done >> index & 1:
            here = slice(4 * index, 4 * index + 4)
            ways = arrived[done][:, None] + between[np.ix_(states, states[here])]
            after = arrived[done | 1 << index, here]
            arrived[done | 1 << index, here] = np.minimum(after, ways.min(axis=0))
    if problem.end is None:
        return int(arrived[-1].min()) if count else 0
    there = 4 * cells.index(problem.end) + np.arange(4)
    if not count:
        return 0 if problem.end == start else int(first[there].min())
    return int((arrived[-1][:, None] + between[np.ix_(states, there)]).min())


def _ways(
    around: dict[Cell, dict[Cell, Cell]], cells: list[Cell], start: Cell, cost: CoverageCost
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return what ways cost between states ``4 * cell + heading``, and to each from the start."""
    size = 4 * len(cells)
    between = np.full((size, size), PLENTY)
    begun = np.full(size, PLENTY)
    number = {cell: index for index, cell in enumerate(cells)}
    for cell in cells:
        for leaving, move in enumerate(HEADINGS):
            after = around[cell].get(move)
            if after is None:
                continue
            there = 4 * number[after] + leaving
            for heading in range(4):
                quarters = (0, 1, 2, 1)[(leaving - heading) % 4]
                between[4 * number[cell] + heading, there] = (
                    cost.step_us + quarters * cost.quarter_turn_us
                )
            if cell == start:
                begun[there] = cost.step_us
    np.fill_diagonal(between, 0)
    for via in range(size):
        between = np.minimum(between, between[:, via, None] + between[via])
    return between, (begun[:, None] + between).min(axis=0)


def main() -> int:
    """Examine so many grounds; print how close the bounds come, and each that is too high."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--grounds", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    random = np.random.default_rng(args.seed)
    shares, wrong = [], 0
    for number in range(args.grounds):
        found = examine(random)
        if found.least_us:
            shares.append(found.bounds_us[-1] / found.least_us)
        if found.bounds_us != sorted(found.bounds_us) or found.bounds_us[-1] > found.least_us:
            wrong += 1
            print(f"ground {number}: bounds {found.bounds_us}, least cost {found.least_us} us")
    print(
        f"{args.grounds} grounds, {wrong} bounds above the least cost; in the mean "
        f"{np.mean(shares):.4f} of it, at least {min(shares):.4f}, "
        f"all of it on {np.mean(np.array(shares) == 1.0):.1%}"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
