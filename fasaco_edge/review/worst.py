"""The worst moments of a mission, one of each kind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.review.moments import (
    Moment,
    Span,
    largest_drop,
    longest_gap,
    longest_stand,
    under_way,
)
from fasaco_edge.review.replans import Replans
from fasaco_edge.review.story import Story


def worst_moments(
    story: Story,
    states: tuple[Span, ...],
    replans: Replans,
    fractions: NDArray[np.float64],
) -> tuple[Moment, ...]:
    """Return the worst of each kind of moment there was.

    Args:
        story: what the samples tell.
        states: of the mission, in order.
        replans: plans made anew.
        fractions: float64 (n, 2), when [s] and the covered share as the daemon told it.
    """
    found: list[Moment | None] = []
    for during in under_way(states):
        found += [
            longest_stand(story.times, story.trail, during, states),
            longest_gap("longest time without a pose", story.pose_s, during),
            longest_gap("longest time without a map", story.map_s, during),
        ]
    slowest = replans.slowest
    if slowest is not None and slowest.plan_ms is not None:
        found.append(Moment("slowest replan", slowest.plan_ms, "ms", slowest.at_s, slowest.reason))
    found.append(largest_drop(fractions, story.map_s, [at_s for at_s, _, _ in story.commands]))
    # A mission that was begun again has its moments each time: the worst one counts.
    worst: dict[str, Moment] = {}
    for moment in found:
        if moment is not None and (
            moment.what not in worst or moment.value > worst[moment.what].value
        ):
            worst[moment.what] = moment
    return tuple(worst.values())
