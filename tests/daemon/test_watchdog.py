"""The watchdog is fed by progress, and by nothing else; how long turns take is told."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from fasaco_edge.daemon.counters import LATE_S, CycleTimes
from fasaco_edge.daemon.loop.worker import PlanningWorker
from fasaco_edge.daemon.notify import Watchdog, status_line
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.events import PlanRequest
from fasaco_edge.planners.paper.fasaco import Fasaco
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.wire.documents.path_documents import PathReport
from fasaco_edge.wire.documents.replies import CoverageReport, FloorLeft, FloorReport
from fasaco_edge.wire.documents.status import LedgerReport, LoopTimes, Status


class Told:
    watchdog_s = 4.0

    def __init__(self) -> None:
        self.beats = 0

    def alive(self) -> None:
        self.beats += 1


class Hung:
    def __init__(self) -> None:
        self.release = threading.Event()

    def plan(self, problem, stop, observe):
        self.release.wait()
        return Fasaco().plan(problem)


class Slow:
    def plan(self, problem, stop, observe):
        while not stop(None):
            time.sleep(0.01)
        return Fasaco().plan(problem)


@pytest.fixture
def problem():
    cells = np.zeros((4, 4), np.int8)
    grid = OccupancyGrid(GridGeometry(4, 4, 1.0, Pose2D(0.0, 0.0)), cells)
    lattice = CoverageLattice.from_map(grid, Footprint(1.0, 0.4))
    return CoverageProblem.of(lattice, (0, 0))


def beats(worker: PlanningWorker, turns: int = 5) -> int:
    told = Told()
    vitals = Watchdog(told)
    for turn in range(turns):
        vitals.beat(worker, 2.0 * turn)
        time.sleep(0.3)
    return told.beats


def test_an_idle_worker_counts_as_progress():
    worker = PlanningWorker(Fasaco(), 0.1, lambda *_: None)
    assert beats(worker) == 5
    worker.close(1.0)


def test_a_search_that_gets_on_feeds_it(problem):
    worker = PlanningWorker(Slow(), 60.0, lambda *_: None)
    worker.submit(PlanRequest(1, problem, "test"))
    assert beats(worker) == 5
    worker.close(1.0)


def test_a_planner_that_hangs_starves_it(problem):
    planner = Hung()
    worker = PlanningWorker(planner, 60.0, lambda *_: None)
    worker.submit(PlanRequest(1, problem, "test"))
    time.sleep(0.3)
    assert beats(worker) == 1  # what was done before it hung
    planner.release.set()
    worker.close(1.0)


def test_it_is_fed_in_time_and_not_at_every_turn():
    told = Told()
    vitals = Watchdog(told)
    for turn in range(101):
        vitals.beat(None, 0.1 * turn)
    # Ten seconds, a watchdog of four: each second.
    assert told.beats in (10, 11)


def test_a_status_is_one_line_for_systemd():
    status = Status(
        state="covering",
        coverage=CoverageReport(covered_m2=12.3, to_cover_m2=48.9, fraction=0.9991),
        floor=FloorReport(12.3),
        path=PathReport(revision=3, remaining_steps=120),
        ledger=LedgerReport(fault="cannot write: no space"),
    )
    assert status_line(status) == (
        "covering; 99 % of cells covered; 12 m2 of floor swept; path 3 with 120 steps to go; "
        "cannot write: no space"
    )
    known = Status(floor=FloorReport(12.3, 20.0, (FloorLeft(9.0, "too narrow"),)))
    assert "11 of 20 m2 of floor swept" in status_line(known)
    assert status_line(Status(state="waiting", reason="no map")) == "waiting: no map"


def test_durations_of_cycles_are_right_to_ten_percent():
    seconds = np.random.default_rng(1).lognormal(-7.0, 2.0, 20_000)
    times = CycleTimes()
    assert times.report() == LoopTimes()
    for each in seconds:
        times.note(float(each))
    told = times.report()
    assert told.turns == len(seconds)
    assert told.late == (seconds > LATE_S).sum() > 0
    assert told.max == round(1e3 * seconds.max(), 3)
    for name, share in (("p50", 0.5), ("p99", 0.99), ("p99_9", 0.999)):
        true = 1e3 * np.quantile(seconds, share, method="inverted_cdf")
        assert true <= getattr(told, name) + 0.001 <= 1.1 * true + 0.002


def test_cycles_beyond_all_buckets_are_counted():
    times = CycleTimes()
    for seconds in (0.0, 1e-9, 1e7):
        times.note(seconds)
    assert times.report() == LoopTimes(3, 1, p50=0.001, p99=1e10, p99_9=1e10, max=1e10)
