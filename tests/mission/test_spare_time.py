"""While the robot drives, what lies further on of its path is made better."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.daemon.loop.outbox import path_attachment
from fasaco_edge.mission.core.path_exit import PublishedPath
from fasaco_edge.mission.events import PlanReady
from fasaco_edge.mission.path.plan_requests import NEW_WALK_SHARE, SKIPPED_S, Attempt, SpareTime
from fasaco_edge.planners.bound import lower_bound_steps
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.planner import WorkLimit, never
from fasaco_edge.planners.search.near_optimal import NearOptimal
from fasaco_edge.planners.walk_before import HELD_CELLS
from tests.benchmarks.judge import check_walk
from tests.mission.world import CONFIG, patch, pose_at, robot_in

HALL = ["." * 12 for _ in range(12)]
SHARE = 0.1
BETTER = "better further on"


def lanes(rows, cols, gap):
    """Return a walk over a hall, lane after lane; from ``gap`` on each ends there and back."""
    cells = []
    for row in range(rows):
        lane = [(row, col) for col in range(cols)]
        cells += lane if row % 2 == 0 else lane[::-1]
        if row >= gap:
            cells += [cells[-2], cells[-1]]
    return np.array(cells, np.int32)


def plan(request, cells, seconds=0.05):
    """Answer a request with a walk."""
    path = NearOptimal().plan(request.problem, WorkLimit(SearchWork(perturbations=1)))
    return PlanReady(request.number, replace(path, cells=cells), seconds)


def whole(request, rest):
    """Return a path with another rest."""
    return np.concatenate((request.problem.lead, rest))


def driving(share=SHARE, gap=4):
    """Return a robot that has been given a path that is poor further on."""
    config = replace(CONFIG, spare_share=share, cost=CoverageCost())
    drive = robot_in(*HALL, config=config)
    request, drive.request = drive.request, None
    drive.tell(plan(request, lanes(12, 12, gap)))
    return drive


def test_a_poor_path_is_made_better_further_on():
    drive = driving()
    poor = drive.updates[-1].cells
    request, drive.request = drive.request, None
    assert request.reason == "spare time"
    assert request.problem.start == tuple(poor[HELD_CELLS])
    drive.tell(PlanReady(request.number, NearOptimal().plan(request.problem, never), 0.05))
    update = drive.updates[-1]
    assert update.reason == BETTER
    assert len(update.cells) < len(poor)
    assert np.array_equal(update.cells[: HELD_CELLS + 1], poor[: HELD_CELLS + 1])
    lattice = drive.mission.lattice
    verdict = check_walk(lattice.steps, lattice.coverable, update.cells, (0, 0))
    assert verdict.legal
    assert verdict.complete


def test_one_attempt_for_each_walk_searches_the_whole_rest():
    drive, kinds = driving(), []
    while len(kinds) < 8:
        request, drive.request = drive.request, None
        if request is None:
            drive.tell(after=1.0)
            continue
        kinds.append(request.problem.is_full)
        rest = request.problem.before
        # The fourth attempt finds another walk.
        better = lanes(12, 12, 5)[HELD_CELLS:] if len(kinds) == 4 else rest
        drive.tell(plan(request, whole(request, better)), after=1.0)
    assert kinds == [True, False, False, False, True, False, False, False]


@pytest.mark.parametrize(("times", "is_taken"), [(4, False), (6, True)])
def test_a_new_walk_has_to_save_more(times, is_taken):
    """Its line is laid and polished anew."""
    side, cost = 30, CoverageCost()
    best = lanes(side, side, side)
    poor = np.concatenate((best, *[best[[-2, -1]]] * times))
    config = replace(CONFIG, spare_share=SHARE, cost=cost)
    drive = robot_in(*["." * side] * side, config=config)
    request, drive.request = drive.request, None
    drive.tell(plan(request, poor))
    request, drive.request = drive.request, None
    drive.tell(plan(request, best), after=1.0)
    assert (cost.of_walk(poor) > (1.0 + NEW_WALK_SHARE) * cost.of_walk(best)) is is_taken
    assert (drive.updates[-1].reason == BETTER) is is_taken


def test_a_new_line_along_the_same_cells_keeps_the_attempt():
    drive = driving()
    poor = drive.updates[-1]
    request, drive.request = drive.request, None
    polished = drive.mission.route.publish_line("line polished", 0.0)
    assert polished.revision == poor.revision + 1
    assert np.array_equal(polished.cells, poor.cells)
    drive.tell(PlanReady(request.number, NearOptimal().plan(request.problem, never), 0.05))
    assert drive.updates[-1].reason == BETTER


def test_all_figures_of_a_path_are_of_one_problem():
    """Over a whole mission with a poor first path: what is published of each path fits together."""
    drive, notes = driving(share=1.0), []
    for _ in range(2000):
        if drive.mission.state == "done":
            break
        request, drive.request = drive.request, None
        known = len(drive.updates)
        if request is not None:
            limit = WorkLimit(SearchWork(perturbations=1))
            drive.tell(PlanReady(request.number, NearOptimal().plan(request.problem, limit), 0.05))
        drive.go()
        for update in drive.updates[known:]:
            about = path_attachment(PublishedPath.of(drive.mission, update))
            notes.append((about, request, update))
    assert drive.mission.state == "done"
    better = [note for note in notes if note[0].reason == BETTER]
    assert better
    for about, request, update in better:
        planned, bound = about.planned_steps, about.lower_bound_steps
        assert 0 < bound <= planned
        least_s = about.lower_bound_cost_s
        assert about.gap == pytest.approx(about.planned_cost_s / least_s - 1, abs=1e-3)
        # The robot may have driven on meanwhile: the path is the end of what was planned.
        cells = update.cells
        assert about.steps == len(cells) - 1 <= planned
        plan, whole_problem = update.plan, request.problem.whole
        assert np.array_equal(plan.cells[len(plan.cells) - len(cells) :], cells)
        assert bound == lower_bound_steps(whole_problem)
        assert about.planned_cost_s == pytest.approx(
            whole_problem.cost.of_walk(plan.cells), abs=1e-3
        )
        lattice = whole_problem.lattice
        verdict = check_walk(
            lattice.steps, whole_problem.to_cover, plan.cells, tuple(whole_problem.start)
        )
        assert verdict.legal
        assert verdict.complete


def test_attempts_take_their_share_of_the_time_and_less_in_vain():
    drive = driving()
    asked_at = []
    for _ in range(600):
        request, drive.request = drive.request, None
        if request is not None:
            asked_at.append(drive.now)
            drive.tell(
                plan(request, whole(request, request.problem.before), seconds=0.05), after=0.05
            )
        else:
            drive.tell(after=0.05)
    assert {update.reason for update in drive.updates[1:]} <= {"robot stands"}  # nothing was better
    gaps = np.diff(asked_at)
    shortest = [0.05 / SHARE * halved for halved in (1, 2, 4, 8, 16, 16)]
    assert len(gaps) >= len(shortest)
    for gap, least in zip(gaps, shortest, strict=False):
        assert least - 1e-9 <= gap < least + 0.15


def test_a_hopeless_attempt_is_not_repeated_with_each_pose(monkeypatch):
    """All is covered, but the path leads on: to find that out takes a look at the whole map."""
    config = replace(CONFIG, spare_share=1.0)
    drive = robot_in(*HALL[:3], config=config)
    request, drive.request = drive.request, None
    hall = lanes(3, 12, 3)
    drive.tell(plan(request, np.concatenate((hall, hall[-2::-1], hall[1:]))))
    tried_at = []
    attempt_at = Attempt.at
    monkeypatch.setattr(
        Attempt, "at", lambda *asked, **how: tried_at.append(drive.now) or attempt_at(*asked, **how)
    )
    for cell in hall.tolist():
        drive.tell(pose_at(*cell))
        if drive.request is not None:
            request, drive.request = drive.request, None
            drive.tell(
                plan(request, whole(request, request.problem.before), seconds=0.0), after=0.0
            )
    tried_at.clear()
    for cell in hall[-2::-1].tolist():
        drive.tell(pose_at(*cell))
        assert drive.request is None
    assert len(tried_at) > 2
    assert min(np.diff(tried_at)) >= SKIPPED_S - 1e-9


def test_without_a_share_nothing_is_asked_for():
    assert driving(share=0.0).request is None


def test_a_tiny_saving_does_not_change_the_path():
    drive = driving(gap=10)
    request, drive.request = drive.request, None
    shorter = request.problem.before[:-1]  # the last step led to a cell it had been in
    drive.tell(plan(request, whole(request, shorter)))
    assert drive.revision == 1


@pytest.mark.parametrize("what", ["driven on", "path is new"])
def test_a_better_path_that_comes_too_late_is_dropped(what):
    drive = driving()
    request, drive.request = drive.request, None
    better = PlanReady(request.number, NearOptimal().plan(request.problem, never), 0.05)
    if what == "driven on":
        for cell in drive.updates[-1].cells[1 : HELD_CELLS + 3].tolist():
            drive.tell(pose_at(*cell))
    else:
        # Something stands where the robot was about to drive: the path ends before it, at once.
        drive.tell(patch("#", at=(0, 5)))
        assert drive.mission.route.requests.wanted
        assert drive.mission.route.requests.is_improving
    drive.request = None
    drive.tell(better)
    assert BETTER not in [update.reason for update in drive.updates]
    if what == "path is new":
        assert drive.request.reason.startswith("path blocked")
        assert not drive.mission.route.requests.is_improving


def test_a_needed_plan_comes_after_the_attempt():
    """A map that changes while an attempt is under way: its repair is asked for after it."""
    drive = driving()
    request, drive.request = drive.request, None
    drive.tell(patch("#", at=(11, 11)))
    assert drive.mission.route.requests.wanted
    drive.tell(plan(request, whole(request, request.problem.before)))
    assert not drive.request.problem.only_better
    assert not drive.mission.route.requests.wanted


def test_a_new_walk_is_attempted_after_vain_attempts_at_the_last():
    spare = SpareTime(SHARE)
    for attempt in range(4):
        spare.spend(0.05, attempt, walk=1)
    assert not spare.is_available(3.0 + 0.05 / SHARE, walk=1)
    assert not spare.is_available(3.0 + 0.05 / SHARE / 2, walk=2), "it has its share all the same"
    assert spare.is_available(3.0 + 0.05 / SHARE, walk=2)
