"""Map files whose keys contradict their images: what is made of them, and what is said."""

import numpy as np
import pytest
from PIL import Image

from fasaco_edge.grid.map_files import read_map, read_map_rows
from fasaco_edge.mission.orders.mask import inline_mask
from tests.grid.test_map_files import described

# Ten pixels each: wall, never seen, seen free.
SAVED = np.repeat(np.array([[0, 205, 254]], np.uint8), 10, axis=0)


def cells(path):
    return read_map(path).cells[0].tolist()


@pytest.mark.parametrize("kind", ["L", "RGB", "RGBA"])
@pytest.mark.parametrize("keys", [{}, {"mode": "scale"}])
def test_unknown_of_map_saver_stays_unknown_at_any_threshold(tmp_path, kind, keys, caplog):
    path = described(tmp_path, Image.fromarray(SAVED).convert(kind), free_thresh=0.25, **keys)
    assert cells(path) == [100, -1, 0]
    (record,) = caplog.records
    assert record.getMessage().startswith(
        f"{path}: 10 pixels of the grey 205, which map_saver writes for never seen, are free"
    )
    assert "free_thresh: 0.196" in record.getMessage()


def test_sixteen_bit_images_follow_the_same_convention(tmp_path, caplog):
    path = described(tmp_path, Image.fromarray(SAVED.astype(np.uint16) * 257), free_thresh=0.25)
    assert cells(path) == [100, -1, 0]
    assert caplog.records


def test_each_shade_follows_the_thresholds(tmp_path, caplog):
    shades = np.arange(256, dtype=np.uint8).reshape(16, 16)
    path = described(tmp_path, Image.fromarray(shades), free_thresh=0.25)
    assert read_map(path).cells[16 - 1 - 205 // 16, 205 % 16] == 0
    assert not caplog.records


@pytest.mark.parametrize(
    ("keys", "row", "said"),
    [
        (
            {"mode": "raw"},
            [0, -1, -1],
            "in mode raw, 20 pixels of greys from 101 to 254 are unknown",
        ),
        ({"negate": 1}, [0, 100, 100], "negate: 1 turns white pixels into walls, and 10 pixels"),
        ({"origin": [0, 0, 90]}, [100, -1, 0], "origin's yaw is in radians, got 90"),
    ],
)
def test_keys_that_turn_a_saved_map_over_are_named(tmp_path, keys, row, said, caplog):
    path = described(tmp_path, Image.fromarray(SAVED), **keys)
    assert cells(path) == row
    assert [said in record.getMessage() for record in caplog.records] == [True]


def test_a_mask_has_nothing_unknown(tmp_path, caplog):
    path = described(tmp_path, Image.fromarray(SAVED), free_thresh=0.25)
    _, stripes = read_map_rows(path, is_mask=True)
    assert [row.tolist() for row in np.concatenate(list(stripes))[:1]] == [[100, 0, 0]]
    inline_mask(path, 65)
    assert not caplog.records
