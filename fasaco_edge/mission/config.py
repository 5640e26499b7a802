"""What a mission is for."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.grid.lattice import MAX_LATTICE_CELLS, Footprint
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost


@dataclass(frozen=True, slots=True)
class MissionConfig:
    """What the mission is for, and how patient it is.

    Attributes:
        footprint: of robot and tool.
        max_lattice_cells: the largest lattice it plans on.
        cost: of walks.
        retries: how often what is blocked or left over in the end is tried again.
        retry_s: how long to wait before each time [s].
        lost_pose_s: without a pose for so long nobody knows where the robot is [s]; 0 for never.
        spare_share: share of a processor core that may go into making a path better that nothing
            forces to be changed; 0 for none.
        stale_map_s: without a map or an update for so long the map is stale [s]; 0 for never.
    """

    footprint: Footprint
    max_lattice_cells: int = MAX_LATTICE_CELLS
    cost: CoverageCost = STEPS_ALONE
    retries: int = 0
    retry_s: float = 30.0
    lost_pose_s: float = 0.0
    stale_map_s: float = 0.0
    spare_share: float = 0.0
