"""Mission configuration."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.grid.lattice import MAX_LATTICE_CELLS, Footprint
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost


@dataclass(frozen=True, slots=True)
class MissionConfig:
    """Robot, cost and limits of a mission.

    Attributes:
        footprint: of robot and tool.
        max_lattice_cells: the most cells of a lattice it plans on.
        cost: of paths.
        retries: how often what is blocked or left over in the end is tried again.
        retry_s: pause before each retry [s].
        lost_pose_s: the pose is lost after this time without one [s]; 0 for never.
        stale_map_s: the map is stale after this time without a map or an update [s]; 0 for never.
        spare_share: share of a processor core for improving a path that need not change; 0 for
            none.
    """

    footprint: Footprint
    max_lattice_cells: int = MAX_LATTICE_CELLS
    cost: CoverageCost = STEPS_ALONE
    retries: int = 0
    retry_s: float = 30.0
    lost_pose_s: float = 0.0
    stale_map_s: float = 0.0
    spare_share: float = 0.0
