"""Warm-up: compile, or load from the cache, every kernel that a mission uses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.floor import Floor, RobotDiscs, StandLattice
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint, pixels_of, placement_on
from fasaco_edge.grid.occupancy import OCCUPIED, OccupancyGrid
from fasaco_edge.kernels.jit import note_all_compiled
from fasaco_edge.kernels.lattice.areas import cells_beside, find_areas
from fasaco_edge.kernels.lattice.pixels import count_free_beside
from fasaco_edge.kernels.lattice.polygons import add_near, count_in, turn_inside
from fasaco_edge.kernels.lattice.reach import update_reach
from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.line import LineConfig, line_over
from fasaco_edge.planners.near_optimal import NearOptimal
from fasaco_edge.planners.path import walk_figures
from fasaco_edge.planners.planner import SearchProgress, ignore, never
from fasaco_edge.planners.problem import CoverageProblem, lower_bound_steps
from fasaco_edge.planners.registry import PLANNER_NAMES, planner_of
from fasaco_edge.planners.repair import repaired

LATTICE, CHANGES, REACH, AREAS = "lattice", "changes of the map", "reachability", "areas"
WALKS, BOUND = "shortest walks", "lower bound"
LOCAL_SEARCH, REPAIR, LINE = "local search", "repair", "driven line"
STAGES = (
    *(LATTICE, CHANGES, REACH, AREAS, WALKS, BOUND, LOCAL_SEARCH, REPAIR, LINE),
    *PLANNER_NAMES,
)


def warm_up(report: Callable[[str], None] | None = None) -> None:
    """Run every kernel once on a tiny map; ``report`` gets each stage's name first."""
    for stage in _stages():
        if report is not None:
            report(stage)
    note_all_compiled()


def _stages() -> Iterator[str]:
    yield LATTICE
    # Read-only, as maps off the bus are: numba compiles for that apart.
    cells = np.zeros((4, 4), np.int8)
    grid = OccupancyGrid(GridGeometry(4, 4, 1.0, Pose2D(0.0, 0.0)), cells)
    footprint = Footprint(cell_m=1.0, robot_radius_m=0.4)
    lattice = CoverageLattice.from_map(grid, footprint)
    yield CHANGES
    _take_changes_in(grid, lattice, footprint)
    yield REACH
    problem = CoverageProblem.of(lattice, (0, 0))
    yield AREAS
    _take_areas(lattice)
    yield WALKS
    walk_figures(lattice, np.array([[0, 0], [0, 1]], np.int32))
    yield BOUND
    lower_bound_steps(problem)
    yield LOCAL_SEARCH
    # Turns at a price: no walk is proven to be the best, so the search perturbs it.
    costly = CoverageProblem.of(lattice, (0, 0), cost=CoverageCost(1.0, 1.0))
    path = NearOptimal(ColonyConfig(ants=1, velocities=(1,))).plan(costly, _perturbed, ignore)
    yield REPAIR
    repaired(replace(costly, before=path.cells[2:]), path.planner, 0, _perturbed)
    yield LINE
    _take_line(grid)
    for name in PLANNER_NAMES:
        yield name
        planner_of(name, ColonyConfig(ants=1, velocities=(1,))).plan(problem, never, ignore)


def _take_changes_in(grid: OccupancyGrid, lattice: CoverageLattice, footprint: Footprint) -> None:
    cells = np.zeros((4, 5), np.int8)
    cells[1, 1] = OCCUPIED
    grown = OccupancyGrid(GridGeometry(4, 5, 1.0, Pose2D(0.0, 0.0)), cells)
    change = LatticeChange.between((grid, grown), lattice, footprint)
    steps, reachable = change.after.steps, np.ones((4, 5), np.bool_)
    update_reach(steps, steps, change.cells.copy(), reachable, 0, 0)
    raster, _ = grid.geometry.on_raster()
    place = placement_on(raster, footprint.cell_m)
    count_free_beside(pixels_of(grown), 25, place, reachable, 0, 0)


def _take_areas(lattice: CoverageLattice) -> None:
    cells = np.zeros(lattice.states.shape, np.bool_)
    cells_beside(find_areas(lattice.states.copy()), cells)
    corners = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)])
    turn_inside(corners, 0, 0, 1.0, cells)
    add_near(corners, 0, 0, 1.0, 0.5, np.zeros((4, 5), np.int32))
    count_in(np.packbits(cells)[np.newaxis], np.packbits(cells))


def _take_line(grid: OccupancyGrid) -> None:
    floor = Floor.around(grid, RobotDiscs(radius_m=0.4, tool_m=0.6), (0.5, 0.5))
    stands = StandLattice.over(floor, 1.0)
    walk = np.array([(0, 0), (0, 1), (1, 1)], np.int32)
    line_over(walk, stands, floor, LineConfig(moves_m2=20), is_end_fixed=False)


def _perturbed(progress: SearchProgress) -> bool:
    return progress.work.perturbations > 0
