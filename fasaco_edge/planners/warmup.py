"""Warm-up: one run of every kernel of a mission on a tiny map, stage by stage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.fine_raster import RobotDiscs
from fasaco_edge.grid.floor import Floor, StandLattice
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice, Footprint, pixels_of, placement_on
from fasaco_edge.grid.occupancy import OCCUPIED, OccupancyGrid
from fasaco_edge.grid.rooms import find_rooms
from fasaco_edge.kernels.fleet.nearest import walk_parts
from fasaco_edge.kernels.floor.capsule import is_clear
from fasaco_edge.kernels.floor.certain import TILE, FloorTiles, Whereabouts, certain_floor
from fasaco_edge.kernels.floor.open_floor import pass_line, set_causes, set_open
from fasaco_edge.kernels.floor.runs import common_runs
from fasaco_edge.kernels.floor.sweeps import Sweeps
from fasaco_edge.kernels.lattice.areas import cells_beside, find_areas
from fasaco_edge.kernels.lattice.pixels import count_free_beside
from fasaco_edge.kernels.lattice.polygons import add_near, count_in, turn_inside
from fasaco_edge.kernels.lattice.reach import update_reach, ways_from
from fasaco_edge.planners.bound import lower_bound_of
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.curve_config import CurveConfig
from fasaco_edge.planners.curves import curve_along
from fasaco_edge.planners.line import LineConfig, LineSearch, memory_for_moves
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath, walk_figures
from fasaco_edge.planners.planner import SearchProgress, ignore, never
from fasaco_edge.planners.problem import CoverageProblem, FramedGround
from fasaco_edge.planners.registry import PLANNER_NAMES, planner_of
from fasaco_edge.planners.search.effort import effort_for
from fasaco_edge.planners.search.near_optimal import NearOptimal
from fasaco_edge.planners.search.regions import regions_of
from fasaco_edge.planners.search.repair import repaired
from fasaco_edge.planners.search.search_trail import SearchTrail
from fasaco_edge.planners.search.walk_region import WalkRegion, stream_of
from fasaco_edge.planners.search.windows import WindowSearch
from fasaco_edge.planners.stages import (
    AREAS,
    BOUND,
    CHANGES,
    CURVES,
    LATTICE,
    LINE,
    LOCAL_SEARCH,
    REACH,
    REPAIR,
    ROOMS,
    SHARES,
    WALKS,
    WINDOWS,
)

_ANTS = ColonyConfig(ants=1, velocities=(1,))


def run_stage(stage: str, room: TinyRoom) -> None:
    """Run every kernel of a stage."""
    _STAGES[stage](room)


class TinyRoom:
    """Sixteen free cells, and plans on them."""

    def __init__(self) -> None:
        # Read-only, as maps from the bus are: numba compiles a separate variant for that.
        self.grid = OccupancyGrid(
            GridGeometry(4, 4, 1.0, Pose2D(0.0, 0.0)), np.zeros((4, 4), np.int8)
        )
        self.footprint = Footprint(cell_m=1.0, robot_radius_m=0.4)

    @cached_property
    def lattice(self) -> CoverageLattice:
        return CoverageLattice.from_map(self.grid, self.footprint)

    @cached_property
    def problem(self) -> CoverageProblem:
        return CoverageProblem.of(self.lattice, (0, 0))

    @cached_property
    def costly(self) -> CoverageProblem:
        return CoverageProblem.of(self.lattice, (0, 0), cost=CoverageCost(1.0, 1.0))

    @cached_property
    def path(self) -> CoveragePath:
        search = NearOptimal(_ANTS)
        return search.plan(self.costly, _perturbed, ignore)

    def framed(self) -> tuple[FramedGround, NDArray[np.int32]]:
        """Return the ground with a border, and the walk as indices of this ground's cells."""
        framed = FramedGround.of(self.costly)
        cells = (self.path.cells @ (self.lattice.window.cols, 1)).astype(np.int32)
        return framed, framed.framed(cells)


def _take_changes_in(room: TinyRoom) -> None:
    cells = np.zeros((4, 5), np.int8)
    cells[1, 1] = OCCUPIED
    grown = OccupancyGrid(GridGeometry(4, 5, 1.0, Pose2D(0.0, 0.0)), cells)
    change = LatticeChange.between((room.grid, grown), room.lattice, room.footprint)
    steps, reachable = change.after.steps, np.ones((4, 5), np.bool_)
    update_reach(steps, steps, change.cells.copy(), reachable, 0, 0)
    ways_from(steps, 0)
    raster, _ = room.grid.geometry.on_raster()
    place = placement_on(raster, room.footprint.cell_m)
    count_free_beside(pixels_of(grown), 25, place, reachable, 0, 0)


def _take_areas(room: TinyRoom) -> None:
    states = room.lattice.states
    cells = np.zeros(states.shape, np.bool_)
    cells_beside(find_areas(states.copy()), cells)
    corners = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)])
    turn_inside(corners, 0, 0, 1.0, cells)
    add_near(corners, 0, 0, 1.0, 0.5, np.zeros((4, 5), np.int32))
    count_in(np.packbits(cells)[np.newaxis], np.packbits(cells))


def _take_local_search(room: TinyRoom) -> None:
    """Improve and perturb a walk; a search would not, as the walk is proven optimal."""
    framed, walk = room.framed()
    region = WalkRegion(framed.rows, framed.cols, 4 * walk.size, 1, SearchTrail(room.costly, _ANTS))
    (box,) = regions_of(framed, room.costly.cells, 0)
    is_loaded = region.load(framed, walk, box)
    assert is_loaded
    region.improve(0, 1, stream_of(0))
    region.perturb(effort_for(room.costly.cost).rules, 1, stream_of(0))
    region.go_back()


def _take_windows(room: TinyRoom) -> None:
    framed, walk = room.framed()
    windows = WindowSearch(room.costly, framed, lower_bound_of(room.costly))
    windows.load(walk)
    for _ in windows.solve_whole(1, 0, stream_of(0)):
        pass
    windows.solve(1, stream_of(0))
    windows.walk()


def _take_shares(room: TinyRoom) -> None:
    steps, cols = room.lattice.steps.ravel().copy(), room.lattice.steps.shape[1]
    offsets, cells = np.array([1, cols, -1, -cols], np.int64), np.arange(2, dtype=np.int64)
    walk_parts(steps, offsets, cells, cells, cells)


def _take_repair(room: TinyRoom) -> None:
    problem = replace(room.costly, before=room.path.cells[2:])
    repaired(problem, room.path.planner, _ANTS, _perturbed)


def _take_line(room: TinyRoom) -> None:
    discs = RobotDiscs(radius_m=0.4, tool_m=0.6)
    floor = Floor.around(room.grid, discs, (0.5, 0.5))
    stands = StandLattice.over(floor, 1.0)
    walk = np.array([(0, 0), (0, 1), (1, 1)], np.int32)
    search = LineSearch(walk, stands, floor, LineConfig(moves_m2=20), is_end_fixed=False)
    assert any(search.best is not None for _ in search.run())
    under_maps = FloorMap(room.grid, room.lattice, room.footprint, discs, 100_000)
    shape = under_maps.geometry.rows, under_maps.geometry.cols
    under_maps.reached(np.zeros(room.lattice.states.shape, np.bool_), Window(0, 0, *shape))
    is_clear(under_maps.blocked, 1.0, 1.0, 2.0, 2.0, 0.5)
    sweeps = Sweeps(np.zeros(shape, np.int16), np.zeros(shape, np.int32))
    state = np.zeros(shape, np.uint8)
    points = np.array([(2.0, 2.0), (3.0, 2.0)])
    pass_line(sweeps, state, points, 1.0, memory_for_moves().capsules)
    set_open(sweeps, state, (0, 0), np.zeros(shape, np.bool_), np.zeros(shape, np.bool_))
    set_causes(state, (0, 0), np.zeros(shape, np.uint8), np.zeros(4, np.int64))
    common_runs(walk, walk, 1)
    tiles = FloorTiles(np.zeros((1, 2), np.int64), np.full((1, TILE, TILE // 8), 255, np.uint8))
    still = Whereabouts(np.array([[[0.0, 0.0, 1.0, 0.0]]]), np.ones(1, np.int64))
    certain_floor(tiles, tiles, still)


def _take_curves(room: TinyRoom) -> None:
    floor = Floor.around(room.grid, RobotDiscs(radius_m=0.4, tool_m=0.6), (0.5, 0.5))
    line_xy = np.array([(0.5, 0.5), (3.5, 0.5), (3.5, 3.5)])
    curve_along(line_xy, floor, floor.reachable, CurveConfig(1.0, True, 0.5, 0.5, 1.0, 200.0))


def _plan_with(name: str, room: TinyRoom) -> None:
    planner_of(name, _ANTS).plan(room.problem, never, ignore)


def _perturbed(progress: SearchProgress) -> bool:
    return progress.work.perturbations > 0


_STAGES: dict[str, Callable[[TinyRoom], object]] = {
    LATTICE: lambda room: room.lattice,
    CHANGES: _take_changes_in,
    REACH: lambda room: room.problem,
    AREAS: _take_areas,
    ROOMS: lambda room: find_rooms(room.grid),
    WALKS: lambda room: walk_figures(room.lattice, np.array([[0, 0], [0, 1]], np.int32)),
    BOUND: lambda room: lower_bound_of(room.costly),
    LOCAL_SEARCH: _take_local_search,
    WINDOWS: _take_windows,
    SHARES: _take_shares,
    REPAIR: _take_repair,
    LINE: _take_line,
    CURVES: _take_curves,
    **{name: partial(_plan_with, name) for name in PLANNER_NAMES},
}
