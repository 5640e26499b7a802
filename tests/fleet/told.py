"""What robots of a fleet tell, made by hand: messages, and robots that send them over a bus."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from msgspec import structs

from fasaco_edge.bus.session import Bus
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.fleet import CellTile, FleetMember
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.keys import Keys
from tests.support.rooms import Pixels, map_bytes, pose_bytes

CELL_M = 0.3


def tiles(cells: Iterable[tuple[int, int]]) -> tuple[CellTile, ...]:
    masks: dict[tuple[int, int], np.ndarray] = {}
    for row, col in cells:
        mask = masks.setdefault((row // 64, col // 64), np.zeros((64, 64), np.bool_))
        mask[row % 64, col % 64] = True
    return tuple(CellTile(*place, np.packbits(mask).tobytes()) for place, mask in masks.items())


def member(
    fleet: str = "house", cells: Iterable[tuple[int, int]] = (), **members: Any
) -> FleetMember:
    """Return a message of a robot that has swept some cells, and can reach a hall of 20 x 30."""
    ground = tiles((row, col) for row in range(20) for col in range(30))
    said = FleetMember(
        1, fleet, CELL_M, "map", "covering", 1.0, 1.0, 1.2, 1, 1, 600, tiles(cells), ground=ground
    )
    return structs.replace(said, **members)


class Teller:
    def __init__(self, bus: Bus, name: str) -> None:
        keys = Keys(name)
        self.name = name
        self._publishers = {
            topic.name: bus.advertise(keys, topic)
            for topic in (topics.FLEET, topics.STATUS, topics.MAP, topics.POSE)
        }

    def tell(self, **members: Any) -> None:
        self.send("fleet", encode_json(member(**members)))

    def stand(self, x: float, y: float) -> None:
        self.send("pose", pose_bytes(x, y))

    def show(self, pixels: Pixels) -> None:
        self.send("map", map_bytes(pixels))

    def send(self, topic: str, payload: bytes) -> None:
        self._publishers[topic].put(payload)
