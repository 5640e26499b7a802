"""The floor of a recorded mission: what of it the robot could reach at the end, and has swept.

Judged on the pixels of the last map along the recorded poses, by tool and robot of the
configuration. What a keep-out zone touches is as good as a wall.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.floor import JudgedFloor, SweepingRobot, judge_floor
from fasaco_edge.grid.geometry import Polygon
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.mission.orders.zones import with_kept_out
from fasaco_edge.review.run_data import RunData
from fasaco_edge.wire.documents.settings import known_settings


def swept_floor(
    data: RunData,
    lattice: CoverageLattice,
    lost_pose_s: float,
    keep_out: tuple[Polygon, ...] | None = None,
) -> JudgedFloor | None:
    """Return what the robot did to the floor; None without a pose on the map.

    None also where some was swept before the recording began: a recording does not tell what.

    Args:
        data: of the samples, with a map and a configuration.
        lattice: over that map; a pose beyond it is astray.
        lost_pose_s: after so long without a pose [s] the way to the next one is unknown; 0 for
            never.
        keep_out: other keep-out zones than the last order's.
    """
    footprint = data.footprint
    if data.grid is None or footprint is None or data.restored_cells:
        return None
    cells = np.floor(data.track[:, 1::-1] / lattice.cell_m)
    window = lattice.window
    low, high = (window.row0, window.col0), (window.row1, window.col1)
    on_map = ((cells >= low) & (cells < high)).all(axis=1)
    track, at_s = data.track[on_map, :2], data.times[on_map]
    if not len(track):
        return None
    driven = _driven(track, at_s, data.jump_m, lost_pose_s)
    tool_m = known_settings(data.config).robot.tool_width_m
    robot = SweepingRobot(tool_m, footprint.robot_radius_m, free_at_most=footprint.free_at_most)
    # What can be reached is told from where the robot was in the end, as with the cells.
    x, y = track[-1].tolist()
    grid = with_kept_out(data.grid, data.keep_out if keep_out is None else keep_out)
    return judge_floor(grid, track, robot, driven=driven, stands_at=(x, y))


def _driven(
    track: NDArray[np.float64], at_s: NDArray[np.float64], jump_m: float, lost_pose_s: float
) -> NDArray[np.bool_]:
    """Return which ways between poses, (n, 2), were driven, bool (n - 1,), as the ledger has it."""
    driven: NDArray[np.bool_] = np.hypot(*np.diff(track, axis=0).T) <= jump_m
    if lost_pose_s > 0:
        driven &= np.diff(at_s) <= lost_pose_s
    return driven
