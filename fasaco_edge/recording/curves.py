"""Figures over time: a figure that stays what it was is not drawn again and again.

An entity that is drawn once a second takes five megabytes an hour, whatever is drawn: the
recording is flushed as often, and each flush begins a chunk for each entity.
"""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.recording.journal import Journal
from fasaco_edge.recording.sdk import rr

# A curve goes on as a step (``styles``); at the latest after so long it is drawn anyway, so
# that a part, and what follows a gap, soon has all of them.
PERIOD_NS = 60_000_000_000
# Latencies and memory tremble: by less than this share of them nothing has changed.
TREMBLE = 0.1


@dataclass(slots=True)
class _Curve:
    drawn: float
    drawn_ns: int
    last: float


class Curves:
    """Draws figures into a journal."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._curves: dict[str, _Curve] = {}

    def draw(self, entity: str, value: float, tremble: float = 0.0, spacing_ns: int = 0) -> None:
        """Draw ``value`` where it differs from the one drawn.

        Args:
            entity: what to draw it as.
            value: the figure as it is now.
            tremble: the share of it by which it has to differ by more.
            spacing_ns: the least time from one drawn to the next [ns].
        """
        now_ns = self._journal.wall_ns
        curve = self._curves.get(entity)
        if curve is None:
            curve = self._curves[entity] = _Curve(value, now_ns, value)
        else:
            curve.last = value
            same = abs(value - curve.drawn) <= tremble * abs(curve.drawn)
            if now_ns - curve.drawn_ns < (PERIOD_NS if same else spacing_ns):
                return
        self._draw(entity, curve)

    def finish(self) -> None:
        """Draw what each figure was in the end."""
        for entity, curve in self._curves.items():
            if curve.last != curve.drawn:
                self._draw(entity, curve)

    def _draw(self, entity: str, curve: _Curve) -> None:
        curve.drawn, curve.drawn_ns = curve.last, self._journal.wall_ns
        self._journal.log(entity, rr.Scalars(curve.last))
