"""A fleet's review: what was swept again is told from what was driven through."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.drawing.plot import MapLayer
from fasaco_edge.fleet.recording import notes
from fasaco_edge.fleet.recording.notes import (
    NOTES_VERSION,
    EnteredCell,
    Note,
    NoteBatch,
    NotedRobot,
)
from fasaco_edge.fleet.review import report as fleet
from fasaco_edge.fleet.review.drawing import draw_fleet_mission, robot_tint
from fasaco_edge.fleet.review.report import review_fleet
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from tests.fleet.told import tiles
from tests.support.rooms import RESOLUTION_M, room

CELL_M = 0.5
GROUND = [(row, col) for row in range(8) for col in range(12)]


def noted(robot, way, begin_s, *, waits=(), scale=1.0):
    swept, notes = [], []
    for second, cell in enumerate(way):
        swept.append(cell)
        at_ms = 1000 * (begin_s + second)
        notes.append(
            Note(
                robot, at_ms, "covering", 0.0, 0.0, "other" if second in waits else "", 3, 9, 2,
                500, CELL_M, [4.0], [EnteredCell(at_ms, *cell)], list(tiles(swept)),
                list(tiles(GROUND)) if not second else [],
                stamp_ms=7_000 + round(scale * at_ms), time_scale=scale,
            )
        )  # fmt: skip
    return notes


def lane(row, first, last):
    step = 1 if last >= first else -1
    return [(row, col) for col in range(first, last + step, step)]


def reviewed(monkeypatch, *ways, waits=(), begin_s=0, scale=1.0):
    robots = [
        NotedRobot(f"r{number + 1}", 0.2, CELL_M, 0.0, 0.0, 0.0, 0.0) for number in range(len(ways))
    ]
    notes = []
    for number, way in enumerate(ways):
        notes += noted(number, way, begin_s, waits=waits if number else (), scale=scale)
        begin_s += len(way)
    batch = NoteBatch(NOTES_VERSION, 1, "house", robots, notes)
    monkeypatch.setattr(fleet, "read_notes", lambda paths: [batch])
    return review_fleet([]).figures


SWEPT = [*lane(0, 0, 11), *lane(1, 11, 0), *lane(2, 0, 11)]


def test_to_cross_swept_floor_is_driving_through(monkeypatch):
    across = [(4, 3), (3, 3), (2, 3), (1, 3), (0, 3)]
    figures = reviewed(monkeypatch, SWEPT, across)
    second = figures.robots[1]
    assert (second.through_m2, second.again_m2) == (3 * CELL_M**2, 0.0)
    assert figures.again_share == 0.0


def test_lanes_over_swept_floor_are_sweeping_again(monkeypatch):
    lanes = [(3, 0), *lane(2, 0, 11), *lane(1, 11, 0), *lane(0, 0, 11)]
    figures = reviewed(monkeypatch, SWEPT, lanes)
    second = figures.robots[1]
    # 37 steps, where 14 would have led to the end: 36 cells, of which 22.4 again.
    assert second.again_m2 == pytest.approx(36 * (1 - 14 / 36) * CELL_M**2, abs=0.01)
    assert second.again_m2 + second.through_m2 == pytest.approx(36 * CELL_M**2, abs=0.02)
    assert figures.swept_m2 == 37 * CELL_M**2
    assert figures.robots[0].again_m2 == 0.0


def test_unswept_floor_is_new_even_after_a_month(monkeypatch):
    lanes = [*lane(4, 0, 11), *lane(5, 11, 0), *lane(6, 0, 11)]
    figures = reviewed(monkeypatch, SWEPT, lanes, begin_s=30 * 24 * 3600)
    assert figures.again_m2 == figures.through_m2 == 0.0


@pytest.mark.parametrize("scale", [1.0, 10.0], ids=["real", "simulated"])
def test_makespan_balance_waiting_and_messages(monkeypatch, scale):
    """Durations are by the robots' clocks."""
    ways = lane(0, 0, 10), lane(4, 0, 10)
    figures = reviewed(monkeypatch, *ways, waits=(2, 3, 7), scale=scale)
    first, second = figures.robots
    assert figures.time_scale == scale
    assert figures.makespan_s == 21.0 * scale
    assert (first.waits, first.waited_s) == (0, 0.0)
    waits = second.waits, second.waited_s, second.longest_wait_s
    assert waits == (2, 3.0 * scale, 2.0 * scale)
    assert (first.busy_s, second.busy_s) == (10.0 * scale, 7.0 * scale)
    assert figures.busy_balance == 0.7
    assert figures.swept_balance == 1.0
    assert first.messages_s == pytest.approx(2.2 / scale)
    assert first.kb_s == pytest.approx(0.55 / scale, abs=0.006)
    assert first.driven_m == 11 * CELL_M
    assert (first.plans, first.plan_ms_p99) == (11, 4.0)


def test_robots_have_the_colours_of_the_recording(monkeypatch):
    """They are numbered as they join, whatever their names; a fleet without a recording by name."""
    pixels = room(3.0, 2.0)
    geometry = GridGeometry(*pixels.shape, RESOLUTION_M, Pose2D(0.0, 0.0))
    grid = OccupancyGrid(geometry, pixels)
    lattice = CoverageLattice.from_map(grid, Footprint(0.3, 0.18))
    left = np.arange(geometry.cols) < geometry.cols // 2
    swept = [MapLayer(geometry, np.broadcast_to(half, pixels.shape)) for half in (left, ~left)]
    trails = {"r1": np.array([(0.5, 1.0), (1.0, 1.0)]), "r2": np.array([(2.0, 1.0), (2.5, 1.0)])}
    nothing = MapLayer(geometry, np.zeros(pixels.shape, np.bool_))

    def drawn():
        picture = draw_fleet_mission(
            grid, lattice, trails, swept, nothing, [], title="", lines=()
        )  # fmt: skip
        middle = picture.height // 2
        row = [picture.getpixel((x, middle)) for x in range(picture.width)]
        return [tint for tint in dict.fromkeys(row) if tint in (robot_tint(0), robot_tint(1))]

    assert drawn() == [robot_tint(0), robot_tint(1)]
    robots = [NotedRobot(name, 0.2, CELL_M, 0.0, 0.0, 0.0, 0.0) for name in ("r2", "r1")]
    batch = NoteBatch(NOTES_VERSION, 1, "house", robots, [])
    monkeypatch.setattr(notes, "read_notes", lambda paths: [batch])
    assert drawn() == [robot_tint(1), robot_tint(0)]
