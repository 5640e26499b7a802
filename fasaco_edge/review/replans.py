"""Why and how fast plans were made anew."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from fasaco_edge.bench.spread import percentile
from fasaco_edge.review.story import TakenPath

# "path blocked at cell (2, 3)" is of the kind "path blocked".
_DETAIL = re.compile(r":| at cell|,| \d")
# As ``mission.ground.GroundChange`` says them.
_MAP = "map: "
_CHANGES = ("more", "fewer", "passages changed")


@dataclass(frozen=True, slots=True)
class Replans:
    """The paths that were planned, the first apart from those that came later.

    Attributes:
        first: the first planned path.
        later: all others, in order, without the first ones of a daemon that was started again.
    """

    first: TakenPath | None
    later: tuple[TakenPath, ...]

    @classmethod
    def of(cls, paths: Sequence[TakenPath]) -> Replans:
        """Sort out ``paths``; those that no plan was needed for are none."""
        planned = [path for path in paths if path.planner]
        later = [after for before, after in pairwise(planned) if after.revision > before.revision]
        return cls(planned[0] if planned else None, tuple(later))

    @property
    def by_reason(self) -> dict[str, int]:
        """How many there were of each kind of reason, the most frequent first."""
        return dict(Counter(kind_of(path.reason) for path in self.later).most_common())

    @property
    def spread_by_reason(self) -> dict[str, tuple[float | None, float | None]]:
        """The median and the slowest [ms] of each kind of reason, the most frequent first."""
        took: dict[str, list[float]] = {kind: [] for kind in self.by_reason}
        for path in self.later:
            if path.plan_ms is not None:
                took[kind_of(path.reason)].append(path.plan_ms)
        return {kind: (percentile(ms, 50), percentile(ms, 100)) for kind, ms in took.items()}

    def slowest_first(self, most: int) -> list[TakenPath]:
        """Return up to ``most`` of them, those that took longest first."""
        return sorted(self.later, key=lambda path: -(path.plan_ms or 0.0))[:most]

    @property
    def slowest(self) -> TakenPath | None:
        """The one that took longest."""
        timed = [path for path in self.later if path.plan_ms is not None]
        return max(timed, key=lambda path: path.plan_ms or 0.0, default=None)

    def milliseconds(self, percent: float) -> float | None:
        """Return a percentile of what they took [ms], by nearest rank."""
        return percentile([p.plan_ms for p in self.later if p.plan_ms is not None], percent)


def kind_of(reason: str) -> str:
    """Return ``reason`` without its details; of a map, whether cells came or went."""
    if reason.startswith(_MAP):
        changes = [change for change in _CHANGES if change in reason]
        cells = "" if "passages changed" in changes else "cells "
        return _MAP + cells + " and ".join(changes) if changes else "map"
    return _DETAIL.split(reason, maxsplit=1)[0].strip() or "no reason told"
