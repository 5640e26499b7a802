"""Grids from the authors' maps: cells by their rule, and the two grids of Table I."""

import json

import numpy as np
import pytest
import yaml

from fasaco_edge.grid.map_files import read_map
from tests.benchmarks.table1.grids import PUBLISHED, authors_grid, digest, main
from tests.support.grids import REFERENCE

# Of 2 x 2 pixels: the lower right cell is closed off, one pixel occupies the cell beside it.
DRAWN = """\
......
.....#
?.#.#.
...###
"""


def map_file(folder, drawn=DRAWN, origin=(-0.2, -0.2)):
    shades = {".": 254, "#": 0, "?": 205}
    rows = [[shades[letter] for letter in row] for row in drawn.split()]
    pixels = np.array(rows, np.uint8)
    (folder / "site.pgm").write_bytes(b"P5 %d %d 255\n" % pixels.shape[::-1] + pixels.tobytes())
    about = {
        "image": "site.pgm", "resolution": 0.05, "origin": [*origin, 0.0], "negate": 0,
        "occupied_thresh": 0.65, "free_thresh": 0.196,
    }  # fmt: skip
    (folder / "site.yaml").write_text(yaml.safe_dump(about))
    return folder / "site.yaml"


def test_an_occupied_pixel_fills_its_cell_and_unknown_is_free(tmp_path):
    truth = read_map(map_file(tmp_path, origin=(0.0, 0.0)))
    grid, start = authors_grid(truth, 0.1, (0.05, 0.05))
    assert start == (0, 0)
    assert grid.tolist() == [[True, False, False], [True, True, False]]


def test_the_command_writes_grid_and_start(tmp_path, capsys):
    file = map_file(tmp_path)
    assert main([str(file), "--cell", "0.1", "--start-xy=-0.19,-0.1", "--out", str(tmp_path)]) == 0
    assert "none of the paper's grids" in capsys.readouterr().out
    assert np.load(tmp_path / "site.npy").sum() == 3
    assert json.loads((tmp_path / "site.json").read_text()) == {"start": [1, 0]}
    assert main([str(file), "--cell", "0.1", "--out", str(tmp_path)]) == 1
    assert "off the map" in capsys.readouterr().err


@pytest.mark.parametrize("known", PUBLISHED, ids=lambda known: known.grid)
def test_the_published_maps_become_the_papers_grids(known, tmp_path, capsys):
    file = REFERENCE.parent / "maps" / f"nobleo_{known.file}"
    if not file.exists():
        pytest.skip("the authors' maps are not at hand")
    truth = read_map(file)
    assert (truth.cells.shape, digest(truth)) == (known.pixels, known.sha256)
    assert main([str(file), "--out", str(tmp_path)]) == 0
    made = np.load(tmp_path / f"{known.grid}.npy")
    assert np.array_equal(made, np.load(REFERENCE / f"{known.grid}.npy"))
    assert "the paper's" in capsys.readouterr().out
