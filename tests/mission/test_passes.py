"""Passes of an order, each with its cells and the direction of its lanes, as they are driven."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.errors import OrderError
from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.mission.core.lattice_layout import LatticeLayout
from fasaco_edge.mission.events import CommandReceived, MapReceived, PlanReady, State
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.planners.cost import SHORTEST_STEP_S, SearchWork
from fasaco_edge.planners.passes import Laid
from fasaco_edge.planners.planner import WorkLimit
from fasaco_edge.planners.search.near_optimal import NearOptimal
from tests.grid.test_floor import room
from tests.mission import line_robot, world
from tests.mission.world import CONFIG, building, cells, idle, rectangle
from tests.support.lanes import along_share

HALL = ("............",) * 9
EDGE = cells(0, 0, 9, 12) - cells(1, 1, 8, 11)
ENOUGH = WorkLimit(SearchWork(proposals=150_000))


@pytest.fixture(autouse=True)
def search(monkeypatch):
    """Plans of the missions' own planner: those of ants alone have no lanes."""

    def answer(request):
        return PlanReady(request.number, NearOptimal().plan(request.problem, ENOUGH), 0.1)

    monkeypatch.setattr(world, "answer", answer)
    monkeypatch.setattr(line_robot, "answer", answer)


def driven(drive):
    """The cells driven in each pass, by the reason of its first plan, until the mission is done."""
    begun = {}
    for _ in range(2000):
        if drive.mission.state is State.DONE:
            break
        if drive.request is not None:
            begun.setdefault(drive.request.reason, (drive.request.problem, len(drive.driven) - 1))
            drive.plan()
        drive.go()
    assert drive.mission.state is State.DONE
    ends = [*[at for _, at in begun.values()][1:], len(drive.driven)]
    return {
        reason: (problem, np.array(drive.driven[at : end + 1]))
        for (reason, (problem, at)), end in zip(begun.items(), ends, strict=True)
    }


def in_rows(walk):
    """Share of a walk's steps along rows."""
    return np.count_nonzero(np.diff(walk[:, 1])) / (len(walk) - 1)


def test_a_lap_then_lanes_then_lanes_across():
    drive = idle(*HALL)
    drive.command("start", {"passes": ["edge", "auto", "cross"]})
    found = driven(drive)
    name = "everything reachable, pass"
    assert list(found) == [f"{name} 1 of 3, edge", f"{name} 2 of 3", f"{name} 3 of 3, cross"]
    (edge, lap), (auto, lanes), (cross, across) = found.values()
    assert (edge.cells, auto.cells, cross.cells) == (len(EDGE) - 1, 107, 107)
    # No walk of another pass is repaired.
    assert all(problem.is_full for problem in (edge, auto, cross))
    assert set(map(tuple, lap.tolist())) == EDGE
    assert in_rows(lanes) > 0.85
    assert in_rows(across) < 0.2


def test_the_rest_after_an_edge_leaves_the_edge_out():
    drive = idle(*HALL)
    drive.command("start", {"passes": ["edge", "rest", {"covers": "rest", "lanes": "cross"}]})
    (_, _), (rest, lanes), (again, across) = driven(drive).values()
    # It may stand on one of them.
    assert {rest.cells, again.cells} <= {107 - len(EDGE), 108 - len(EDGE)}
    assert in_rows(lanes) > 0.8
    assert in_rows(across) < 0.25
    assert "every reachable cell is covered" in drive.mission.reason


def test_a_last_lap_forgets_only_the_edge_of_its_zone():
    drive = idle(*HALL)
    zone = {"name": "west", "polygon": rectangle(0, 0, 9, 6), "passes": ["auto", "edge"]}
    drive.command("start", {"zones": [zone, {"name": "east", "polygon": rectangle(0, 6, 9, 12)}]})
    found = driven(drive)
    assert list(found) == [
        "zone 'west', pass 1 of 2",
        "zone 'west', pass 2 of 2, edge",
        "zone 'east'",
    ]
    lap = found["zone 'west', pass 2 of 2, edge"][0]
    west = {cell for cell in EDGE if cell[1] < 6}
    # The robot stands on one of them, at most.
    assert len(west) - 1 <= lap.cells <= len(west)
    assert drive.visited == cells(0, 0, 9, 12)
    assert len(drive.driven) < 2.1 * 54 + 2 * len(EDGE)


def test_an_edge_grows_with_the_map():
    drive = idle(*(row[:6] + "??????" for row in HALL))
    drive.command("start", {"passes": ["edge", "auto"]})
    drive.tick(times=3)
    drive.tell(MapReceived(building(*HALL)))
    (_, lap), _ = list(driven(drive).values())[-2:]
    assert cells(0, 6, 9, 12) & EDGE <= drive.visited
    assert drive.mission.state is State.DONE
    assert len(lap)


def test_robots_of_a_fleet_have_no_cells_of_their_own():
    drive = idle(*HALL, kind=FleetKind("r1"))
    for name, value in {"angle_deg": 20.0, "overlap": 0.3}.items():
        drive.command("start", {"passes": [{name: value}]})
        assert isinstance(drive.refused, OrderError)
        assert f"{name} is for a robot alone" in str(drive.refused)
    drive.command("start", {"passes": ["edge", "auto", "cross"]})
    assert drive.refused is None


def robot_in_room():
    """A robot with a tool, in a room of 3 by 2.4 m that was mapped before."""
    grid = room(3.0, 2.4)
    config = replace(line_robot.CONFIG, lattice_deg=None)
    robot = line_robot.LineRobot(grid.cells, (1.0, 1.0), config)
    return robot, grid


def order(robot, *passes):
    robot._commands += 1
    command = CommandReceived(
        robot._commands, "start", read_order({"passes": list(passes)}), discard=True
    )
    robot.step(command)


def tracks(robot):
    """The track of each pass, by its title, until the order is over."""
    begun = {}
    for _ in range(8000):
        begun.setdefault(robot.mission.order_state.title, len(robot.track))
        if robot.mission.state is State.DONE:
            break
        robot.step()
    assert robot.mission.state is State.DONE
    points = np.array(robot.track)
    ends = [*list(begun.values())[1:], len(points)]
    return {
        title: points[first:end]
        for (title, first), end in zip(begun.items(), ends, strict=True)
        if end > first
    }


def along(track, angle_deg):
    moved = np.hypot(*np.diff(track, axis=0).T) > 1e-6
    return along_share(track[np.append(moved, True)], angle_deg)


def test_a_line_keeps_the_direction_of_its_pass():
    robot, _ = robot_in_room()
    order(robot, "edge", "auto", "cross")
    asked = robot.mission.line.left.areas.asked_m2
    lap, lanes, across, *_ = tracks(robot).values()
    # The floor within is not asked for.
    assert asked < 0.45 * robot.mission.line.left.areas.asked_m2
    assert along(lanes, 0.0) > 2 * along(lanes, 90.0)
    assert along(across, 90.0) > 2 * along(across, 0.0)
    middle = np.hypot(*(lap - (lap.min(axis=0) + lap.max(axis=0)) / 2).T)
    assert middle.min() > 0.3


def test_cells_lie_at_the_angle_of_a_pass_and_back():
    robot, grid = robot_in_room()
    order(robot, {"angle_deg": 30.0}, "cross", "auto")
    robot.step()
    assert robot.mission.rotation.deg == 30.0
    robot.restart(grid.cells)
    robot.step()
    assert robot.mission.rotation.deg == 30.0
    first, across, usual, *_ = tracks(robot).values()
    assert along(first, 30.0) > 1.5 * along(first, 120.0)
    assert along(across, 120.0) > 1.5 * along(across, 30.0)
    assert robot.mission.rotation.deg == 0.0
    assert along(usual, 0.0) + along(usual, 90.0) > 0.6


def test_lanes_of_a_pass_overlap_as_it_says():
    robot, grid = robot_in_room()
    order(robot, {"overlap": 0.4}, {"lanes": "cross", "overlap": 0.0}, "auto")
    tool_m, usual_m = line_robot.CONFIG.tool_m, line_robot.CONFIG.footprint.cell_m
    robot.step()
    assert robot.mission.lattice.cell_m == pytest.approx(0.6 * tool_m)
    # A daemon that starts again goes on with the swept floor, in the cells of the pass.
    for _ in range(60):
        robot.step()
    swept = robot.mission.covered.floor.snapshot().pixels
    robot.restart(grid.cells)
    robot.step()
    assert robot.mission.lattice.cell_m == pytest.approx(0.6 * tool_m)
    assert robot.mission.covered.floor.snapshot().pixels >= swept
    narrow, wide, usual, *_ = tracks(robot).values()
    assert robot.mission.lattice.cell_m == usual_m
    # As many metres as there are lanes.
    lengths = [np.hypot(*np.diff(track, axis=0).T).sum() for track in (narrow, wide, usual)]
    assert lengths[0] > 1.25 * max(lengths[1:])


@pytest.mark.parametrize("lanes", ["auto", {"overlap": 0.4}])
def test_other_cells_keep_what_was_covered_before_a_restart(lanes):
    """A mapper that began anew shows the near half of a corridor, which was covered before."""
    grid = room(5.0, 0.45)
    config = replace(line_robot.CONFIG, lattice_deg=None)
    robot = line_robot.LineRobot(grid.cells, (0.5, 0.27), config)
    order(robot, lanes)
    assert robot.wait(120.0, lambda robot: robot.x > 3.8)
    half = grid.cells.copy()
    half[:, 50:] = -1
    robot.x, robot.y = 0.5, 0.27
    robot.restart(half)
    looks = robot.wait(60.0, lambda robot: robot.mission.state is State.DONE or robot.x > 2.0)
    assert looks
    assert robot.mission.state is not State.DONE
    robot.show(grid.cells)
    assert robot.wait(300.0, lambda robot: robot.mission.state is State.DONE)
    assert max(x for x, _ in robot.track) > 4.6


def test_cells_that_no_map_fits_on_are_given_up():
    grid, usual_m = room(3.0, 2.4), CONFIG.footprint.cell_m
    layout = LatticeLayout(CONFIG)
    for lay, deg, cell_m in (
        (Laid(angle_deg=30.0), 30.0, usual_m),
        (Laid(angle_deg=30.0, overlap=0.5), 30.0, usual_m / 2),
        (Laid(), 0.0, usual_m),
    ):
        assert layout.changes_for_pass(lay, grid)
        assert (layout.deg, layout.cell_m) == (deg, cell_m)
        assert not layout.changes_for_pass(lay, grid)
    layout._most_cells = 100
    for lay in (Laid(angle_deg=45.0), Laid(overlap=0.4)):
        assert not layout.changes_for_pass(lay, grid)
        assert not layout.changes_for_pass(lay, grid)
        assert (layout.deg, layout.cell_m) == (0.0, usual_m)


def test_a_map_too_large_for_a_pass_gets_the_usual_cells():
    layout = LatticeLayout(CONFIG)
    assert layout.changes_for_pass(Laid(overlap=0.5), room(3.0, 2.4))
    # Nor may narrower cells take the fastest robot less than the shortest step.
    fastest = replace(CONFIG, cost=replace(CONFIG.cost, step_s=SHORTEST_STEP_S))
    assert layout.sized(fastest).cost == fastest.cost
    layout._most_cells = 500
    assert layout.rotates_back_for([room(4.0, 3.0)])
    assert layout.cell_m == CONFIG.footprint.cell_m
    assert not layout.rotates_back_for([room(4.0, 3.0)])


def test_a_slow_pass_is_sent_with_its_speed():
    config = replace(CONFIG, speed_m_s=0.25)
    drive = idle(*HALL, config=config)
    for speed, why in (
        (0.3, "expected at most robot.speed_m_s, 0.25, got 0.3"),
        (1e-300, "a cell in an hour, got 1e-300"),
    ):
        drive.command("start", {"passes": [{"speed_m_s": speed}]})
        assert why in str(drive.refused)
    drive.command("start", {"passes": [{"speed_m_s": 0.1}, "auto"]})
    slow, usual = (problem for problem, _ in driven(drive).values())
    assert slow.cost.step_s == pytest.approx(2.5 * usual.cost.step_s)
    speeds = [update.speed_m_s for update in drive.updates if len(update.cells)]
    assert speeds[0] == 0.1
    assert speeds[-1] is None
    assert speeds == sorted(speeds, key=lambda speed: speed is None)


def test_the_way_home_is_driven_at_the_usual_speed():
    drive = idle(*HALL)
    drive.command("start", {"passes": [{"speed_m_s": 0.1}]})
    drive.plan()
    drive.go(times=5)
    assert drive.command("home").path.speed_m_s is None
