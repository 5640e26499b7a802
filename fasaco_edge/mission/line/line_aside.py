"""Line aside: the rest of a polished line, kept while the robot drives an errand or makes way."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.line.polyline import Line, Points, Walk


@dataclass(frozen=True, slots=True, eq=False)
class LineAside:
    """A line on the raster that it will be resumed on; empty if there is none.

    Attributes:
        walk: int32 (n, 2), its cells.
        line: from the place where the robot left it on.
        touched: window of the raster that maps may have changed since; None for none.
    """

    walk: Walk = field(default_factory=lambda: np.empty((0, 2), np.int32))
    line: Line = field(default_factory=Line)
    touched: Window | None = None

    @classmethod
    def of(cls, walk: Walk, line: Line, cell: int, place: Points) -> LineAside:
        """Set a line aside.

        Args:
            walk, line: the walk and the line along it.
            cell: index of the robot's cell in the walk.
            place: the robot's place on the first edge, (2,).
        """
        points = line.points.copy()
        points[0] = place
        return cls(walk[cell:], Line(points, np.maximum(line.cells - cell, 0), line.state))

    def moved(self, by: tuple[int, int]) -> LineAside:
        """Return this line shifted by rows and columns of the raster."""
        touched = self.touched and self.touched.moved(*by)
        return LineAside(self.walk, self.line.moved(by), touched)

    def on_map(self, touched: Window) -> LineAside:
        """Return this line on another map, which differs within a window."""
        return replace(self, touched=Window.around(self.touched, touched))
