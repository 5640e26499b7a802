"""Charts of a review over time, and a curve in text characters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.chart import COLOURS, Axis, Line, Panel
from fasaco_edge.drawing.palette import Colour
from fasaco_edge.review.review import Review

Points = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Times [s], and the values from then on; both float64 (n,)."""


def replan_times(review: Review) -> Points:
    """Return the time [s] and duration [ms] of each replan."""
    timed = [path for path in review.replans.later if path.plan_ms is not None]
    return (
        np.array([path.at_s for path in timed], np.float64),
        np.array([path.plan_ms for path in timed], np.float64),
    )


MOST_POINTS = 700
FAINT: Colour = (150, 156, 166)
# States from the bottom up; other states are drawn as the last one.
STATES: dict[str, Colour] = {
    "done": palette.BLUE,
    "returning": palette.SKY,
    "charging": palette.SKY,
    "covering": palette.GREEN,
    "planning": palette.SKY,
    "paused": palette.PURPLE,
    "degraded": palette.ORANGE,
    "blocked": palette.VERMILION,
    "silent": palette.VERMILION,
}
SHORT = {"waiting for map": "no map", "waiting for pose": "no pose"}
BAND_PX = 12
# Least width of a state, as a share of the whole time: short ones stay visible.
LEAST_SHARE = 0.006


@dataclass(frozen=True, slots=True)
class TimeAxis:
    """The axis of time, and seconds per unit of it."""

    axis: Axis
    unit_s: float

    @classmethod
    def over(cls, seconds: float) -> TimeAxis:
        """Return an axis from 0 to ``seconds``."""
        unit_s, name = next(
            (unit_s, name)
            for unit_s, name, least_s in ((3600.0, "h", 14400.0), (60.0, "min", 240.0), (1, "s", 0))
            if seconds >= least_s
        )
        axis = Axis.linear(f"time since the recording began [{name}]", [seconds / unit_s])
        return cls(axis, unit_s)

    def points(
        self, at_s: NDArray[np.float64], values: NDArray[np.float64]
    ) -> tuple[tuple[float, float], ...]:
        """Return points of a line, not more than can be distinguished."""
        places = np.unique(np.linspace(0, len(at_s) - 1, MOST_POINTS).round().astype(int))
        chosen = places if len(at_s) > MOST_POINTS else np.arange(len(at_s))
        pairs = np.column_stack((at_s[chosen] / self.unit_s, values[chosen]))
        return tuple((float(x), float(y)) for x, y in pairs)


def coverage_panel(reviews: Sequence[Review], labels: Sequence[str]) -> Panel:
    """Return a chart of the covered share; ``labels`` name two reviews."""
    time = TimeAxis.over(max(review.duration_s for review in reviews))
    lines = [
        Line(
            label if len(reviews) > 1 else "", colour, _curve(time, review), dotted=False, width=2.2
        )
        for review, label, colour in zip(reviews, labels, COLOURS, strict=False)
    ]
    caption = "of all cells known at the end"
    y = Axis.linear("%", [100.0])
    return Panel("Covered share of all cells", caption, time.axis, y, tuple(lines))


def replan_panel(reviews: Sequence[Review], labels: Sequence[str]) -> Panel:
    """Return a chart of the durations of replans, a dot each."""
    time = TimeAxis.over(max(review.duration_s for review in reviews))
    found = [replan_times(review) for review in reviews]
    # Two reviews have the colours of their curves; a single one has another colour than the curve
    # above.
    colours = COLOURS if len(reviews) > 1 else COLOURS[1:]
    lines = [
        Line(label if len(reviews) > 1 else "", colour, _dots(time, at_s, took_ms), joined=False)
        for (at_s, took_ms), label, colour in zip(found, labels, colours, strict=False)
    ]
    y = Axis.linear("ms", [value for _, took_ms in found for value in took_ms.tolist()] or [1.0])
    return Panel("Time of each replan", "", time.axis, y, tuple(lines))


def state_panel(review: Review) -> Panel:
    """Return a chart of the mission's states, a bar for each period."""
    time = TimeAxis.over(review.duration_s)
    known = [name for name in STATES if any(span.name == name for span in review.states)]
    others = [span.name for span in review.states if span.name not in STATES]
    names = [*known, *reversed(dict.fromkeys(others))]
    least_s = LEAST_SHARE * review.duration_s
    lines = []
    for span in review.states:
        level = float(names.index(span.name))
        begin, end = span.begin_s, max(span.end_s, span.begin_s + least_s)
        points = ((begin / time.unit_s, level), (end / time.unit_s, level))
        colour = STATES.get(span.name, FAINT)
        lines.append(Line("", colour, points, dotted=False, width=BAND_PX))
    ticks = tuple((float(level), SHORT.get(name, name)) for level, name in enumerate(names))
    y = Axis("", -0.7, max(len(names) - 0.3, 0.7), ticks)
    return Panel("State of the mission", "", time.axis, y, tuple(lines))


def _curve(time: TimeAxis, review: Review) -> tuple[tuple[float, float], ...]:
    at_s, shares = review.covered_share.T
    if not len(at_s):
        return ()
    at_s = np.concatenate(([at_s[0]], at_s, [review.duration_s]))
    return time.points(at_s, 100 * np.concatenate(([0.0], shares, shares[-1:])))


def _dots(
    time: TimeAxis, at_s: NDArray[np.float64], took_ms: NDArray[np.float64]
) -> tuple[tuple[float, float], ...]:
    """Return a dot for each replan; of very many the slowest of each stretch of time."""
    if len(at_s) > MOST_POINTS:
        stretches = np.array_split(np.arange(len(at_s)), MOST_POINTS)
        chosen = np.array([part[np.argmax(took_ms[part])] for part in stretches])
        at_s, took_ms = at_s[chosen], took_ms[chosen]
    return time.points(at_s, took_ms)


EIGHTHS, PLAIN_EIGHTHS = " ▁▂▃▄▅▆▇█", " ..::++##"


def curve(
    at_s: NDArray[np.float64],
    shares: NDArray[np.float64],
    end_s: float,
    width: int,
    height: int,
    marks: str = EIGHTHS,
) -> list[str]:
    """Return a curve of a share over time as lines of text, the top one first.

    Args:
        at_s: float64 (n,), times of its changes [s], ascending.
        shares: float64 (n,), its values from then on, 0 to 1; before the first time it is 0.
        end_s: the right end of the picture [s]; the left one is 0.
        width, height: of the picture [characters].
        marks: nine characters, from an empty one to a full one.
    """
    places = (np.arange(width) + 1) / width * end_s
    index = np.searchsorted(at_s, places, side="right")
    levels = np.concatenate(([0.0], shares))[index]
    eighths = np.rint(np.clip(levels, 0, 1) * height * 8).astype(int)
    # A value above 0 never looks like 0, and a value below 1 never like 1.
    eighths[(levels > 0) & (eighths == 0)] = 1
    eighths[(levels < 1) & (eighths == 8 * height)] -= 1
    return [
        "".join(marks[min(max(eighth - 8 * row, 0), 8)] for eighth in eighths.tolist())
        for row in reversed(range(height))
    ]
