"""A search may be stopped anywhere: its walk is sound, and its work repeats it bit for bit."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.local_search.walk_array import FRAME
from fasaco_edge.planners.cost import (
    COLUMNS,
    ROWS,
    STEPS_ALONE,
    CoverageCost,
    SearchWork,
    steps_in_rows,
)
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import AnyOf, WorkLimit, never
from fasaco_edge.planners.problem import CoverageProblem, FramedGround
from fasaco_edge.planners.search import regions
from fasaco_edge.planners.search.effort import effort_for
from fasaco_edge.planners.search.near_optimal import NearOptimal
from tests.benchmarks.buildings import building
from tests.planners.searches import FEW_ANTS, TURNS, Watched, after, hall, looks, plan, take_apart
from tests.support.examples import examples
from tests.support.grids import ENDS, ROOMS, end_of, problems


@examples(100)
@given(
    ground=problems(max_side=12),
    end=ENDS,
    cost=st.sampled_from((STEPS_ALONE, TURNS, CoverageCost(0.001, 3600.0), CoverageCost(3600, 0))),
    covered=st.sampled_from((0.0, 0.3, 0.9)),
    looked=st.integers(1, 40),
    seed=st.integers(0, 2**63 - 1),
)
def test_a_search_stopped_anywhere_is_valid_and_reproducible(
    ground, end, cost, covered, looked, seed
):
    ground, start = ground
    done = np.random.default_rng(seed).random(ground.states.shape) < covered
    done[ground.local(start)] = False
    problem = CoverageProblem.of(
        ground, start, covered=done, end=end_of(end, ground, start), cost=cost
    )
    config = ColonyConfig(ants=4, velocities=(2, 1), seed=seed)
    path = plan(problem, AnyOf(looks(looked), after(perturbations=500)), config)
    assert_repeats(problem, path, config)


def assert_repeats(problem, path, config):
    again = plan(problem, WorkLimit(path.work), config)
    assert again.cells.tobytes() == path.cells.tobytes()
    assert again.work == path.work
    assert again.cost_s == path.cost_s


# With turns the search of the largest room takes as long as all others.
@pytest.mark.parametrize(
    ("room", "cost"),
    [each for each in product(ROOMS, (STEPS_ALONE, TURNS)) if each != ("rooms", TURNS)],
)
def test_a_search_ends_by_itself_and_that_repeats_too(room, cost):
    ground, start = ROOMS[room]
    problem = CoverageProblem.of(ground, start, end=start, cost=cost)
    watched = Watched(never)
    path = plan(problem, watched)
    watched.assert_steady()
    # Proven to be the best, or nothing was gained for long.
    assert (
        path.work.perturbations >= effort_for(cost).patience or path.steps == path.lower_bound_steps
    )
    assert_repeats(problem, path, FEW_ANTS)


@examples(60)
@given(rows=st.integers(1, 200), cols=st.integers(1, 200), number=st.integers(0, 5))
def test_each_cell_is_of_one_region_and_that_fits_into_memory(rows, cols, number):
    problem = CoverageProblem.of(CoverageLattice.from_free(np.ones((rows, cols), bool)), (0, 0))
    framed = FramedGround.of(problem)
    for cells in (regions.ONE_REGION, regions.ONE_REGION + 1):
        held = np.zeros((rows + 2 * FRAME, framed.width), int)
        boxes = list(regions.regions_of(framed, cells, number))
        for box in boxes:
            inside = np.s_[box.row : box.row + box.rows, box.col : box.col + box.cols]
            held[inside] += box.labels.reshape(held.shape)[inside] == box.label
            assert max(box.rows, box.cols) <= regions.EDGE or len(boxes) == 1
        assert (held[FRAME:-FRAME, FRAME:-FRAME] == 1).all()
        assert held.sum() == rows * cols
    walk = np.arange(rows * cols, dtype=np.int32)
    assert framed.unframed(framed.framed(walk)).tolist() == walk.tolist()
    assert (framed.ground.needed[framed.framed(walk)] == 1).all()
    assert framed.ground.needed.sum() == walk.size


# A long search gains much; that it ends as it should where it should end, short ones show, too.
@pytest.mark.parametrize(
    ("looked", "covered", "home"),
    [*product((1, 7, 100), (0.0, 0.7), (False, True)), (1500, 0.7, True)],
)
@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS], ids=["steps", "turns"])
def test_in_regions_it_is_as_sound_and_as_repeatable(monkeypatch, looked, cost, covered, home):
    take_apart(monkeypatch)
    config = ColonyConfig(ants=8, velocities=(1,), seed=1)
    problem = hall(home, cost, covered, cells=2_600)
    watched = Watched(looks(looked))
    path = plan(problem, watched, config)
    assert len(watched.seen) == looked
    watched.assert_steady()
    assert path.cost_s <= watched.seen[-1].cost_s
    if not cost.quarter_turn_us:
        # What was gained in the region it was stopped in was known before.
        assert path.cost_s == watched.seen[-1].cost_s
    assert_repeats(problem, path, config)
    if looked == 1500:
        assert path.cost_s < 0.95 * watched.seen[0].cost_s


@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS], ids=["steps", "turns"])
def test_it_is_asked_often_whether_to_stop(cost):
    """Counted in proposals, of which a millisecond has some thirty thousand."""
    grid = building(5_000, 1)
    problem = CoverageProblem.of(grid.lattice, grid.start, cost=cost)
    watched = Watched(after(perturbations=20))
    plan(problem, watched)
    done = [progress.work.proposals for progress in watched.seen]
    assert max(np.diff(done)) <= 200_000
    assert len(watched.seen) > 30


def test_an_observer_sees_the_trail_and_changes_nothing():
    problem, seen = CoverageProblem.of(*ROOMS["rooms"]), []
    config = ColonyConfig(ants=32, seed=2)
    path = NearOptimal(config).plan(problem, after(perturbations=40), seen.append)
    assert path.cells.tobytes() == plan(problem, after(perturbations=40), config).cells.tobytes()
    (snapshot,) = seen
    assert snapshot.best_steps == path.steps
    assert snapshot.ants == path.work.ants
    walked = tuple(path.cells[1:-1].T)
    assert snapshot.trail[walked].min() > config.tau0


@pytest.mark.parametrize("lanes", [ROWS, COLUMNS])
def test_lanes_run_in_the_direction_that_is_preferred(lanes):
    """On an open floor; what the path says it costs are its seconds."""
    ground = CoverageLattice.from_free(np.ones((14, 14), bool))
    cost = CoverageCost(1.0, 1.25)
    for start in ((0, 0), (7, 6)):
        problem = CoverageProblem.of(ground, start, cost=cost.along(lanes))
        path = NearOptimal().plan(problem, WorkLimit(SearchWork(proposals=400_000)))
        rows = steps_in_rows(path.cells)
        along = rows if lanes == ROWS else path.steps - rows
        assert along >= 0.85 * path.steps
        assert path.cost_s == cost.of_walk(path.cells)
        assert path.lower_bound_cost_s <= path.cost_s


def test_lanes_keep_their_direction_if_turns_are_free():
    """The walk of the fewest steps is known at once; that it runs along lanes is not."""
    ground = CoverageLattice.from_free(np.ones((10, 10), bool))
    problem = CoverageProblem.of(ground, (0, 0), cost=CoverageCost().along(COLUMNS))
    path = NearOptimal().plan(problem, WorkLimit(SearchWork(proposals=200_000)))
    assert path.steps == path.cost_s == 99
    assert steps_in_rows(path.cells) == 9


def test_a_room_is_finished_before_the_next():
    """Three rooms that are open to each other all along: without the price lanes run through."""
    ground = CoverageLattice.from_free(np.ones((9, 18), bool))
    rooms = np.tile(1 + np.arange(18, dtype=np.uint16) // 6, (9, 1))
    cost, paths = CoverageCost(1.0, 1.25), {}
    for room_s in (0.0, 40.0):
        problem = CoverageProblem.of(ground, (0, 0), cost=replace(cost, room_s=room_s))
        problem = replace(problem, rooms=rooms)
        path = plan(problem, WorkLimit(SearchWork(proposals=400_000)))
        assert path.cost_s == cost.of_walk(path.cells)
        paths[room_s] = path
        assert problem.price_us(path.cells) - cost.of_walk_us(path.cells) == round(
            1e6 * room_s
        ) * crossings(rooms, path)
    assert crossings(rooms, paths[40.0]) == 2
    assert crossings(rooms, paths[0.0]) > 2
    free = plan(CoverageProblem.of(ground, (0, 0), cost=cost), WorkLimit(paths[0.0].work))
    assert free.cells.tobytes() == paths[0.0].cells.tobytes()


def crossings(rooms, path):
    return int(np.count_nonzero(np.diff(rooms[tuple(path.cells.T)].astype(int))))
