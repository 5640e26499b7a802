"""A full new plan, asked for."""

import pytest

from fasaco_edge.errors import CommandError
from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.events import MapReceived
from fasaco_edge.mission.work.order_state import OrderState
from tests.mission.world import Drive, building, pose_at, robot_in, started

ROOM = ("........",) * 6


def test_all_is_searched_beginning_with_the_path():
    drive = started(*ROOM)
    drive.go()
    decision = drive.command("replan")
    assert drive.refused is None
    assert decision.plan.reason == "asked for"
    assert decision.answers[0].plan == decision.plan.number == 2
    assert decision.plan.problem.is_full
    assert (decision.plan.problem.before == drive.mission.route.path.ahead).all()
    assert drive.mission.state == "covering", "it drives on meanwhile"
    drive.plan()
    drive.finish()
    assert len(drive.visited) == 48


def test_only_the_plan_that_was_asked_for_is_a_full_one():
    drive = started(*ROOM)
    drive.command("replan")
    drive.plan()
    drive.tell(MapReceived(building(*ROOM, "...#....")))
    assert drive.request.reason != "asked for"
    assert not drive.request.problem.is_full


def test_one_under_way_comes_first():
    drive = robot_in(*ROOM)
    assert drive.request.number == 1
    for _ in range(2):
        (answer,) = drive.command("replan").answers
        assert (answer.error, answer.plan) == (None, 2)
    decision = drive.plan()
    assert decision.path.reason != "asked for"
    assert (decision.plan.number, decision.plan.reason) == (2, "asked for")
    assert decision.path is not None
    assert drive.plan().plan is None


def test_a_map_change_does_not_hide_a_requested_replan():
    drive = robot_in(*ROOM)
    drive.command("replan")
    drive.tell(MapReceived(building(*ROOM, "...#....")))
    assert drive.plan().plan.reason == "asked for"


@pytest.mark.parametrize(
    ("drive", "said"),
    [
        (lambda: Drive((0, 0)), "there is no map yet"),
        (lambda: Drive((0, 0), MapReceived(building(*ROOM))), "there is no pose yet"),
        (lambda: Drive((0, 0), order_state=OrderState.idle("")), "there is no mission"),
        (lambda: robot_in(*ROOM, cell=(9, 9)), "outside of the map"),
    ],
)
def test_a_replan_without_work_is_refused_with_the_reason(drive, said):
    robot = drive()
    decision = robot.command("replan")
    assert isinstance(robot.refused, CommandError)
    assert "nothing to plan" in str(robot.refused)
    assert said in str(robot.refused)
    assert decision.plan is None


def test_a_mission_that_rests_is_not_planned():
    drive = started(*ROOM)
    drive.command("pause")
    drive.command("replan")
    assert "paused" in str(drive.refused)
    drive.command("resume")
    drive.finish()
    assert drive.command("replan").plan is None
    assert "no reachable cell is left" in str(drive.refused)
    assert drive.mission.state == "done"


def test_a_path_says_which_cells_it_is_because_of():
    drive = started(*ROOM)
    assert drive.updates[-1].changed is None, "the first plan is not because of a change"
    drive.tell(MapReceived(building("...#....", *ROOM)))
    # What comes while it plans belongs to the next one.
    drive.tell(MapReceived(building("........", "...#....", *ROOM)))
    drive.plan()
    # Those beside the new ones have other neighbours.
    assert drive.updates[-1].changed == Window(5, 0, 7, 8)
    assert drive.updates[-1].reason == "map: 7 cells more"
    drive.plan()
    assert drive.updates[-1].changed == Window(6, 0, 8, 8)
    assert drive.command("replan").plan.changed is None


def test_a_path_cut_off_says_where():
    drive = started("........")
    decision = drive.tell(MapReceived(building(".....#..")))
    assert decision.path.reason == "path blocked at cell (0, 5)"
    assert decision.path.changed == Window(0, 4, 1, 8)
    drive.plan()
    assert drive.updates[-1].changed == Window(0, 4, 1, 8)


def test_the_cut_off_part_is_kept_where_it_is_valid():
    drive = started(*ROOM)
    ahead = drive.mission.route.path.ahead
    row, col = ahead[12].tolist()
    rows = ["".join("#" if (r, c) == (row, col) else "." for c in range(8)) for r in range(6)]
    drive.tell(MapReceived(building(*reversed(rows))))
    assert len(drive.mission.route.path.ahead) == 12
    assert (drive.request.problem.before == ahead).all()
    drive.plan()
    # Another command than the repair forgets it.
    assert (drive.mission.route.path_to_keep == drive.mission.route.path.ahead).all()


@pytest.mark.parametrize(
    ("events", "goes_on_at"),
    [
        ([MapReceived(building("#......."))], (0, 1)),
        ([MapReceived(building(".......", at=(0, 1)))], (0, 1)),
        ([MapReceived(building("....", at=(40, 40))), pose_at(40, 41)], (40, 41)),
    ],
    ids=["blocked", "beyond the map", "carried elsewhere"],
)
def test_no_path_leads_to_a_cell_that_is_blocked_now(events, goes_on_at):
    drive = started("........")
    decision = drive.tell(*events)
    assert decision.path.reason == "path blocked at cell (0, 0)"
    assert len(decision.path.cells) == 0
    drive.plan()
    assert tuple(drive.updates[-1].cells[0]) == goes_on_at


def test_plans_that_lead_to_no_path_are_counted():
    drive = started("........")
    drive.command("replan")
    drive.plan()
    route = drive.mission.route
    assert (route.unchanged, route.outdated) == (1, 0), "there is one way only"
    drive.command("replan")
    drive.tell(MapReceived(building(".....#..")))
    drive.plan()
    assert (route.unchanged, route.outdated) == (1, 1)
    assert route.requests.plans == 3
