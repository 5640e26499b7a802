"""What a search lets others see: values, offered after every cohort or restart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window


@dataclass(frozen=True, slots=True, eq=False)
class ColonySnapshot:
    """The colony after a cohort, or where local search starts over.

    Attributes:
        window: which cells of the lattice ``trail`` spans.
        cell_m: edge of a cell [m].
        trail: float32 (rows, cols): mean pheromone on the moves into a cell; 0 where
            the cell is not coverable.
        cohort: which cohort has just walked, from 0.
        velocity: its velocity [cells/step].
        ants: how many ants have walked so far.
        best_steps: steps of the best walk so far.
    """

    window: Window
    cell_m: float
    trail: NDArray[np.float32]
    cohort: int
    velocity: int
    ants: int
    best_steps: int


Observer = Callable[[ColonySnapshot], None]
