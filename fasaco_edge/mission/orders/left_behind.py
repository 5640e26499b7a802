"""Floor left behind: floor unreachable when the robot set out for home, and reachable now."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried
from fasaco_edge.mission.map.reachable_area import ReachableArea


@dataclass(slots=True)
class LeftBehind:
    """Finds floor for which a robot on its way home turns back.

    Attributes:
        times: how often it did. A gap that opens whenever the robot has left must not hold it for
            ever.
    """

    times: int = 0
    # What was reachable when it set out; None if that is not known, as after a restart.
    _area: ReachableArea | None = None

    def set_out(self, area: ReachableArea | None) -> None:
        """Note that the robot sets out for home; ``area``: the reachable area at that time."""
        self._area = area

    def is_open(self, unswept: NDArray[np.bool_], area: ReachableArea) -> bool:
        """Return whether floor has opened since: a square of two by two cells at least.

        Rows of cells along walls come and go with the map's noise. ``unswept``: bool (rows, cols)
        of the area.
        """
        before = self._area = self._area or area
        opened = unswept & area.reachable
        opened &= ~carried(before.reachable, before.lattice.window, area.lattice.window)
        pairs = opened[1:] & opened[:-1]
        return bool((pairs[:, 1:] & pairs[:, :-1]).any())

    def turn_back(self) -> None:
        """Note that the robot turns back."""
        self._area, self.times = None, self.times + 1
