"""The grids that are measured on, and where a walk starts on them."""

import json

import numpy as np
import pytest

from fasaco_edge.bench.processes import building, robot_pose, with_crate
from fasaco_edge.errors import MapFileError, NothingToCover
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.planners.grids import MAP_FOOTPRINT, read_grid


def saved(folder, *rows):
    file = folder / "grid.npy"
    np.save(file, np.array([[letter == "." for letter in row] for row in rows[::-1]]))
    return file


def test_start_beside_a_grid_is_taken(tmp_path):
    file = saved(tmp_path, "...", "...")
    file.with_suffix(".json").write_text(json.dumps({"start": [1, 2], "note": "any"}))
    grid = read_grid(file)
    assert (grid.name, grid.start) == (str(file), (1, 2))
    assert grid.lattice.coverable.all()


def test_the_default_start_is_in_the_largest_area_by_the_origin(tmp_path):
    """In the largest connected area, the cell nearest to the origin."""
    assert read_grid(saved(tmp_path, "##...", "##...", ".#...", ".#.##")).start == (0, 2)


@pytest.mark.parametrize("text", ["{}", "[]", '{"start": 3}', '{"start": [1]}', "no json"])
def test_malformed_start_is_refused(tmp_path, text):
    file = saved(tmp_path, "..")
    file.with_suffix(".json").write_text(text)
    with pytest.raises(MapFileError, match=r"grid\.json: expected an object with start"):
        read_grid(file)


def test_grid_without_a_free_cell_is_refused(tmp_path):
    with pytest.raises(NothingToCover):
        read_grid(saved(tmp_path, "##"))


def test_builtin_map_starts_where_it_says():
    grid = read_grid("office")
    assert grid.lattice.coverable[grid.lattice.local(grid.start)]


def test_each_map_of_the_building_changes_its_reachable_cells():
    plain, before = building(), None
    for number in range(14):
        grid = with_crate(plain, number, stamp_ns=number)
        lattice = CoverageLattice.from_map(grid, MAP_FOOTPRINT)
        pose = robot_pose(0).pose
        start = lattice.local(lattice.cell_at(pose.x, pose.y))
        reachable = reachable_from(lattice.steps, *start).astype(bool)
        assert np.count_nonzero(reachable) > 20_000
        if before is not None:
            assert (reachable & ~before).any()
            assert (before & ~reachable).any()
        before = reachable
    assert grid.stamp_ns == 13
