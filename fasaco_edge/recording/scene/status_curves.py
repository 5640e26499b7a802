"""Curves of figures over time: a figure is drawn only when it changes.

Each flush, once a second, begins a chunk for each entity drawn since the last flush: an entity
drawn once a second takes five megabytes an hour, whatever its content.
"""

from __future__ import annotations

from dataclasses import dataclass

from msgspec.structs import asdict

from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.archetypes import COVERED_COLOUR, REVISITED_COLOUR, Colour
from fasaco_edge.recording.scene.runcard import cells_of
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.status import Status

# Longest time between two drawings of a figure: a new part, or the time after a gap, shows every
# curve within a minute.
PERIOD_NS = 60_000_000_000
# Relative changes of latencies and memory up to this are ignored.
NOISE = 0.1
BATTERY_NOISE = 0.02

# Entity, name in the legend, colour of each curve in a plot.
CURVES: tuple[tuple[str, str, Colour], ...] = (
    (entities.COVERED_FRACTION, "covered", COVERED_COLOUR),
    (entities.REVISITED_FRACTION, "again", REVISITED_COLOUR),
    (f"{entities.LATENCY}/ingest", "map in", (56, 152, 222)),
    (f"{entities.LATENCY}/plan", "plan", (167, 139, 250)),
    (f"{entities.LATENCY}/map_to_path", "map to path", (245, 140, 40)),
    (entities.GAP, "gap of the walk", (250, 204, 21)),
    (entities.LINE_GAP, "gap of the line", (52, 211, 153)),
    (entities.SAVED_BY_ANTS, "ants", (244, 114, 182)),
    (entities.SAVED_BY_LOCAL_SEARCH, "local search", (56, 152, 222)),
    (f"{entities.MEMORY}/planner", "daemon MB", (167, 139, 250)),
    (f"{entities.MEMORY}/recorder", "recorder MB", (156, 163, 175)),
    (entities.PROCESSOR, "daemon %", (245, 140, 40)),
    (entities.BATTERY, "battery %", (52, 211, 153)),
)

# Least time between drawings of the covered share, which changes about once a second.
SHARE_SPACING_NS = 2_000_000_000
# Least time between drawings of counts that grow all the time.
COUNT_SPACING_NS = 30_000_000_000
# Shortest period over which processor time is averaged [s].
LEAST_SHARE_S = 30.0

SAVED = (entities.SAVED_BY_ANTS, entities.SAVED_BY_LOCAL_SEARCH)


@dataclass(slots=True)
class _Curve:
    drawn: float
    drawn_ns: int
    last: float


class Curves:
    """Draws figures into a writer, among them those of statuses and paths."""

    def __init__(self, writer: RecordingWriter) -> None:
        self._writer = writer
        self._curves: dict[str, _Curve] = {}
        # Uptime and processor time [s] at the beginning of the current period.
        self._since: tuple[float, float] | None = None
        # Time saved by ants and by local search, over all plans [s].
        self._saved = [0.0, 0.0]
        for entity, name, colour in CURVES:
            line = rr.SeriesLines(
                names=name, colors=colour, widths=1.5, interpolation_mode="StepAfter"
            )
            writer.log_static(entity, line)

    def draw(self, entity: str, value: float, noise: float = 0.0, spacing_ns: int = 0) -> None:
        """Draw ``value`` if it differs from the last drawn value.

        Args:
            entity: the entity to draw.
            value: the current figure.
            noise: relative change up to which the value is not drawn.
            spacing_ns: least time between two drawings [ns].
        """
        now_ns = self._writer.wall_ns
        curve = self._curves.get(entity)
        if curve is None:
            curve = self._curves[entity] = _Curve(value, now_ns, value)
        else:
            curve.last = value
            same = abs(value - curve.drawn) <= noise * abs(curve.drawn)
            if now_ns - curve.drawn_ns < (PERIOD_NS if same else spacing_ns):
                return
        self._draw(entity, curve)

    def finish(self) -> None:
        """Draw the last value of each figure."""
        for entity, curve in self._curves.items():
            if curve.last != curve.drawn:
                self._draw(entity, curve)

    def _draw(self, entity: str, curve: _Curve) -> None:
        curve.drawn, curve.drawn_ns = curve.last, self._writer.wall_ns
        self._writer.log(entity, rr.Scalars(curve.last))

    def add_status(self, status: Status) -> None:
        """Draw the numbers of a status."""
        for name, milliseconds in asdict(status.latency_ms).items():
            if milliseconds is not None:
                self.draw(f"{entities.LATENCY}/{name}", milliseconds, NOISE)
        # 0 means unknown.
        if status.rss_mb:
            self.draw(f"{entities.MEMORY}/planner", status.rss_mb, NOISE)
        if status.uptime_s:
            self._add_processor(status.uptime_s, status.cpu_s)
        if status.battery is not None and status.battery.level is not None:
            self.draw(entities.BATTERY, 100 * status.battery.level, BATTERY_NOISE)
        cells, counts = cells_of(status), status.coverage
        if cells is not None and cells[1]:
            share = cells[0] / cells[1]
            self.draw(entities.COVERED_FRACTION, share, spacing_ns=SHARE_SPACING_NS)
        if counts is not None and counts.coverable:
            again = counts.recovered / counts.coverable
            self.draw(entities.REVISITED_FRACTION, again, spacing_ns=SHARE_SPACING_NS)
        if status.path is not None and status.path.line_gap is not None:
            self.draw(entities.LINE_GAP, status.path.line_gap, NOISE)

    def add_path(self, about: PathAttachment) -> None:
        """Draw the quality of a planned path."""
        if about.gap is not None:
            self.draw(entities.GAP, about.gap)
        if about.saved_by_ants_s is not None and about.saved_by_local_search_s is not None:
            self._saved[0] += about.saved_by_ants_s
            self._saved[1] += about.saved_by_local_search_s
            for entity, seconds in zip(SAVED, self._saved, strict=True):
                self.draw(entity, seconds)

    def _add_processor(self, uptime_s: float, cpu_s: float) -> None:
        since = self._since
        if since is None or uptime_s < since[0]:  # the daemon was restarted
            self._since = uptime_s, cpu_s
        elif uptime_s - since[0] >= LEAST_SHARE_S:
            percent = 100 * (cpu_s - since[1]) / (uptime_s - since[0])
            self._since = uptime_s, cpu_s
            self.draw(entities.PROCESSOR, percent, NOISE)
