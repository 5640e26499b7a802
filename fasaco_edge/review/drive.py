"""The robot's drive: the cells that its tool passed over, and the floor it swept.

Cells are counted as in the mission's ledger: a cell counts when the tool passes over its centre.
Swept floor is counted in pixels of the last map, along the recorded poses, with tool and robot of
the configuration. Pixels that touch a keep-out zone count as wall.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Polygon, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.judge.floor import JudgedFloor, SweepingRobot, judge_floor
from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.orders.zones import with_kept_out
from fasaco_edge.review.run_data import RunData
from fasaco_edge.wire.documents.settings import known_settings

MILESTONES = (50, 90, 99, 100)
"""Shares of the cells that are coverable at the end [percent]."""


def visits_of(data: RunData, lattice: CoverageLattice) -> NDArray[np.uint16]:
    """Return how often the tool passed over each cell, uint16 in the shape of the lattice."""
    ledger = CoverageLedger(lattice.cell_m)
    before = data.pose_s[0] if data.pose_s else 0.0
    for now, (x, y, _) in zip(data.pose_s, data.poses, strict=True):
        # Poses outside the lattice are invalid, as in the mission.
        if not lattice.contains(lattice.cell_at(x, y)):
            continue
        if 0 < data.lost_pose_s < now - before:
            ledger.break_track()
        ledger.record(Pose2D(x, y))
        before = now
    return ledger.visits(lattice.window)


def nearest_points(line: NDArray[np.float64], place: tuple[float, float]) -> NDArray[np.float64]:
    """Return the point of each segment of a line (n, 2) nearest to a place, float64 (n - 1, 2)."""
    starts, ways = line[:-1], np.diff(line, axis=0)
    squares = np.maximum((ways**2).sum(axis=1), 1e-12)
    shares = np.clip(((np.array(place) - starts) * ways).sum(axis=1) / squares, 0.0, 1.0)
    found: NDArray[np.float64] = starts + shares[:, None] * ways
    return found


def swept_floor(
    data: RunData,
    lattice: CoverageLattice,
    keep_out: tuple[Polygon, ...] | None = None,
) -> JudgedFloor | None:
    """Return the swept floor; None without a map, a configuration, or a pose on the map.

    Also None if cells were covered before a restart, as the recording may lack those poses.

    Args:
        data: data of the samples.
        lattice: lattice over the last map; poses outside it are invalid.
        keep_out: keep-out zones; None for those of ``data``.
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
    # Floor is reachable if it is so from the robot's last position; the same holds for cells.
    x, y = track[-1].tolist()
    grid = with_kept_out(data.grid, data.keep_out if keep_out is None else keep_out)
    return judge_floor(grid, track, robot, driven=kept.driven, stands_at=(x, y))
