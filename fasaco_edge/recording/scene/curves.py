"""Curves of a recording: the table of all figures over time, each drawn only when it changes.

Each flush, once a second, begins a chunk for each entity drawn since the last flush: an entity
drawn once a second takes five megabytes an hour, whatever its content.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.archetypes import COVERED_COLOUR, REVISITED_COLOUR, Colour
from fasaco_edge.recording.scene.runcard import cells_of
from fasaco_edge.recording.sdk import rr, rrb
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.status import Recorder, Status
from fasaco_edge.wire.messages.pheromone import PheromoneMessage

# Longest time between two drawings of a figure: a new part, or the time after a gap, shows every
# curve within a minute.
PERIOD_NS = 60_000_000_000
# Relative changes of latencies, memory and processor time, and of the battery, that are ignored.
NOISE, BATTERY_NOISE = 0.1, 0.02
# Least time between drawings of shares, which change about once a second, and of counts.
SHARE_NS, COUNT_NS = 2_000_000_000, 30_000_000_000
# Shortest period over which a rate is averaged [s].
LEAST_RATE_S = 30.0
# Larger gaps, of the last metres, say nothing about the mission.
MOST_GAP = 2.0

Message = TypeVar("Message")


class Plot(NamedTuple):
    """A plot of the layout: its title, the corner of its legend, the top of its axis (0: any)."""

    title: str
    legend: rrb.Corner2D
    top: float = 0.0


@dataclass(frozen=True, slots=True)
class Curve(Generic[Message]):
    """A figure over time.

    Attributes:
        entity: its entity in the recording.
        of: returns the figure in a message; None if it is unknown.
        plot, name, colour: where and how the layout shows it; it may have no plot.
        noise: relative change up to which it is not drawn.
        spacing_ns: least time between two drawings [ns].
        is_sum: whether to draw the sum over all messages.
        over: returns a time [s], to draw the mean rate of the figure over it.
    """

    entity: str
    of: Callable[[Message], float | None]
    plot: Plot | None = None
    name: str = ""
    colour: Colour = (0, 0, 0)
    noise: float = 0.0
    spacing_ns: int = 0
    is_sum: bool = False
    over: Callable[[Message], float] | None = None


def _covered(status: Status) -> float | None:
    cells = cells_of(status)
    return cells[0] / cells[1] if cells and cells[1] else None


def _again(status: Status) -> float | None:
    count = status.coverage
    return count.recovered / count.coverable if count and count.coverable else None


def _battery(status: Status) -> float | None:
    battery = status.battery
    return 100 * battery.level if battery and battery.level is not None else None


LEFT, RIGHT = rrb.Corner2D.LeftTop, rrb.Corner2D.RightTop
COVERAGE = Plot("Cells covered [share]", LEFT, 1.1)
LATENCY = Plot("Latency [ms]", RIGHT)
GAP = Plot("Time above the least possible, as a share of it", RIGHT, MOST_GAP)
SAVED = Plot("Driving time saved by search, summed over all plans [s]", LEFT)
MEMORY = Plot("Memory [MB]", LEFT)
USED = Plot("Processor [% of a core], battery [%]", RIGHT)
DETAILS = (LATENCY, GAP, SAVED, MEMORY, USED)
"""The plots of the layout's second page."""

BLUE, ORANGE, VIOLET, GREEN = COVERED_COLOUR, REVISITED_COLOUR, (167, 139, 250), (52, 211, 153)
YELLOW, PINK, GREY = (250, 204, 21), (244, 114, 182), (156, 163, 175)

OF_STATUS: tuple[Curve[Status], ...] = (
    Curve(entities.COVERED_FRACTION, _covered, COVERAGE, "covered", BLUE, spacing_ns=SHARE_NS),
    Curve("metrics/coverage/recovered", _again, COVERAGE, "again", ORANGE, spacing_ns=SHARE_NS),
    Curve("metrics/latency/ingest", lambda s: s.latency_ms.ingest, LATENCY, "map in", BLUE, NOISE),
    Curve("metrics/latency/plan", lambda s: s.latency_ms.plan, LATENCY, "plan", VIOLET, NOISE),
    Curve("metrics/latency/map_to_path", lambda s: s.latency_ms.map_to_path,
          LATENCY, "map to path", ORANGE, NOISE),
    Curve("metrics/plan/line_gap", lambda s: s.path.line_gap if s.path else None,
          GAP, "gap of the line", GREEN, NOISE),
    # 0 means unknown.
    Curve(entities.DAEMON_MEMORY, lambda s: s.rss_mb or None, MEMORY, "daemon MB", VIOLET, NOISE),
    Curve("metrics/resources/processor", lambda s: 100 * s.cpu_s,
          USED, "daemon %", ORANGE, NOISE, over=lambda s: s.uptime_s),
    Curve("metrics/resources/battery", _battery, USED, "battery %", GREEN, BATTERY_NOISE),
)  # fmt: skip
OF_PATH: tuple[Curve[PathAttachment], ...] = (
    Curve("metrics/plan/gap", lambda p: p.gap, GAP, "gap of the walk", YELLOW),
    Curve("metrics/saved/ants", lambda p: p.saved_by_ants_s, SAVED, "ants", PINK, is_sum=True),
    Curve("metrics/saved/local_search", lambda p: p.saved_by_local_search_s,
          SAVED, "local search", BLUE, is_sum=True),
)  # fmt: skip
OF_RECORDER: tuple[Curve[Recorder], ...] = (
    Curve(entities.RECORDER_MEMORY, lambda r: r.rss_mb, MEMORY, "recorder MB", GREY, NOISE),
    Curve(entities.RECORDER_CPU_S, lambda r: r.cpu_s or None, spacing_ns=COUNT_NS),
)
# These limits are needed to convert levels to pheromone.
OF_PHEROMONE: tuple[Curve[PheromoneMessage], ...] = (
    Curve(f"{entities.PHEROMONE_RANGE}/min", lambda message: message.trail_min),
    Curve(f"{entities.PHEROMONE_RANGE}/max", lambda message: message.trail_max),
)
CURVES: tuple[Curve[Any], ...] = (*OF_STATUS, *OF_PATH, *OF_RECORDER, *OF_PHEROMONE)


@dataclass(slots=True)
class _Drawn:
    drawn: float
    drawn_ns: int
    last: float


class Curves:
    """Draws figures into a writer."""

    def __init__(self, writer: RecordingWriter) -> None:
        self._writer = writer
        self._drawn: dict[str, _Drawn] = {}
        # Of each rate, time [s] and figure at the beginning of its period.
        self._since: dict[str, tuple[float, float]] = {}
        for curve in CURVES:
            if curve.plot is not None:
                line = rr.SeriesLines(
                    names=curve.name, colors=curve.colour, widths=1.5,
                    interpolation_mode="StepAfter",
                )  # fmt: skip
                writer.log_static(curve.entity, line)

    def add(self, curves: Sequence[Curve[Message]], message: Message) -> None:
        """Draw the figures of a message."""
        for curve in curves:
            value = curve.of(message)
            if value is not None and curve.over is not None:
                value = self._rate(curve.entity, value, curve.over(message))
            if value is not None:
                drawn = self._drawn.get(curve.entity) if curve.is_sum else None
                value += drawn.last if drawn else 0.0
                self.draw(curve.entity, value, curve.noise, curve.spacing_ns)

    def draw(self, entity: str, value: float, noise: float = 0.0, spacing_ns: int = 0) -> None:
        """Draw ``value`` if it differs from the last drawn value; see ``Curve`` for the others."""
        now_ns = self._writer.wall_ns
        curve = self._drawn.get(entity)
        if curve is None:
            curve = self._drawn[entity] = _Drawn(value, now_ns, value)
        else:
            curve.last = value
            same = abs(value - curve.drawn) <= noise * abs(curve.drawn)
            if now_ns - curve.drawn_ns < (PERIOD_NS if same else spacing_ns):
                return
        self._draw(entity, curve)

    def finish(self) -> None:
        """Draw the last value of each figure."""
        for entity, curve in self._drawn.items():
            if curve.last != curve.drawn:
                self._draw(entity, curve)

    def _draw(self, entity: str, curve: _Drawn) -> None:
        curve.drawn, curve.drawn_ns = curve.last, self._writer.wall_ns
        self._writer.log(entity, rr.Scalars(curve.last))

    def _rate(self, entity: str, value: float, now_s: float) -> float | None:
        """Return the mean rate of a figure since its last one; None in between."""
        since = self._since.get(entity)
        if since is None or now_s < since[0]:  # the daemon was restarted
            self._since[entity] = now_s, value
        elif now_s - since[0] >= LEAST_RATE_S:
            self._since[entity] = now_s, value
            return (value - since[1]) / (now_s - since[0])
        return None
