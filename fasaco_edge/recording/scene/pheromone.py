"""The pheromone as a recording shows it: the field as each cohort left it, and what is known of it.

All cohorts walk on one trail. What one has done is what the field is then otherwise than after
the one before it: the timeline ``iter`` goes from cohort to cohort.
"""

from __future__ import annotations

from fasaco_edge.recording import entities
from fasaco_edge.recording.scene import archetypes as draw
from fasaco_edge.recording.scene.curves import Curves
from fasaco_edge.recording.scene.layers import Layers, size_in_file
from fasaco_edge.recording.write.journal import Journal
from fasaco_edge.wire.pheromone import PheromoneMessage

# How far above the field its label stands, as a share of the field's height.
LABEL_ABOVE = 0.1
# A range that grows by less than this is still told as it was.
SLACK = 1.1


class PheromoneDrawing:
    """Draws pheromone into a journal as soon as the allowance of its layer lets it.

    Attributes:
        trail_range: least and greatest trail of all fields so far; None before the first.
    """

    def __init__(self, journal: Journal, layers: Layers, curves: Curves) -> None:
        self._journal = journal
        self._layers = layers
        self._curves = curves
        self._cohorts = 0
        self.trail_range: tuple[float, float] | None = None

    def add(self, message: PheromoneMessage) -> None:
        """Draw the pheromone after a cohort, and plot the best walk so far."""
        self._cohorts += 1
        self._journal.sequence(entities.ITER, self._cohorts)

        def draw_pheromone() -> None:
            field = draw.pheromone_archetype(message)
            label = draw.label_archetype(message.geometry.bounds(), _line(message), LABEL_ABOVE)
            self._journal.log(entities.PHEROMONE, field, latched=True, size=message.levels.size)
            self._journal.log(entities.COHORT, label, latched=True)

        size = size_in_file(message.levels)
        self._layers.draw(entities.PHEROMONE, size, draw_pheromone, self._journal.wall_ns)
        self._curves.draw(entities.BEST_STEPS, message.best_steps)
        # The levels' scale: with it they can be turned back into trails.
        self._curves.draw(f"{entities.TRAIL_RANGE}/min", message.trail_min)
        self._curves.draw(f"{entities.TRAIL_RANGE}/max", message.trail_max)
        self._widen(message.trail_min, message.trail_max)

    def _widen(self, least: float, most: float) -> None:
        if most <= 0:
            return  # no cell is coverable
        low, high = self.trail_range or (least, most)
        if self.trail_range is None or least * SLACK < low or most > high * SLACK:
            self.trail_range = min(least, low), max(most, high)


def _line(message: PheromoneMessage) -> str:
    cells = "cell" if message.velocity == 1 else "cells"
    ants = "ant" if message.ants == 1 else "ants"
    return (
        f"cohort {message.cohort + 1}, {message.velocity} {cells} a step\n"
        f"{message.ants} {ants} in all, best walk {message.best_steps} steps"
    )
