"""The maps that come along are what maps/draw.py draws, and a robot can cover them."""

import os
import subprocess
import sys

import numpy as np
import pytest
import yaml

from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.map_files import builtin_maps, find_map, read_map, suggested_start
from fasaco_edge.host.resources import folder
from fasaco_edge.planners.problem import CoverageProblem

MAPS = folder("maps")
NAMES = [name for name, _ in builtin_maps()]
VACUUM = Footprint(cell_m=0.3, robot_radius_m=0.18)


def test_the_files_are_what_the_program_draws(tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(MAPS.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    program = [sys.executable, str(MAPS / "draw.py"), str(tmp_path)]
    subprocess.run(program, check=True, env=environment)
    drawn = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {path.name: path.read_bytes() for path in MAPS.iterdir() if path.name in drawn}
    assert kept == drawn
    pictures = {path.name for path in MAPS.iterdir() if path.suffix in (".pgm", ".yaml")}
    assert pictures == set(drawn)


def test_the_required_maps_are_there():
    assert {"office", "flat", "walled_grid", "basement", "warehouse"} <= set(NAMES)


@pytest.mark.parametrize(("name", "why"), builtin_maps())
def test_each_map_says_why_it_exists(name, why):
    assert why
    assert f"| `{name}` |" in (MAPS / "README.md").read_text(encoding="utf-8")
    assert why in (MAPS / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NAMES)
def test_nearly_all_of_a_map_can_be_covered(name):
    path = find_map(name)
    lattice = CoverageLattice.from_map(read_map(path), VACUUM)
    problem = CoverageProblem.of(lattice, lattice.cell_at(*suggested_start(path)))
    # Gaps between furniture where the robot fits but no way leads: no room among them.
    assert np.count_nonzero(problem.unreachable) <= 0.025 * problem.cells


@pytest.mark.parametrize("name", NAMES)
def test_a_map_is_a_building(name):
    grid = read_map(find_map(name))
    free = grid.cells == 0
    edge = np.concatenate([grid.cells[0], grid.cells[-1], grid.cells[:, 0], grid.cells[:, -1]])
    assert (edge == -1).all()
    # A scanner inside sees a wall before it sees the unknown.
    unknown = grid.cells == -1
    assert not (free[1:] & unknown[:-1]).any()
    assert not (free[:-1] & unknown[1:]).any()
    assert not (free[:, 1:] & unknown[:, :-1]).any()
    assert not (free[:, :-1] & unknown[:, 1:]).any()


@pytest.mark.parametrize("name", NAMES)
def test_the_index_knows_the_size(name):
    width, height = yaml.safe_load((MAPS / "index.yaml").read_text())[name]["size_m"]
    grid = read_map(find_map(name))
    known = np.argwhere(grid.cells >= 0)
    size = (np.ptp(known, axis=0) + 1) * grid.geometry.resolution
    np.testing.assert_allclose(size, [height, width], atol=1e-9)
    assert f"{width} x {height}" in (MAPS / "README.md").read_text()
    x0, y0, x1, y1 = grid.geometry.bounds()
    assert x0 < 0 < x1
    assert y0 < 0 < y1


def test_only_built_in_maps_have_a_suggested_start(tmp_path):
    other = tmp_path / "office.yaml"
    other.write_bytes(find_map("office").read_bytes())
    assert suggested_start(other) is None
    assert suggested_start(find_map("office")) == (-1.85, -2.2)
