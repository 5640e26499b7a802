"""When searches end: by the clock, their work, their quality, or because somebody asks."""

import time

import pytest

from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.planner import SearchProgress, TimeBudget, WorkLimit


def progress(steps=100, bound=0, **work):
    return SearchProgress(SearchWork(**work), float(steps), steps, bound)


def test_a_budget_is_used_up_with_time():
    assert not TimeBudget(60.0)(progress())
    assert TimeBudget(60.0, started=time.monotonic() - 60.0)(progress())


@pytest.mark.parametrize(
    ("done", "reached"),
    [
        ((4, 7, 90), False),
        ((5, 6, 90), False),
        ((5, 7, 89), False),
        ((5, 7, 90), True),
        ((6, 8, 91), True),
    ],
)
def test_a_work_limit_is_reached_once_every_count_is(done, reached):
    limit = WorkLimit(SearchWork(ants=5, perturbations=7, proposals=90))
    assert limit(SearchProgress(SearchWork(*done), 1.0, 1)) is reached
