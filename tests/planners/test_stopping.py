"""When searches end: by the clock, their work, their quality, or because somebody asks."""

import threading
import time

import pytest

from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.planner import (
    AnyOf,
    GapReached,
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


@pytest.mark.parametrize(
    ("steps", "bound", "target", "reached"),
    [
        (101, 100, 0.01, True),
        (102, 100, 0.01, False),
        (100, 100, 0.0, True),
        (101, 100, 0.0, False),
        # Where (1 + target) * bound or steps / bound - 1 would be a bit off.
        (115, 100, 0.15, True),
        (129, 100, 0.29, True),
        # No bound is known.
        (0, 0, 1.0, False),
        (100, 0, 10.0, False),
    ],
)
def test_a_gap_is_reached_by_a_proven_bound_alone(steps, bound, target, reached):
    assert GapReached(target)(progress(steps, bound)) is reached


def test_an_interrupt_is_shared():
    stopping = threading.Event()
    interrupt = Interrupt(stopping)
    assert not interrupt(progress())
    stopping.set()
    assert interrupt(progress())
    assert Interrupt() != Interrupt()


def test_any_of_several_criteria_ends_a_search():
    criteria = AnyOf(GapReached(0.5), WorkLimit(SearchWork(ants=10)))
    assert not criteria(progress(200, 100, ants=9))
    assert criteria(progress(150, 100, ants=9))
    assert criteria(progress(200, 100, ants=10))
    assert not AnyOf()(progress(100, 100, ants=1000))
