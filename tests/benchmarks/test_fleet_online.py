"""Benchmark of fleets in unknown buildings: time against one robot's, progress, conflicts."""

import json

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from maps.map_writer import write_map
from tests.benchmarks.__main__ import main
from tests.support.rooms import FREE, RESOLUTION_M, WALL, fill, room


def test_robots_share_an_unknown_building_without_touching(capsys, tmp_path):
    # Two rooms, and a wide door between them.
    pixels = fill(fill(room(6.0, 3.0), 2.9, 0.0, 3.0, 3.0, WALL), 2.9, 1.0, 3.0, 2.2, FREE)
    geometry = GridGeometry(*pixels.shape, RESOLUTION_M, Pose2D(-0.75, -0.75))
    write_map(OccupancyGrid(geometry, pixels), file := tmp_path / "rooms.yaml")
    words = ["--maps", str(file), "--generated", "0", "--robots", "2", "--json"]
    assert main(["fleet-online", *words]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert run["time_ratio"] < 0.75
    assert run["twice"] < 0.15
    assert run["touches"] == 0
