"""Messages of a robot to its fleet: its state, its path ahead, its division, and tiles in turn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.mission.kind import giving_way_of, layer_of
from fasaco_edge.fleet.mission.shared_ground import GroundQueue
from fasaco_edge.fleet.mission.tiles import SweptQueue
from fasaco_edge.grid.rotation import rotated_points
from fasaco_edge.mission.events import MemberReceived
from fasaco_edge.states import State

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission


class Messages:
    """Makes the messages of one robot, in its map frame.

    Args:
        robot: its name.
        radius_m: radius of its disc [m].
    """

    def __init__(self, robot: str, radius_m: float) -> None:
        self._robot, self._radius_m, self._epoch = robot, radius_m, 0
        self._swept, self._ground = SweptQueue(), GroundQueue()

    def next(self, mission: Mission, most: int, most_anew: int) -> MemberReceived | None:
        """Return the next message; None before the mission has a map and a pose.

        Args:
            mission: mission of the robot.
            most: largest number of tiles of progress, and also of tiles of ground.
            most_anew: ``most`` for the first message of an epoch.
        """
        if mission.pose is None or not mission.covered.current.frame:
            return None
        layer, pose, tiles = (
            layer_of(mission),
            mission.pose.pose,
            mission.covered.current.snapshot().tiles,
        )
        if layer.others.shared.epoch != self._epoch:
            # All tiles are sent again in a new epoch. Cells swept before the first epoch are
            # unknown.
            before = tiles if self._epoch else None
            self._epoch, self._swept, most = (
                layer.others.shared.epoch,
                SweptQueue(before),
                most_anew,
            )
        swept = self._swept.next(tiles, most)
        return MemberReceived(
            robot=self._robot,
            frame=mission.covered.current.frame,
            state=str(mission.state),
            x=round(pose.x, 3),
            y=round(pose.y, 3),
            step_s=layer.step_s,
            epoch=layer.others.shared.epoch,
            division=layer.numbers.number,
            tiles=swept,
            ground=self._ground.next(mission.map.area, most),
            by=layer.numbers.by,
            parts=layer.parts,
            radius_m=self._radius_m,
            ahead=tuple((x, y) for x, y in path_ahead(mission).tolist()),
            waits_for=waits_for(mission),
            kept=self._swept.kept(swept),
        )


def path_ahead(mission: Mission) -> NDArray[np.float64]:
    """Return the points of the path for the next AHEAD_M in the map frame [m], float64 (n, 2)."""
    line = giving_way_of(mission).line()[1:]
    return rotated_points(line, mission.rotation.deg) if len(line) else line


def waits_for(mission: Mission) -> str:
    """Return the robot that this robot waits or makes way for, or the busiest robot while this
    robot has no work; "" for none."""
    name, orders = mission.giving_way.waits_for, mission.orders
    stands = mission.doing is State.COVERING and len(mission.route.path.ahead) < 2
    if name or not (stands and orders.part.waits_for_others):
        return name
    return layer_of(mission).busiest(orders.cells.untried)
