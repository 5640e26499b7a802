"""Floor that the other robots of a fleet swept, from their messages in one robot's recording."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.errors import FasacoError
from fasaco_edge.fleet.mission.frames import seen_from
from fasaco_edge.fleet.observer.cells import Seat, mask_of, together, window_of
from fasaco_edge.fleet.observer.members import Member
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.judge.pixels import within
from fasaco_edge.samples import SampleDecoder
from fasaco_edge.wire.documents.fleet import decode_member
from fasaco_edge.wire.documents.settings import FleetSettings
from fasaco_edge.wire.documents.turns import decode_turns
from fasaco_edge.wire.topics import FLEET

# Distance that includes the eight neighbours of a cell [cells].
BESIDE = 1.5


def swept_by_others(
    turns: Iterable[Arrival], fleet: FleetSettings, geometry: GridGeometry
) -> NDArray[np.bool_] | None:
    """Return the pixels that others swept, bool (rows, cols); None without messages of others.

    A swept cell counts as a whole, and so do unreachable cells beside it: the floor along walls.

    Args:
        turns: the samples of the turn log, which contain the messages of the others.
        fleet: settings of the recorded robot.
        geometry: placement of the pixels in the recorded robot's map frame.
    """
    members = _members(turns, fleet.name)
    if not members:
        return None
    own = Pose2D(fleet.x_m, fleet.y_m, math.radians(fleet.yaw_deg))
    cols = np.arange(0.5, geometry.cols, dtype=np.float64)
    found = np.zeros((geometry.rows, geometry.cols), np.bool_)
    for member in members:
        swept, ground, seat = member.swept.cells(), member.ground.cells(), member.seat
        window = window_of(together([swept, ground]))
        if window is None:
            continue
        window = Window(window.row0 - 1, window.col0 - 1, window.row1 + 1, window.col1 + 1)
        cells = mask_of(swept, window)
        cells |= within(cells, BESIDE) & ~mask_of(ground, window)
        here = seen_from(seat.frame, own)
        placed = Seat(seat.cell_m, seat.lattice_deg, here.x, here.y, math.degrees(here.yaw))
        lattice = placed.geometry(window)
        for row in range(geometry.rows):
            x, y = geometry.to_map(cols, np.full_like(cols, row + 0.5))
            found[row] |= lattice.values_at(cells, np.column_stack((x, y)))
    return found


def _members(turns: Iterable[Arrival], fleet: str) -> list[Member]:
    """Return the other robots as of their last messages."""
    members: dict[str, Member] = {}
    decoder = SampleDecoder()
    for arrival in turns:
        with suppress(FasacoError):
            inputs = decode_turns(arrival.sample.payload).told
            for numbered in decoder.samples(inputs) if inputs else ():
                sample = numbered.arrival.sample
                if numbered.arrival.topic != FLEET.name:
                    continue
                message = decode_member(sample.payload, fleet)
                if message is not None:
                    new = Member(sample.key, len(members), Seat.of(message), message, 0)
                    members.setdefault(sample.key, new).receive(message, 0)
    return list(members.values())
