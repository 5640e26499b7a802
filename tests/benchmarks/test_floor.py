"""Benchmark of lines over the floor of a small building, planned and driven; its report."""

import json

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from maps.map_writer import write_map
from tests.benchmarks.__main__ import main
from tests.benchmarks.floor import CASES, CENTRES, ONLINE, THOROUGH
from tests.support.rooms import RESOLUTION_M, WALL, fill, room


def test_a_line_sweeps_more_than_the_centres_and_touches_nothing(capsys, tmp_path):
    file, pixels = tmp_path / "rooms.yaml", fill(room(2.4, 2.1), 1.1, 0.8, 1.5, 1.1, WALL)
    write_map(
        OccupancyGrid(GridGeometry(*pixels.shape, RESOLUTION_M, Pose2D(0.0, 0.0)), pixels), file
    )
    main(["floor", "--maps", str(file), "--json"])
    document = json.loads(capsys.readouterr().out)
    runs = {run["case"]: run for run in document["floors"]}
    assert tuple(runs) == CASES
    assert all(run["illegal_share"] == 0.0 for run in runs.values())
    assert runs[CENTRES]["swept_share"] < 0.8
    assert runs[THOROUGH]["swept_share"] > 0.97
    assert runs[ONLINE]["swept_share"] > 0.95
    assert runs[CENTRES]["ratio"] == 1.0
    assert runs[ONLINE]["replan_p99_ms"] >= runs[ONLINE]["step_p99_ms"] > 0.0
    assert {goal["what"] for goal in document["goals"]} >= {"illegal share, worst"}


def test_a_building_that_is_not_there_is_named(capsys):
    assert main(["floor", "--maps", "nowhere"]) != 0
    assert "nowhere" in capsys.readouterr().err
