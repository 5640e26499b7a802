"""The way the robot has driven, as a recording shows it."""

from __future__ import annotations

import math

import numpy as np

from fasaco_edge.recording import archetypes as draw
from fasaco_edge.recording import entities
from fasaco_edge.recording.journal import Journal

SPACING_M = 0.02
# Drawn as often as the recording is flushed, it would be a twentieth of an hour's file.
PERIOD_NS = 2_000_000_000


class TrailDrawing:
    """Draws the trail piece by piece into a journal, each when it is there to be seen."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._piece: list[tuple[float, float]] = []
        self._drawn_ns = 0

    def add(self, x: float, y: float) -> None:
        """Go on to a place [m]."""
        if self._piece and math.dist(self._piece[-1], (x, y)) < SPACING_M:
            return
        self._piece.append((x, y))
        self.catch_up()

    def catch_up(self) -> None:
        """Draw what has waited long enough; call it often."""
        if self._journal.wall_ns - self._drawn_ns >= PERIOD_NS:
            self.finish()

    def finish(self) -> None:
        """Draw what waits."""
        if len(self._piece) < 2:
            return
        self._drawn_ns = self._journal.wall_ns
        piece = draw.strip_archetype(np.array(self._piece), draw.TRAIL)
        self._journal.log(entities.TRAIL, piece)
        # The next piece begins where this one ends.
        self._piece = self._piece[-1:]
