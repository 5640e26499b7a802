"""The robot's outline, where it is no disc, and the disc that it is planned with."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

from msgspec import Meta

from fasaco_edge.config.reading import Section
from fasaco_edge.errors import BadConfiguration

Length = Annotated[float, Meta(gt=0, le=7)]
Coordinate = Annotated[float, Meta(ge=-7, le=7)]


class FootprintConfig(Section, frozen=True):
    """The robot's outline about the point that it turns about [m]; x is ahead.

    Either ``width_m`` and ``length_m``, of which ``ahead_m`` lie ahead of that point (half without
    it), or the corners (x, y) of a ``polygon``. The robot is planned with the disc around it: it
    can turn on the spot wherever it is, and passages narrower than that disc are left out. The tool
    is taken to be at the point that the robot turns about.
    """

    width_m: Length | None = None
    length_m: Length | None = None
    ahead_m: Annotated[float, Meta(ge=0, le=7)] | None = None
    polygon: tuple[tuple[Coordinate, Coordinate], ...] = ()

    def radius(self) -> float:
        """Return the radius of the disc around it [m]; 0 where too little is said."""
        corners = self.polygon
        if self.width_m is not None and self.length_m is not None:
            ahead = 0.5 * self.length_m if self.ahead_m is None else self.ahead_m
            corners = tuple((x, 0.5 * self.width_m) for x in (ahead, ahead - self.length_m))
        return max((math.hypot(x, y) for x, y in corners), default=0.0)

    def faults(self) -> Iterator[BadConfiguration]:
        """Yield what is missing, there twice, or does not fit together."""
        lengths = (self.width_m, self.length_m)
        if self.polygon and any(length is not None for length in (*lengths, self.ahead_m)):
            yield BadConfiguration("must be a polygon, or width_m and length_m, not both")
        elif not self.polygon and None in lengths:
            yield BadConfiguration("must have width_m and length_m, or a polygon")
        elif self.polygon and len(self.polygon) < 3:
            yield BadConfiguration(f"polygon must have 3 corners, got {len(self.polygon)}")
        elif self.polygon and not self.radius():
            yield BadConfiguration("polygon must have corners apart from each other")
        elif self.length_m is not None and (self.ahead_m or 0.0) > self.length_m:
            yield BadConfiguration(
                f"ahead_m must be at most length_m, {self.length_m:g}, got {self.ahead_m:g}"
            )
