"""Synthetic buildings have the requested size, are connected, similar at all scales, repeatable."""

import numpy as np
import pytest

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.grids import MAP_FOOTPRINT
from tests.benchmarks import buildings
from tests.benchmarks.buildings import CORRIDOR, SOLID, TOLERANCE, building, floor_plan
from tests.benchmarks.judge import reachable


def open_sides(lattice):
    """Return the share of coverable cells that have 0, 1, 2, 3 and 4 neighbours."""
    masks = lattice.steps[lattice.coverable]
    sides = np.unpackbits(masks[:, None], axis=1).sum(axis=1)
    return np.bincount(sides, minlength=5) / len(masks)


@pytest.mark.parametrize(
    ("cells", "seeds"), [(1_000, 25), (1_777, 10), (10_000, 5), (100_000, 2), (1_000_000, 1)]
)
def test_building_has_the_cells_asked_for_and_all_can_be_reached(cells, seeds):
    for seed in range(seeds):
        grid = building(cells, seed)
        free = grid.lattice.coverable
        assert abs(np.count_nonzero(free) - cells) <= TOLERANCE * cells
        assert np.array_equal(reachable(grid.lattice.steps, grid.start), free)
        assert 0.75 < free.shape[0] / free.shape[1] < 1.35
        assert grid.name == f"building-{cells}-s{seed}"
        assert grid.lattice.cell_m == MAP_FOOTPRINT.cell_m


def test_building_is_closed_to_the_outside():
    free = building(3_000, 1).lattice.coverable
    assert not (free[0] | free[-1]).any()
    assert not (free[:, 0] | free[:, -1]).any()


def test_the_arguments_determine_the_building():
    first, again = building(5_000, 3), building(5_000, 3)
    assert np.array_equal(first.lattice.states, again.lattice.states)
    assert first.start == again.start
    for other in (building(5_000, 4), building(5_001, 3)):
        assert not np.array_equal(first.lattice.states, other.lattice.states)


@pytest.mark.parametrize("seed", range(20))
def test_corridors_are_one_and_lead_to_nearly_all_rooms(seed):
    plan = floor_plan(60 + 13 * seed, 310 - 11 * seed, np.random.default_rng(seed))
    corridors = plan == CORRIDOR
    steps = CoverageLattice.from_free(corridors).steps
    row, col = np.argwhere(corridors)[0].tolist()
    assert np.array_equal(reachable(steps, (row, col)), corridors)
    free = plan != SOLID
    reached = reachable(CoverageLattice.from_free(free).steps, (row, col))
    assert np.count_nonzero(reached) > 0.9 * np.count_nonzero(free)


def test_start_is_in_a_corridor_of_the_plan(monkeypatch):
    plans = []

    def kept(*arguments):
        plans.append(floor_plan(*arguments))
        return plans[-1]

    monkeypatch.setattr(buildings, "floor_plan", kept)
    for seed in range(10):
        grid = building(3_000, seed)
        assert plans[-1][grid.start] == CORRIDOR
        assert not (grid.lattice.coverable & (plans[-1] == SOLID)).any()


def test_large_buildings_are_like_small_ones():
    shares = [
        np.mean([open_sides(building(cells, seed).lattice) for seed in range(seeds)], axis=0)
        for cells, seeds in ((20_000, 8), (300_000, 1))
    ]
    assert np.abs(shares[0] - shares[1]).max() < 0.02
    # Real buildings at 0.3 to 0.35 m: 0 to 2 % dead ends, 2 to 13 % corners,
    # 15 to 37 % along a wall.
    for share in shares:
        assert 0.001 < share[1] < 0.02
        assert 0.03 < share[2] < 0.1
        assert 0.25 < share[3] < 0.42


def test_too_small_a_building_is_refused():
    with pytest.raises(ValueError, match="at least 1000, got 999"):
        building(999, 0)
