"""Large things are drawn as often as the file may grow, and the newest is drawn in the end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rerun")

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene import archetypes
from fasaco_edge.recording.scene.blueprint import build_blueprint
from fasaco_edge.recording.scene.layers import BURST_S, RATES, Layers, size_in_file
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.recording.write.writer import RecordingWriter

SECOND_NS = 1_000_000_000
RATE = RATES[entities.MAP]


class Canvas:
    """Layers, and what was drawn when."""

    def __init__(self) -> None:
        self.layers = Layers()
        self.drawn: list[tuple[str, int]] = []

    def draw(self, name: str, size: int, at_s: float, layer: str = entities.MAP) -> None:
        now_ns = round(at_s * SECOND_NS)
        self.layers.draw(layer, size, lambda: self.drawn.append((name, size)), now_ns)


def test_below_the_rate_everything_is_drawn_at_once():
    canvas = Canvas()
    for number in range(int(BURST_S)):
        canvas.draw(f"map {number}", RATE, at_s=0.0)
    assert len(canvas.drawn) == BURST_S
    canvas.draw("one too many", RATE, at_s=0.0)
    assert len(canvas.drawn) == BURST_S
    # Another layer has room of its own.
    canvas.draw("path", 100, at_s=0.0, layer=entities.PATH)
    assert canvas.drawn[-1] == ("path", 100)


def test_a_delayed_layer_draws_its_newest_content():
    canvas = Canvas()
    canvas.draw("huge", round(RATE * (BURST_S + 10)), at_s=0.0)
    canvas.draw("old", 10, at_s=1.0)
    canvas.draw("new", 10, at_s=2.0)
    canvas.layers.catch_up(9 * SECOND_NS)
    assert [name for name, _ in canvas.drawn] == ["huge"]
    canvas.layers.catch_up(11 * SECOND_NS)
    assert [name for name, _ in canvas.drawn] == ["huge", "new"]
    canvas.draw("huge", round(RATE * 2 * BURST_S), at_s=20.0)
    canvas.draw("last", 10, at_s=21.0)
    canvas.layers.finish()
    canvas.layers.finish()
    assert [name for name, _ in canvas.drawn] == ["huge", "new", "huge", "last"]


@given(st.lists(st.tuples(st.floats(0, 5), st.integers(0, 20 * RATE)), min_size=1, max_size=200))
def test_it_grows_no_faster_than_it_may(draws):
    canvas, now_s = Canvas(), 0.0
    for after_s, size in draws:
        now_s += after_s
        canvas.draw("map", size, now_s)
    drawn = [size for _, size in canvas.drawn]
    assert sum(drawn) <= RATE * (BURST_S + now_s) + max(drawn) + 1


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3])
def test_the_size_is_about_what_the_file_grows_by(tmp_path, share):
    rng = np.random.default_rng(0)
    cells = np.where(rng.random((600, 600)) < share, 100, 0).astype(np.int8)
    cells[::50] = 100
    cells[:, 400:] = -1
    grid = OccupancyGrid(GridGeometry(600, 600, 0.05, Pose2D(0.0, 0.0)), cells)
    writer = RecordingWriter(tmp_path, "run", DiskBudget(10**9, 0), build_blueprint(None))
    sizes = []
    for second in range(10, 40, 10):
        writer.log(entities.MAP, archetypes.map_archetype(grid))
        writer.sync(second * SECOND_NS)
        sizes.append(writer.size)
    assert writer.close()
    grown = sizes[-1] - sizes[-2]
    print(f"{grown} bytes, taken for {size_in_file(cells)}")
    assert 0.5 * grown - 4000 < size_in_file(cells) < 2.5 * grown + 4000


def test_a_line_keeps_its_corners_and_loses_the_rest():
    lanes = np.array(
        [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (2, 1), (1, 1), (2, 1), (3, 1)], float
    )
    assert archetypes.corners(lanes).tolist() == [[0, 0], [3, 0], [3, 1], [1, 1], [3, 1]]
    # A point that comes twice bends nothing away.
    assert archetypes.corners(lanes[[0, 1, 1, 2]]).tolist()[-1] == [2, 0]
    for count in (0, 1, 2):
        assert len(archetypes.corners(lanes[:count])) == count
