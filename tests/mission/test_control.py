"""A mission under orders: zones, passes, keep-out zones, the way home; paused, cancelled, reset."""

import pytest

from fasaco_edge.daemon.loop.mission_reports import zone_progress
from fasaco_edge.errors import OrderError
from fasaco_edge.mission.events import MapReceived, State
from tests.mission.world import (
    IDLE,
    Drive,
    building,
    cells,
    idle,
    patch,
    pose_at,
    rectangle,
    robot_in,
    started,
)

ROOM = ("........",) * 6
WEST, EAST = rectangle(0, 0, 6, 2), rectangle(0, 6, 6, 8)
TWO_ZONES = {"zones": [{"name": "east", "polygon": EAST}, {"name": "west", "polygon": WEST}]}


def test_without_an_order_it_stands_with_that_reason():
    drive = Drive((0, 0), order_state=IDLE)
    assert (drive.mission.state, drive.mission.reason) == (State.IDLE, "no order yet")
    drive.tell(MapReceived(building(*ROOM)), pose_at(0, 0))
    assert drive.mission.state is State.IDLE
    assert drive.request is None
    drive.cell = (0, 3)
    drive.tell(pose_at(0, 1), pose_at(0, 2), pose_at(0, 3))
    assert drive.visited == {(0, 0), (0, 1), (0, 2), (0, 3)}, "it counts all the same"


def test_zones_are_covered_one_after_the_other_and_nothing_else():
    drive = idle(*ROOM)
    assert drive.command("start", TWO_ZONES).plan.reason == "zone 'east'"
    assert drive.request.problem.cells == 12
    drive.finish()
    reasons = [update.reason for update in drive.updates]
    assert reasons == ["zone 'east'", "zone 'west'", "every reachable cell of the zones is covered"]
    assert cells(0, 6, 6, 8) | cells(0, 0, 6, 2) <= drive.visited
    # What lies between is driven through, and no more.
    assert len(drive.visited & cells(0, 2, 6, 6)) <= 8
    first_west = next(i for i, cell in enumerate(drive.driven) if cell[1] < 2 and i > 10)
    assert cells(0, 6, 6, 8) <= set(drive.driven[:first_west])


def test_passes_count_from_their_beginning():
    drive = idle(*ROOM)
    drive.command("start", {"zones": [{"name": "west", "polygon": WEST, "passes": 3}]})
    begun = []
    while drive.mission.state is not State.DONE:
        if drive.request is not None:
            begun.append((drive.request.reason, drive.request.problem.cells, len(drive.driven)))
            drive.plan()
        drive.go()
    # The robot stands on the one cell that is covered already.
    assert [(reason, count) for reason, count, _ in begun] == [
        (f"zone 'west', pass {turn} of 3", 11) for turn in (1, 2, 3)
    ]
    for (_, _, here), (_, _, there) in zip(begun, [*begun[1:], ("", 0, None)], strict=True):
        assert cells(0, 0, 6, 2) <= set(drive.driven[here - 1 : there])


def test_an_order_covers_all_again_unless_it_says_otherwise():
    drive = started(*ROOM)
    drive.finish()
    assert drive.command("start").plan.problem.cells == 47
    drive.plan()
    drive.go(times=20)
    drive.command("cancel")
    covered = len(drive.visited)
    assert drive.command("start", {"keep_covered": True}).plan.problem.cells == 48 - covered
    drive.finish()


def test_cells_behind_a_keep_out_are_not_blamed_on_obstacles():
    drive = idle("........", "...#....")
    drive.command("start", {"keep_out": [rectangle(0, 4, 2, 5)]})
    drive.finish()
    found = {(area.reason, area.cells) for area in drive.mission.orders.uncovered.found().areas}
    assert found == {("in a keep-out zone", 2), ("closed off by a keep-out zone", 6)}


def test_paused_it_stands_and_still_counts_what_it_passes_over():
    drive = started(*ROOM)
    drive.go(times=5)
    decision = drive.command("pause")
    assert decision.path.cells.shape == (0, 2)
    assert (drive.mission.state, drive.mission.reason) == (State.PAUSED, "paused by command")
    before = drive.visited
    row, col = drive.cell
    drive.tell(pose_at(row + 0.5, col), pose_at(row + 1, col))
    assert drive.visited == before | {(row + 1, col)}
    drive.cell = (row + 1, col)
    # A map that changes is taken in, and planned on when it goes on.
    assert drive.tell(patch("#", at=(5, 7))).plan is None
    plan = drive.command("resume").plan
    # The command is the reason: the window of a change belongs to plans for a changed map.
    assert (plan.reason, plan.changed) == ("resumed", None)
    drive.finish()
    assert drive.visited == cells(0, 0, 6, 8) - {(5, 7)}


def test_resume_without_a_change_keeps_the_path():
    drive = started(*ROOM)
    drive.go(times=5)
    ahead, plans = drive.walk[:], drive.mission.route.requests.plans
    drive.command("pause")
    drive.tell(pose_at(*drive.cell), MapReceived(building(*ROOM)), after=60.0)
    decision = drive.command("resume")
    assert (decision.plan, decision.path.reason) == (None, "resumed")
    assert drive.mission.state is State.COVERING
    assert (drive.walk, drive.mission.route.requests.plans) == (ahead, plans)
    drive.finish()


def test_resume_repairs_the_path_where_the_map_changed():
    drive = started(*ROOM)
    drive.go(times=5)
    ahead = drive.walk[:]
    drive.command("pause")
    drive.tell(patch("#", at=ahead[-1]))
    plan = drive.command("resume").plan
    assert [tuple(cell) for cell in plan.problem.before[1:].tolist()] == ahead
    drive.plan()
    drive.finish()


def test_a_plan_delayed_by_a_pause_is_made_on_resume():
    drive = started(*ROOM)
    drive.tell(MapReceived(building("........", *ROOM)))
    drive.command("pause")
    assert drive.plan().path is None
    drive.command("resume")
    drive.plan()
    drive.finish()
    assert drive.visited == cells(0, 0, 7, 8)


def test_another_order_after_a_pause_is_planned_from_nothing():
    drive = started(*ROOM)
    drive.command("pause")
    drive.command("cancel")
    plan = drive.command("start").plan
    assert plan.problem.before is None or not len(plan.problem.before)


def test_a_plan_for_the_order_before_is_not_driven():
    drive = robot_in(*ROOM)
    assert drive.command("start", TWO_ZONES).plan is None, "one plan at a time"
    decision = drive.plan()
    assert decision.path is None
    assert decision.plan.reason == "zone 'east'"
    drive.finish()


def test_cancel_stops_drops_the_order_and_keeps_the_coverage():
    drive = started(*ROOM)
    drive.go(times=5)
    decision = drive.command("cancel")
    assert decision.path.cells.shape == (0, 2)
    assert not decision.forgotten
    assert (drive.mission.state, drive.mission.reason) == (State.IDLE, "cancelled")
    assert len(drive.visited) == 6
    assert drive.tell(patch("#", at=(0, 0)), after=100.0).plan is None
    assert drive.mission.orders.uncovered.found().areas == ()


def test_reset_forgets_what_is_covered_too():
    drive = started(*ROOM)
    drive.go(times=5)
    decision = drive.command("reset")
    assert decision.forgotten
    assert decision.path.cells.shape == (0, 2)
    assert drive.mission.state is State.IDLE
    assert drive.visited == {drive.cell}, "the tool lies there"
    assert drive.tell().forgotten is False
    drive.command("start")
    drive.finish()


def test_a_command_may_come_before_any_map():
    drive = Drive((0, 0))
    drive.command("start", TWO_ZONES)
    assert drive.mission.state is State.WAITING_FOR_MAP
    drive.command("pause")
    drive.tell(MapReceived(building(*ROOM)), pose_at(0, 0))
    assert drive.mission.state is State.PAUSED
    assert drive.command("resume").plan.problem.cells == 12
    drive.finish()


def test_a_zone_beyond_the_map_is_refused_and_changes_nothing():
    drive = started(*ROOM)
    walk = drive.walk
    beyond = {"zones": [{"name": "moon", "polygon": rectangle(0, 8, 2, 12)}]}
    drive.command("start", beyond)
    assert isinstance(drive.refused, OrderError)
    assert "zone 'moon' lies outside of the map, x 0.00..2.00 m" in str(drive.refused)
    assert drive.mission.state is State.COVERING
    assert drive.walk == walk
    drive.finish()


def test_a_started_mission_stays_done_when_the_map_changes():
    drive = idle(*ROOM[:2])
    drive.command("start")
    drive.finish()
    assert drive.tell(MapReceived(building(*ROOM))).plan is None
    assert drive.mission.state is State.DONE
    assert drive.command("start").plan is not None


def test_unknown_parts_of_a_zone_are_named():
    drive = idle("..??", "..??")
    drive.command("start", {"zones": [{"name": "all", "polygon": rectangle(0, 0, 2, 4)}]})
    drive.finish()
    (area,) = drive.mission.orders.uncovered.found().areas
    assert (area.cells, area.reason) == (4, "unknown to the map")


@pytest.mark.parametrize("driven", [3, 14, 30, 45])
def test_order_zone_pass_and_home_outlive_the_daemon(driven):
    order = {"zones": [{"name": "west", "polygon": WEST, "passes": 2}], "return_home": True}
    first = idle(*ROOM, cell=(3, 4))
    first.command("start", order)
    first.tick(times=driven)
    before = first.mission.order_state
    again = first.restarted(MapReceived(building(*ROOM)), pose_at(*first.cell))
    assert again.mission.order_state == before
    again.finish()
    assert again.cell == (3, 4)
    # Each cell twice in all, but what was covered in the pass is not covered again.
    assert len(first.driven) + len(again.driven) < 2 * 12 + 30


def test_how_far_each_zone_is():
    drive = idle(*ROOM)
    drive.command("start", {**TWO_ZONES, "passes": 2})
    seen = []
    for _ in range(300):
        zones = [
            (zone.newest_pass, zone.cells, zone.covered) for zone in zone_progress(drive.mission)
        ]
        seen.append(zones)
        if drive.mission.state is State.DONE:
            break
        drive.tick()
    assert seen[0] == [(1, 12, 0), (0, 12, 0)]
    assert seen[-1] == [(2, 12, 12), (2, 12, 12)]
    for east, west in seen:
        assert west[0] == 0 or east == (2, 12, 12)
    assert {east[0] for east, _ in seen} == {1, 2}
    assert [zone.name for zone in zone_progress(drive.mission)] == ["east", "west"]
    drive.command("start")
    assert zone_progress(drive.mission) == []


class Mapper:
    """A map of which only what is near the robot is known; everything near becomes so."""

    def __init__(self, *rows, reach=2):
        self.rows, self.reach = rows, reach
        self.known = set()

    def event(self, cell):
        for row, line in enumerate(self.rows[::-1]):
            for col in range(len(line)):
                if max(abs(row - cell[0]), abs(col - cell[1])) <= self.reach:
                    self.known.add((row, col))
        seen = [
            "".join(letter if (row, col) in self.known else "?" for col, letter in enumerate(line))
            for row, line in enumerate(self.rows[::-1])
        ]
        return MapReceived(building(*seen[::-1]))


HOUSE = ("....#.......", "....#.####..", "....#.#..#..", "......#.....", "....#.#..#..")


def test_an_unseen_zone_is_searched_for():
    mapper = Mapper(*HOUSE)
    drive = Drive((0, 0), mapper.event((0, 0)), pose_at(0, 0), order_state=IDLE)
    # Through the door in the middle, around the corner, and in from behind.
    decision = drive.command("start", {"zones": [{"name": "a", "polygon": rectangle(0, 7, 3, 9)}]})
    assert decision.plan.reason == "looking for a way to zone 'a'"
    assert drive.request.problem.cells == 1
    while drive.mission.state is not State.DONE and drive.now < 60.0:
        drive.tick(mapper.event(drive.walk[0] if drive.walk else drive.cell))
    assert cells(0, 7, 3, 9) <= drive.visited
    assert drive.mission.orders.uncovered.found().areas == ()
    assert not drive.visited & {(3, 0), (4, 0), (4, 1)}, "the rest of the house was not asked for"
