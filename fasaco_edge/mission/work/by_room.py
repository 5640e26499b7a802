"""Price of steps from one room into another, so that rooms are finished one by one.

Many walks take nearly the same time, and most of them leave rooms half done. With the price, the
search chooses a walk that finishes each room before the next.
"""

from __future__ import annotations

from dataclasses import replace

from fasaco_edge.mission.config import ByRoom
from fasaco_edge.mission.rooms.room_cells import RoomCells
from fasaco_edge.planners.problem import CoverageProblem

# Price of a step into another room, in units of a step with a quarter-turn. At this price robots
# returned to 12 rooms of 27, at a tenth of it to 19; four times the price gained nothing.
PRICE = 20.0


def with_rooms(problem: CoverageProblem, cells: RoomCells, by_room: ByRoom) -> CoverageProblem:
    """Return a problem with the rooms of its cells, and the price of steps between them."""
    rooms = None if by_room == "never" else cells.on(problem.lattice)
    if rooms is None:
        return problem
    cost = problem.cost
    room_s = PRICE * (cost.step_s + cost.quarter_turn_s)
    return replace(problem, cost=replace(cost, room_s=room_s), rooms=rooms)
