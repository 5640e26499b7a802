"""Benchmark of missions in unknown buildings: maps that the robot sees, its path, its report."""

import itertools
import json

import numpy as np
import pytest

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.mission.events import MapReceived, PatchReceived
from fasaco_edge.planners.grids import NamedGrid
from tests.benchmarks.__main__ import main
from tests.benchmarks.online.buildings import BuildingChoice, of_grid
from tests.benchmarks.online.figures import Summary, goals
from tests.benchmarks.online.judge import judged
from tests.benchmarks.online.mission import Conditions, CountedPlanning, OnlineMission, Watch
from tests.benchmarks.online.report import report
from tests.benchmarks.online.robot import Pace, Robot
from tests.benchmarks.online.runs import OnlinePlan, count, measure
from tests.benchmarks.online.sight import Sight

CELL_M = 0.3
TWO_ROOMS = (
    "############",
    "#.....#....#",
    "#.....#....#",
    "#..........#",
    "#.S...#....#",
    "############",
)
CELLS = 37
PACE = Pace(speed_m_s=0.3, turn_s=1.5)


def free_of(*rows):
    return np.array([[letter != "#" for letter in row] for row in rows[::-1]])


def drawn(*rows, name="rooms"):
    (start,) = [
        (row, line.index("S")) for row, line in enumerate(rows[::-1]) if "S" in line
    ]  # fmt: skip
    grid = NamedGrid(name, CoverageLattice.from_free(free_of(*rows)), start)
    return of_grid(grid, CELL_M)


CONDITIONS = Conditions(1.0, PACE, PACE.cost(CELL_M, with_turns=False), CountedPlanning(0, 20_000))


def mission_in(building):
    mission = OnlineMission(building, CONDITIONS)
    mission.run()
    return mission


def centre_px(building, cell):
    ((x, y),) = building.lattice.centres(np.array([cell], np.int32)).tolist()
    return building.truth.geometry.to_pixels(x, y)


class Listener:
    """The map as whoever hears all that is published knows it."""

    def __init__(self, sight):
        self.sight, self.grid, self.heard = sight, None, []

    def look(self, at):
        self.sight.look(at)
        event = self.sight.news()
        self.heard.append(type(event))
        if isinstance(event, MapReceived):
            self.grid = event.grid
        elif isinstance(event, PatchReceived):
            self.grid = self.grid.patched(event.patch)
        return self.grid

    def value_at(self, building, cell):
        """Return the highest value of a cell's pixels; a scanner does not see all of a wall."""
        place = building.lattice.centres(np.array([cell], np.int32))[0].tolist()
        col, row = (round(at) for at in self.grid.geometry.to_pixels(*place))
        part = np.pad(self.grid.cells, 2, constant_values=-1)[row + 1 : row + 3, col + 1 : col + 3]
        return int(part.max(initial=-1))


def test_pixels_of_a_coverage_grid_are_the_grid_again():
    free = np.random.default_rng(3).random((9, 14)) < 0.7
    for pixels_per_cell in (2, 6):
        grid = NamedGrid("noise.npy", CoverageLattice.from_free(free), (0, 0))
        building = of_grid(grid, 0.6, pixels_per_cell)
        seen = CoverageLattice.from_map(building.truth, building.footprint)
        # Rounding may add a column outside.
        np.testing.assert_array_equal(seen.steps[:9, :14], building.lattice.steps)
        np.testing.assert_array_equal(seen.coverable[:9, :14], free)
    assert building.name == "noise"


def test_starts_are_drawn_among_what_can_be_reached():
    building = drawn(*TWO_ROOMS)
    assert np.count_nonzero(building.reachable) == CELLS
    starts = [building.started_at(number).start for number in range(4)]
    assert starts[0] == building.start
    assert len(set(starts)) > 1
    assert starts == [building.started_at(number).start for number in range(4)]
    assert all(building.reachable[start] for start in starts)


def test_names_and_cells_of_files(tmp_path):
    file = tmp_path / "attic.npy"
    np.save(file, np.ones((2, 3), bool))
    file.with_suffix(".json").write_text('{"start": [1, 2], "cell_m": 0.6}')
    (attic,) = BuildingChoice((str(file),), 0, 0).buildings()
    assert (attic.name, attic.start) == ("attic", (1, 2))
    assert attic.footprint.cell_m == 0.6


def test_only_what_is_in_sight_is_known():
    building = drawn(*TWO_ROOMS)
    listener = Listener(Sight(building, 1.0))
    listener.look(centre_px(building, building.start))
    assert listener.value_at(building, (1, 1)) == 0
    assert listener.value_at(building, (0, 2)) == 100
    assert listener.value_at(building, (4, 5)) == -1  # too far
    listener.look(centre_px(building, (3, 5)))
    assert listener.value_at(building, (3, 7)) == -1  # behind a wall
    listener.look(centre_px(building, (2, 5)))
    assert listener.value_at(building, (2, 8)) == 0
    known = listener.grid.cells >= 0
    rows, cols = known.shape
    assert rows * cols < building.truth.cells.size
    assert listener.heard[0] is MapReceived


def test_updates_show_as_much_as_whole_maps():
    building = drawn(*TWO_ROOMS)
    listener, other = Listener(Sight(building, 1.0)), Sight(building, 1.0)
    for cell in [(1, 2), (1, 3), (2, 3), (2, 5), (2, 6), (2, 7), (3, 8)]:
        listener.look(centre_px(building, cell))
        other.look(centre_px(building, cell))
    assert {MapReceived, PatchReceived} <= set(listener.heard)
    whole = other.news().grid
    assert whole.geometry == listener.grid.geometry
    np.testing.assert_array_equal(whole.cells, listener.grid.cells)
    assert other.news() is None


def test_an_obstacle_that_has_gone_is_seen_to_be_gone():
    building = drawn(*TWO_ROOMS)
    sight = Sight(building, 3.0)
    listener = Listener(sight)
    at = centre_px(building, (2, 5))
    listener.look(at)
    sight.truth[4:6, 12:14] = 100  # the door, cell (2, 6)
    assert not sight.is_clear(at, centre_px(building, (2, 7)))
    listener.look(at)
    assert listener.value_at(building, (2, 6)) == 100
    sight.truth[4:6, 12:14] = 0
    listener.look(at)
    assert listener.value_at(building, (2, 6)) == 0
    assert sight.is_clear(at, centre_px(building, (2, 7)))


def test_a_robot_takes_time_to_turn():
    building = drawn(*TWO_ROOMS)
    sight = Sight(building, 1.0)
    robot = Robot(centre_px(building, (1, 1)), CELL_M)
    robot.follow(np.array([(1, 1), (1, 2), (2, 2), (2, 1), (2, 2)], np.int32))
    turns = []
    while (leg := robot.next_leg(sight)) is not None:
        turns.append(round(leg.quarters, 6))
        assert leg.distance_m == pytest.approx(CELL_M)
        robot.drive(leg, arrival_s=1.0)
    assert turns == [0.0, 1.0, 1.0, 2.0]
    assert PACE.seconds(CELL_M, 2.0) == pytest.approx(4.0)
    assert robot.ahead.tolist() == [[2, 2]]


def test_kept_is_counted_up_to_the_first_change():
    lattice = CoverageLattice.from_free(np.ones((3, 6), bool))
    before = np.array([(0, col) for col in range(6)], np.int32)
    watch = Watch(next_cells=4)

    def compare(before, after, lattice, *, with_path=True, with_map=True):
        watch.compare(before, after, lattice, with_path=with_path, with_map=with_map)

    detour = np.array([(0, 0), (0, 1), (1, 1), (1, 2), (0, 2), (0, 3)], np.int32)
    compare(before, before[:3], lattice)
    compare(before, detour, lattice, with_map=False)
    compare(before, before[::-1], lattice)
    compare(before, before, lattice)
    compare(before, before, lattice, with_path=False)
    assert watch.kept == [0.5, 0.25, 0.0, 1.0]
    assert watch.updates == [False, False, True, True]
    # One that could not have been driven is no standard, nor one that was at its end.
    walled = CoverageLattice.from_free(free_of("......", "......", "..#..."))
    compare(before, detour, walled)
    compare(before[:1], before, lattice)
    compare(before, before[:0], lattice)
    assert (len(watch.kept), len(watch.updates)) == (4, 4)


def test_a_mission_covers_all_and_can_be_had_again():
    building = drawn(*TWO_ROOMS)
    missions = [mission_in(building) for _ in range(2)]
    verdict = judged(missions[0])
    assert missions[0].done
    assert (verdict.cells, verdict.missed, verdict.problems) == (CELLS, 0, ())
    assert verdict.steps == CELLS - 1 + verdict.revisits
    assert missions[0].now == pytest.approx(PACE.seconds(CELL_M * verdict.steps, verdict.quarters))
    at_90, at_99, at_100 = verdict.reached
    assert at_90 < at_99 <= at_100 == (missions[0].now, verdict.steps)
    assert missions[0].robot.trail == missions[1].robot.trail
    watch = missions[0].watch
    assert watch.paths > len(watch.replans) > 0
    assert (watch.waiting_s, watch.held_up, watch.stale_m, watch.faults) == (0.0, 0, 0.0, [])
    assert all(0.0 <= share <= 1.0 for share in watch.kept)


def test_the_judge_finds_walls_walked_through_and_cells_left_out():
    building = drawn(*TWO_ROOMS)
    mission = mission_in(building)
    trail = list(mission.robot.trail)
    last = trail[-1]
    mission.robot.trail[:] = [at for at in trail if at != last]
    assert not judged(mission).reached[-1]
    mission.robot.trail[:] = list(itertools.takewhile(lambda at: at != last, trail))
    assert judged(mission).missed > 0
    mission.robot.trail[:] = [*trail, centre_px(building, (0, 0))]
    assert any("jumps" in problem for problem in judged(mission).problems)


def test_a_robot_that_is_walled_in_gives_up():
    building = drawn(*TWO_ROOMS)
    mission = OnlineMission(building, CONDITIONS)
    mission.sight.truth[:] = 100
    mission.run()
    assert not mission.done
    assert mission.watch.waiting_s > 60.0
    assert judged(mission).missed == CELLS - 1


def plan_of(**given):
    nothing = BuildingChoice((), 0, 0)
    usual = {
        "choice": nothing, "starts": 1, "ranges_m": (3.5,), "seeds": 1,
        "pace": PACE, "with_turns": False, "proposals": 20_000,
    }  # fmt: skip
    return OnlinePlan(**{**usual, **given})


def test_every_planner_has_a_row_and_the_first_the_figures(tmp_path):
    file = tmp_path / "room.npy"
    np.save(file, np.ones((5, 9), bool))
    names = ("fasaco", "fasaco-anew", "zigzag")
    plan = plan_of(choice=BuildingChoice((str(file),), 0, 0), ranges_m=(0.7,), planners=names)
    runs = list(measure(plan, lambda _: None))
    assert len(runs) == count(plan) == 3
    assert [run.planner for run in runs] == list(names)
    assert all(run.covered_all for run in runs)
    told = report(with_turns=False, about={}, runs=runs)
    assert told.figures["missions"] == 1
    assert list(told.figures["planners"]) == list(names)
    steps = [one["steps_ratio_median"] for one in told.figures["planners"].values()]
    assert steps == pytest.approx([run.steps_ratio for run in runs])
    (*_, table) = told.tables
    assert [row[0] for row in table.rows] == list(names)


def test_a_building_of_one_cell_is_refused(tmp_path):
    file = tmp_path / "cell.npy"
    np.save(file, np.ones((1, 1), bool))
    plan = plan_of(choice=BuildingChoice((str(file),), 0, 0))
    with pytest.raises(BadConfiguration, match="nowhere to go"):
        next(measure(plan, lambda _: None))


def test_goals_are_those_of_what_was_measured():
    def limits(*, with_turns):
        found = goals(Summary([]), with_turns=with_turns)
        return {goal.what: goal.limit for goal in found if "known" in goal.what}

    assert list(limits(with_turns=False).values()) == [1.015, 1.07]
    assert list(limits(with_turns=True).values()) == [1.05]


def test_the_benchmark_online_reports_its_figures(capsys, tmp_path):
    file = tmp_path / "rooms.npy"
    np.save(file, free_of(*TWO_ROOMS))
    words = ["--grids", str(file), "--starts", "2", "--ranges", "1"]
    options = ["--proposals", "20000", "--cost", "turns", "--json"]
    assert main(["online", *words, *options]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["missions"], document["covered_all"]) == (2, True)
    assert 1.0 <= document["steps_ratio_median"] <= document["steps_ratio_worst"] < 2.0
    assert 1.0 <= document["time_ratio_median"] < 2.0
    assert 0.0 <= document["overlap_median"] < 1.0
    assert 0.0 < document["replan_ms_p50"] <= document["replan_ms_p99"] <= document["replan_ms_max"]
    assert document["full_plan_ms"] > 0.0
    assert document["ingest_ms_p99"] > 0.0
    assert 0.0 < document["replan_cpu_ms_p50"] <= document["replan_cpu_ms_p99"]
    assert 0.0 <= document["unchanged_share"] <= 1.0
    assert 0.0 <= document["kept_share"] <= 1.0
    assert document["waiting_share"] == 0.0
    assert document["conditions"]["cost"] == "turns"
    assert [run["covered_all"] for run in document["runs"]] == [True] * 2
    assert document["goals"][0]["what"].startswith("all reachable")


def test_the_benchmark_online_prints_its_tables(capsys, tmp_path):
    file = tmp_path / "rooms.npy"
    np.save(file, free_of(*TWO_ROOMS))
    words = ["--grids", str(file), "--starts", "1", "--ranges", "2"]
    assert main(["online", *words, "--proposals", "1000"]) == 0
    shown = capsys.readouterr().out
    for words in ("1 missions in unknown", "rooms, 2 m", "latency", "goals of the default options"):
        assert words in shown
    assert "NOT ALL" not in shown
    assert "\\n" not in shown, "cells have two lines"
