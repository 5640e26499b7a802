"""Robots of a fleet at their daemons' keys: each drives along the newest path, a cell at a time."""

from __future__ import annotations

import numpy as np

from tests.support.outsider import Outsider
from tests.support.rooms import TOOL_M, Cell, Pixels, cells_of, map_bytes, pose_bytes
from tests.wire import oracle


class FleetRobot:
    """A robot that knows the whole floor, and has no body: it drives through others.

    Attributes:
        seat: its place on the bus.
        at: where it is, x, y [m].
        swept: the cells it has driven to.
    """

    def __init__(self, router: str, name: str, floor: Pixels, start: tuple[float, float]) -> None:
        self.name, self.floor = name, floor
        self.seat = Outsider(router, name)
        self.at = np.array(start)
        self.swept: set[Cell] = set()
        self._path = self.seat.listen("path")
        self._seen = 0
        self._ahead: list[np.ndarray] = []
        self.look()
        self.go()

    def look(self) -> None:
        self.seat.put("map", map_bytes(self.floor))

    def go(self) -> None:
        if len(self._path.heard) > self._seen:
            self._seen = len(self._path.heard)
            message = oracle.from_bytes("nav_msgs/msg/Path", self._path.heard[-1].payload)
            xy = [(pose.pose.position.x, pose.pose.position.y) for pose in message.poses]
            self._ahead = [np.array(point) for point in xy]
        while self._ahead and np.hypot(*(self._ahead[0] - self.at)) < 0.01:
            self._ahead.pop(0)
        if self._ahead:
            way = self._ahead[0] - self.at
            self.at = self.at + way * min(TOOL_M / np.hypot(*way), 1.0)
        self.swept.update(cells_of(self.at[None]))
        self.seat.put("pose", pose_bytes(*self.at))
