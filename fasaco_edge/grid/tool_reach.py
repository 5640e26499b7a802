"""Reach of a tool: the pixels that it touches from places of the robot, without those behind walls.

All that the robot's disc covers is free. If the tool sticks out of it (side brushes, a wide deck, a
lamp), a pixel of the tool's disc counts if free pixels, about inside that disc, connect it with the
robot's disc.
"""

from __future__ import annotations

import math

from fasaco_edge.kernels.floor.bits import LAST, ONE, Bits
from fasaco_edge.kernels.floor.places import within


def tool_steps(radius: float, tool: float) -> int:
    """Return how many steps over edges lead from the robot's disc to the rim of the tool's.

    0 for a tool within the robot's disc. Diagonal distances take more steps: the number allows for
    that.

    Args:
        radius, tool: radii of robot and tool [pixels].
    """
    return math.ceil(math.sqrt(2.0) * (tool - radius)) if tool > radius else 0


def tool_reach(places: Bits, blocked: Bits, radius: float, tool: float) -> Bits:
    """Return the pixels that the tool reaches from places.

    Args:
        places, blocked: uint64 (rows, words), see ``kernels.floor.bits``.
        radius, tool: radii of robot and tool [pixels].
    """
    reached, free = within(places, tool), ~blocked
    steps = tool_steps(radius, tool)
    if not steps:
        return reached
    found = within(places, radius)
    for _ in range(steps):
        more = found | found << ONE | found >> ONE
        more[:, 1:] |= found[:, :-1] >> LAST
        more[:, :-1] |= found[:, 1:] << LAST
        more[1:] |= found[:-1]
        more[:-1] |= found[1:]
        found = more & free
    return found & reached
