"""The robot's drive: its walk over the cells, when each was first covered, the floor it swept.

Cells count as the mission's own ledger counts them: one is covered when the tool passes over
its centre. So a walk is the cells in the order they were passed over. The floor is judged on the
pixels of the last map along the recorded poses, by tool and robot of the configuration. Pixels
touched by a keep-out zone count as wall.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Polygon, Pose2D
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.judge.floor import JudgedFloor, SweepingRobot, judge_floor
from fasaco_edge.mission.coverage.ledger import JUMP_CELLS, CoverageLedger
from fasaco_edge.mission.coverage.progress import Coverage
from fasaco_edge.mission.map.reachable_area import ReachableArea, anchor_cell
from fasaco_edge.mission.orders.zones import with_kept_out
from fasaco_edge.review.run_data import RunData
from fasaco_edge.wire.documents.settings import known_settings

MILESTONES = (50, 90, 99, 100)
"""Shares of the cells that can be covered at the end [percent]."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """The robot's walk over the lattice.

    Attributes:
        cells: int32 (n, 2), the cells (row, col) it passed over, in order.
        at_s: float64 (n,), times [s].
        visits: uint16, shape of the lattice: passes over each cell.
        reachable: bool, shape of the lattice: cells that could be covered at the end.
        coverage: counts over both.
        driven_m: driven distance, without jumps [m].
    """

    cells: NDArray[np.int32]
    at_s: NDArray[np.float64]
    visits: NDArray[np.uint16]
    reachable: NDArray[np.bool_]
    coverage: Coverage
    driven_m: float


@dataclass(frozen=True, slots=True)
class WalkFigures:
    """Counts of a walk: steps from cell to cell, revisits, quarter-turns, about-turns."""

    steps: int
    revisits: int
    turns_90: int
    turns_180: int


def drive_over(
    lattice: CoverageLattice,
    at_s: NDArray[np.float64],
    track: NDArray[np.float64],
    lost_pose_s: float,
) -> Drive:
    """Return the walk of a robot over the lattice of the last map.

    Args:
        lattice: without keep-out cells.
        at_s: float64 (n,), arrival of each pose [s].
        track: float64 (n, 3), the poses: x [m], y [m], yaw [rad].
        lost_pose_s: gap between poses [s] over which the path is unknown; 0 for none.
    """
    ledger = CoverageLedger(lattice.cell_m)
    walk: list[Cell] = []
    times: list[float] = []
    before = at_s[0] if len(at_s) else 0.0
    last = track[0] if len(track) else np.zeros(3)
    for now, pose in zip(at_s.tolist(), track, strict=True):
        x, y = float(pose[0]), float(pose[1])
        # As in the mission: a jump of kilometres is no driving.
        if not lattice.contains(lattice.cell_at(x, y)):
            continue
        if 0 < lost_pose_s < now - before:
            ledger.break_track()
        entered = sorted(ledger.record(Pose2D(x, y)), key=_distance_from(last, lattice.cell_m))
        walk += entered
        times += [now] * len(entered)
        before, last = now, pose
    visits = ledger.visits(lattice.window)
    reachable = _reachable(lattice, track)
    return Drive(
        cells=np.array(walk, np.int32).reshape(-1, 2),
        at_s=np.array(times, np.float64),
        visits=visits,
        reachable=reachable,
        coverage=Coverage.of(lattice, reachable, visits),
        driven_m=_driven_m(track, JUMP_CELLS * lattice.cell_m),
    )


def walk_figures(cells: NDArray[np.int32]) -> WalkFigures:
    """Count over a walk, int32 (n, 2); turns count between steps to a neighbouring cell."""
    if not len(cells):
        return WalkFigures(0, 0, 0, 0)
    whole = cells.astype(np.int64)
    moves = whole[1:] - whole[:-1]
    before, after = moves[:-1], moves[1:]
    single = np.abs(moves).sum(axis=1) == 1
    both = single[:-1] & single[1:]
    along = (before * after).sum(axis=1)
    return WalkFigures(
        steps=len(moves),
        revisits=len(cells) - len(np.unique(cells, axis=0)),
        turns_90=int(np.count_nonzero(both & (along == 0))),
        turns_180=int(np.count_nonzero(both & (along == -1))),
    )


def first_covered(drive: Drive, lattice: CoverageLattice) -> NDArray[np.float64]:
    """Return when cells that could be covered at the end were first covered [s], ascending."""
    corner = np.array((lattice.window.row0, lattice.window.col0))
    places = drive.cells - corner
    inside = np.all((places >= 0) & (places < drive.reachable.shape), axis=1)
    inside[inside] = drive.reachable[tuple(places[inside].T)]
    _, first = np.unique(places[inside], axis=0, return_index=True)
    return np.sort(drive.at_s[inside][first])


def milestones(first_s: NDArray[np.float64], coverable: int) -> dict[int, float | None]:
    """Return when each of MILESTONES was reached [s]; None if it was not.

    Args:
        first_s: float64 (n,), when each cell was first covered [s], ascending.
        coverable: number of cells that could be covered at the end.
    """
    needed = {percent: -(-coverable * percent // 100) for percent in MILESTONES}
    return {
        percent: float(first_s[count - 1]) if 0 < count <= len(first_s) else None
        for percent, count in needed.items()
    }


def _reachable(lattice: CoverageLattice, track: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the cells reachable from the robot's last position on coverable ground."""
    for x, y, _ in track[::-1].tolist():
        cell = anchor_cell(lattice, Pose2D(x, y))
        if cell is not None:
            return ReachableArea.around(lattice, cell).reachable
    return np.zeros(lattice.states.shape, np.bool_)


def _driven_m(track: NDArray[np.float64], jump_m: float) -> float:
    lengths = np.hypot(*np.diff(track[:, :2], axis=0).T) if len(track) > 1 else np.zeros(0)
    return float(lengths[lengths <= jump_m].sum())


def _distance_from(pose: NDArray[np.float64], cell_m: float) -> Callable[[Cell], float]:
    x, y = float(pose[0]), float(pose[1])
    return lambda cell: math.hypot((cell[1] + 0.5) * cell_m - x, (cell[0] + 0.5) * cell_m - y)


def swept_floor(
    data: RunData,
    lattice: CoverageLattice,
    keep_out: tuple[Polygon, ...] | None = None,
) -> JudgedFloor | None:
    """Return the swept floor; None without a pose on the map.

    Also None if floor was swept before the recording began, as the recording lacks it.

    Args:
        data: of the samples, with a map and a configuration.
        lattice: over that map; a pose beyond it is invalid.
        keep_out: other keep-out zones than the last order's.
    """
    footprint = data.footprint
    if data.grid is None or footprint is None or data.restored_cells:
        return None
    cells = np.floor(data.track[:, 1::-1] / lattice.cell_m)
    window = lattice.window
    low, high = (window.row0, window.col0), (window.row1, window.col1)
    on_map = ((cells >= low) & (cells < high)).all(axis=1)
    kept = replace(data, pose_s=data.times[on_map].tolist(), poses=data.track[on_map].tolist())
    track = kept.track[:, :2]
    if not len(track):
        return None
    tool_m = known_settings(data.config).robot.tool_width_m
    robot = SweepingRobot(tool_m, footprint.robot_radius_m, free_at_most=footprint.free_at_most)
    # Reachability is from the robot's last position, as for the cells.
    x, y = track[-1].tolist()
    grid = with_kept_out(data.grid, data.keep_out if keep_out is None else keep_out)
    return judge_floor(grid, track, robot, driven=kept.driven, stands_at=(x, y))
