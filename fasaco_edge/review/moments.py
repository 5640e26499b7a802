"""States of a recording and their durations, longest standstill, replans, refused messages."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import msgspec
import numpy as np

from fasaco_edge.review.run_data import PathSample, RunData, StatusSample
from fasaco_edge.states import TROUBLED, Activity, states_of

# Smaller changes of the pose do not count as motion.
STILL_M = 0.05
STILL_RAD = 0.1
# States without work for the robot.
AT_REST = {*states_of(Activity.NONE, Activity.CHARGING), "silent"}
TROUBLES = {*TROUBLED, "silent"}
RECORDER_IN_ORDER = ("recording", "stopping")
# Beginning of the details in a reason: "path blocked at cell (2, 3)" has the kind "path blocked".
_DETAIL = re.compile(r":| at cell|,| \d")
# Texts of ``grid.reachable_area.AreaChange``.
_MAP = "map: "
_CHANGES = ("more", "fewer", "passages changed")


@dataclass(frozen=True, slots=True)
class Span:
    """A period of a state [s], and its reason."""

    name: str
    begin_s: float
    end_s: float
    reason: str = ""

    @property
    def seconds(self) -> float:
        """Its duration [s]."""
        return self.end_s - self.begin_s


class Stand(msgspec.Struct, frozen=True):
    """A standstill of the robot: time [s], place (x, y) [m], states of the mission meanwhile.

    ``reason``: that of the path in the middle of it, if this path leads nowhere; else "".
    """

    at_s: float
    seconds: float
    x: float
    y: float
    states: list[str]
    reason: str = ""


def spans_of(entered: Sequence[tuple[float, str, str]], end_s: float) -> tuple[Span, ...]:
    """Return the periods of states; ``entered``: time [s], state and reason of each entry."""
    spans: list[Span] = []
    for at_s, state, reason in entered:
        # Each part repeats the state in force at its beginning.
        if spans and spans[-1].name == state:
            continue
        if spans:
            spans[-1] = Span(spans[-1].name, spans[-1].begin_s, at_s, spans[-1].reason)
        spans.append(Span(state, at_s, end_s, reason))
    return tuple(spans)


def troubles_at_rest(statuses: Sequence[StatusSample], end_s: float) -> list[Span]:
    """Return the periods of troubles outside the states of ``TROUBLES``.

    The name of a period is the state in which it began, its reason is the trouble's text.
    """
    found: list[Span] = []
    lasting: dict[str, Span] = {}
    for each in statuses:
        status = each.status
        is_reason = status.state in TROUBLES
        present = {} if is_reason else {one.code: one.text for one in status.troubles}
        for code in lasting.keys() - present.keys():
            found.append(replace(lasting.pop(code), end_s=each.at_s))
        for code, text in present.items():
            lasting.setdefault(code, Span(status.state, each.at_s, end_s, text))
    return [*found, *lasting.values()]


def longest_stand(data: RunData, states: Sequence[Span]) -> Stand | None:
    """Return the longest standstill during a mission; None without any."""
    # A mission lasts from its first plan to its end, pauses included.
    runs = [list(run) for rests, run in groupby(states, lambda s: s.name in AT_REST) if not rests]
    found = [_stand(data, run[0].begin_s, run[-1].end_s) for run in runs]
    longest = max(filter(None, found), key=lambda stand: stand[1], default=None)
    if longest is None:
        return None
    since, seconds, x, y = (round(value, 3) for value in longest)
    meanwhile = [s.name for s in states if since < s.end_s and s.begin_s < since + seconds]
    path = next((p.about for p in reversed(data.paths) if p.at_s <= since + seconds / 2), None)
    reason = path.reason if path is not None and path.steps == 0 else ""
    return Stand(since, seconds, x, y, list(dict.fromkeys(meanwhile)), reason)


def _stand(data: RunData, begin_s: float, end_s: float) -> tuple[float, float, float, float] | None:
    """Return time, duration [s], x, y [m] of the longest standstill; None without a pose."""
    chosen = (data.times >= begin_s) & (data.times <= end_s)
    times, poses = data.times[chosen].tolist(), data.track[chosen].tolist()
    if not times:
        return None
    best, anchor = (times[0], 0.0, *poses[0][:2]), 0
    for index, (x, y, yaw) in enumerate(poses):
        x0, y0, yaw0 = poses[anchor]
        turned = abs(math.remainder(yaw - yaw0, math.tau))
        if math.hypot(x - x0, y - y0) > STILL_M or turned > STILL_RAD:
            anchor = index
        elif (seconds := times[index] - times[anchor]) > best[1]:
            best = times[anchor], seconds, x0, y0
    return best


@dataclass(frozen=True, slots=True)
class Replans:
    """The planned paths: the first plan, and the replans.

    Attributes:
        first: the first planned path.
        later: the replans in order, without the first plan after each restart of the daemon.
    """

    first: PathSample | None
    later: tuple[PathSample, ...]

    @classmethod
    def of(cls, paths: Sequence[PathSample]) -> Replans:
        """Return the plans among ``paths``."""
        planned = [path for path in paths if path.about.planner]
        later = [
            after
            for before, after in pairwise(planned)
            if after.about.revision > before.about.revision
        ]
        return cls(planned[0] if planned else None, tuple(later))

    @property
    def by_reason(self) -> dict[str, int]:
        """Number of replans for each kind of reason, the most frequent first."""
        return dict(Counter(kind_of(path.about.reason) for path in self.later).most_common())

    @property
    def slowest_first(self) -> list[PathSample]:
        """Replans with a known duration, the slowest first."""
        timed = [path for path in self.later if path.plan_ms is not None]
        return sorted(timed, key=lambda path: -(path.plan_ms or 0.0))

    def milliseconds(self, percent: float) -> float | None:
        """Return a percentile of the durations [ms], by nearest rank; None without any."""
        took = [path.plan_ms for path in self.later if path.plan_ms is not None]
        return float(np.percentile(took, percent, method="inverted_cdf")) if took else None


def kind_of(reason: str) -> str:
    """Return ``reason`` without details; for a change of the map, with the kind of change."""
    if reason.startswith(_MAP):
        changes = [change for change in _CHANGES if change in reason]
        cells = "" if "passages changed" in changes else "cells "
        return _MAP + cells + " and ".join(changes) if changes else "map"
    return _DETAIL.split(reason, maxsplit=1)[0].strip() or "no reason given"


def refused_by_code(data: RunData) -> dict[str, int]:
    """Return the number of messages refused by the daemon, whose restart resets its counts."""
    total = Counter[str]()
    counted = [each.status.errors.by_code for each in data.statuses]
    for before, now in pairwise((*counted, {})):
        total.update({code: count for code, count in before.items() if now.get(code, 0) < count})
    return dict(sorted(total.items()))
