"""What was swept wherever a map lay: the kernel leaves, bit for bit, what its naive twin leaves."""

import math
import time

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.kernels.floor import certain
from fasaco_edge.mission.coverage.floor_tiles import FLOOR_TILE, PIXEL_M, FloorSnapshot, window_of
from fasaco_edge.mission.coverage.loop_closure import MOST_BETWEEN, Motion, certain_floor
from tests import naive
from tests.support.examples import PLAIN

EDGE_M = FLOOR_TILE * PIXEL_M


def tiles_of(seed, at, share):
    """Tiles side by side, with holes, or of scattered pixels where the share is small."""
    rng = np.random.default_rng(seed)
    tiles = {}
    for row in range(3):
        for col in range(2):
            mask = rng.random((FLOOR_TILE, FLOOR_TILE)) < share
            mask[20 * row + 30 :, : 40 * col] = share > 0.5
            if (row, col) != (1, 0):
                tiles[at[0] + row, at[1] + col] = np.packbits(mask, axis=1)
    return tiles


def pixels_of(tiles):
    """The marked pixels of tiles, as a set."""
    marked = set()
    for place, tile in tiles.items():
        window = window_of(place)
        rows, cols = np.nonzero(np.unpackbits(tile, axis=1))
        marked |= set(
            zip((rows + window.row0).tolist(), (cols + window.col0).tolist(), strict=True)
        )
    return marked


MOTIONS = [
    ((-1, -2), (0.0125, -0.0375, 0.0)),
    ((0, 0), (0.0, 0.0, 0.0)),
    ((-2, 1), (0.2, 0.1, 0.05)),
    ((0, -1), (-0.5, 3.0, -2.0)),
    ((300_000, -3_000_000), (0.11, -0.05, 0.02)),
    ((1, 1), (9e6, -1e7, 4.4)),
]


# In plain Python each takes seconds, and the first shows that it runs there.
@pytest.mark.parametrize(("at", "moved"), MOTIONS[: 1 if PLAIN else None])
@pytest.mark.parametrize("share", [0.3, 0.999])
def test_twin_leaves_the_same(at, moved, share):
    tiles = tiles_of(1, at, share)
    start = Pose2D((at[1] + 1) * EDGE_M, (at[0] + 1.5) * EDGE_M, 0.7)
    motion = Motion(start, Pose2D(start.x + moved[0], start.y + moved[1], start.yaw + moved[2]))
    left = pixels_of(tiles | dict(certain_floor(FloorSnapshot(tiles), motion)(tiles)))
    swept, expected = pixels_of(tiles), set()
    for place in tiles:
        window = window_of(place)
        ends = (window.row0, window.row1), (window.col0, window.col1)
        corners = [(PIXEL_M * col, PIXEL_M * row) for row in ends[0] for col in ends[1]]
        ways = [np.hypot(*np.subtract(motion.back(1.0, *each), each)) for each in corners]
        count = min(max(math.ceil(max(ways) / PIXEL_M), 1), MOST_BETWEEN)
        places = [tuple(motion.undone(number / count)) for number in range(1, count + 1)]
        expected |= naive.certain_pixels(swept, places, window)
    assert left == expected
    assert len(left) > 1000 or moved != (0.0, 0.0, 0.0)


def test_kernel_and_tile_have_the_same_size():
    assert (certain.TILE, certain.BLOCKS) == (FLOOR_TILE, FLOOR_TILE // 8)


def test_a_great_floor_is_looked_up_at_once():
    """Pixel by pixel for each of sixteen places, 400 tiles took over a second."""
    one = tiles_of(3, (0, 0), 0.9999)[0, 0]
    tiles = {(row, col): one for row in range(20) for col in range(20)}
    motion = Motion(Pose2D(30.0, 30.0), Pose2D(30.3, 30.1, 0.02))
    left_of = certain_floor(FloorSnapshot(tiles), motion)
    left_of({(0, 0): one})
    started = time.thread_time()
    assert len(left_of(tiles)) == 400
    assert time.thread_time() - started < 0.5
