"""Layers, curves and paths are drawn as often as the file may grow, and as they were in the end."""

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
from fasaco_edge.recording.scene.curves import OF_PATH, OF_STATUS, PERIOD_NS, Curves
from fasaco_edge.recording.scene.drawings import LOGGED_AGAIN_NS, PathDrawing
from fasaco_edge.recording.scene.layers import BURST_S, RATES, Anchor, Layers, size_in_file
from fasaco_edge.recording.scene.runcard import RunDescription
from fasaco_edge.recording.scene.scene import Scene
from fasaco_edge.wire.documents.json_text import decode_tolerant, encode_json
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.status import BatteryReport, Status
from fasaco_edge.wire.messages.paths import PathMessage
from tests.support.recordings import SCALAR, TEXT, read_column, writer_in
from tests.support.statuses import FULL

SECOND_NS = 1_000_000_000
RATE = RATES[entities.MAP]


class Canvas:
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
    writer = writer_in(tmp_path)
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


def test_a_curve_is_a_figure_a_sum_or_a_rate(tmp_path):
    writer = writer_in(tmp_path)
    curves = Curves(writer)
    for second in range(0, 121, 40):
        writer.at(second * SECOND_NS)
        battery = BatteryReport(level=0.8)
        curves.add(OF_STATUS, Status(uptime_s=second, cpu_s=0.1 * second, battery=battery))
        curves.add(OF_PATH, PathAttachment(saved_by_ants_s=2.0))
    assert writer.close()
    (part,) = tmp_path.glob("*.rrd")
    assert read_column(part, "metrics/resources/battery", SCALAR).values[0] == [80.0]
    assert read_column(part, "metrics/resources/processor", SCALAR).values[0] == [10.0]
    assert read_column(part, "metrics/saved/ants", SCALAR).values == [[2.0], [4.0], [6.0], [8.0]]


def test_constants_are_drawn_rarely_and_changes_at_once(tmp_path):
    writer = writer_in(tmp_path)
    curves = Curves(writer)
    period_s = PERIOD_NS // SECOND_NS
    for second in range(2 * period_s + 10):
        writer.at(second * SECOND_NS)
        curves.draw("steps", 1.0 if second < 5 else 2.0)
        curves.draw("noisy", 100.0 + second % 2, noise=0.05)
        curves.draw("last", 100.0 + (second > 2 * period_s + 5), noise=0.05)
    curves.finish()
    assert writer.close()
    (part,) = tmp_path.glob("*.rrd")
    steps = read_column(part, "steps", SCALAR)
    assert (steps.wall_ns // SECOND_NS).tolist() == [0, 5, 5 + period_s, 5 + 2 * period_s]
    assert steps.values == [[1.0], [2.0], [2.0], [2.0]]
    noisy = read_column(part, "noisy", SCALAR)
    assert len(noisy.values) == 4
    assert read_column(part, "last", SCALAR).values[-1] == [101.0]


def floors_drawn(folder, time_scale):
    """Return the number of drawings of floor that changes each second, for two minutes."""
    writer, rng = writer_in(folder), np.random.default_rng(1)
    scene = Scene(writer, RunDescription("robot", "now"))
    config = {"robot": {"time_scale": time_scale}}
    scene.add_status(decode_tolerant(encode_json(FULL | {"config": config}), Status))
    for second in range(120):
        writer.at(second * SECOND_NS)
        swept = rng.integers(0, 101, (60, 60), dtype=np.int8)
        scene.add_floor(OccupancyGrid(GridGeometry(60, 60, 0.05, Pose2D(0.0, 0.0)), swept))
    # Without ``finish``, which draws what waits.
    assert writer.close()
    (part,) = folder.glob("*.rrd")
    return len(read_column(part, entities.FLOOR, "GridMap:data").values)


def test_a_robot_faster_than_life_is_drawn_more_often(tmp_path):
    for name in ("real", "fast"):
        (tmp_path / name).mkdir()
    assert floors_drawn(tmp_path / "real", 1.0) < 30
    assert floors_drawn(tmp_path / "fast", 20.0) == 120


def shown(folder, paths):
    """Return the lines of paths that are not of level DEBUG: when [s], and the reason."""
    writer = writer_in(folder)
    drawing, empty = PathDrawing(writer, Layers()), np.zeros((0, 2))
    for revision, (at_s, reason, planner) in enumerate(paths, 1):
        writer.at(at_s * SECOND_NS)
        about = PathAttachment(revision=revision, reason=reason, planner=planner)
        drawing.add(PathMessage("map", 0, empty, empty[:, 0]), about, Anchor())
    assert writer.close()
    (part,) = folder.glob("*.rrd")
    texts = read_column(part, entities.PATH_LOG, TEXT)
    levels = read_column(part, entities.PATH_LOG, "TextLog:level").values
    # Each path is in the recording.
    assert len(texts.values) == len(paths)
    return [
        (at_ns // SECOND_NS, text.partition(": ")[2].partition(" (")[0])
        for at_ns, (text,), (level,) in zip(texts.wall_ns, texts.values, levels, strict=True)
        if level != "DEBUG"
    ]


def test_of_plans_of_one_kind_the_first_is_shown_and_one_a_minute(tmp_path):
    minute = LOGGED_AGAIN_NS // SECOND_NS
    paths = [
        (0, "first plan", "aco"),
        (1, "map: 3 cells more", "aco"),
        (2, "line polished", None),
        (3, "map: 1 cell more", "aco"),
        (4, "first plan", "aco"),
        (5, "map: 2 cells more", "aco"),
        (6, "map: 4 cells more", "aco"),
        (minute + 5, "map: 5 cells more", "aco"),
    ]
    assert shown(tmp_path, paths) == [
        (at_s, paths[index][1]) for index in (0, 1, 4, 5, 7) for at_s in (paths[index][0],)
    ]
