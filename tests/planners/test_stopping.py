"""When searches end: by the clock, their work, their quality, or because somebody asks."""

import threading
import time

import pytest

from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.planner import (
    AnyOf,
    Interrupt,
    SearchProgress,
    TimeBudget,
    WorkLimit,
)


def progress(steps=100, bound=0, **work):
    return SearchProgress(SearchWork(**work), float(steps), steps, bound)


def test_work_is_added_count_by_count():
    assert SearchWork(1, 2, 3) + SearchWork(40, 50, 60) == SearchWork(41, 52, 63)
    assert SearchWork() + SearchWork(ants=5) == SearchWork(5, 0, 0)


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


def test_an_interrupt_is_shared():
    stopping = threading.Event()
    interrupt = Interrupt(stopping)
    assert not interrupt(progress())
    stopping.set()
    assert interrupt(progress())
    assert Interrupt() != Interrupt()


def test_any_of_several_criteria_ends_a_search():
    criteria = AnyOf(lambda seen: seen.steps <= 150, WorkLimit(SearchWork(ants=10)))
    assert not criteria(progress(200, 100, ants=9))
    assert criteria(progress(150, 100, ants=9))
    assert criteria(progress(200, 100, ants=10))
    assert not AnyOf()(progress(100, 100, ants=1000))
