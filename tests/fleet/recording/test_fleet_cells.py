"""Cells that a fleet tells of: their bounds, frames and distances, and what is noted of them."""

from __future__ import annotations

from collections import deque

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as some

pytest.importorskip("rerun")

from fasaco_edge.fleet.observer.cells import (
    FAR,
    MOST_SPAN,
    Seat,
    TileSet,
    cells_of,
    distances,
    window_of,
)
from fasaco_edge.fleet.recording.notes import (
    NOTES_VERSION,
    NoteBatch,
    NotedRobot,
    decode_notes,
    encode_notes,
)
from tests.fleet.told import tiles


@given(some.arrays(np.bool_, (6, 7)), st.tuples(st.integers(-1, 6), st.integers(-1, 7)))
def test_distances_are_those_of_a_search_step_by_step(ground, start):
    found = distances(ground, start)
    expected = np.full(ground.shape, FAR, np.int64)
    free = {(row, col) for row, col in np.argwhere(ground).tolist()}
    waiting = deque([(start, 0)] if start in free else [])
    free.discard(start)
    while waiting:
        (row, col), steps = waiting.popleft()
        expected[row, col] = steps
        for cell in ((row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)):
            if cell in free:
                free.discard(cell)
                waiting.append((cell, steps + 1))
    assert found.tolist() == expected.tolist()


@given(st.sets(st.tuples(st.integers(-200, 200), st.integers(-200, 200)), max_size=40))
def test_cells_are_decoded_from_their_tiles(cells):
    assert {tuple(cell) for cell in cells_of(tiles(cells)).tolist()} == cells


def test_a_cell_stays_in_place_on_a_turned_and_shifted_lattice():
    here, there = Seat(0.3, 30.0, 1.0, 2.0, 15.0), Seat(0.3, 0.0, -4.0, 0.5, -20.0)
    cells = np.argwhere(np.ones((9, 11), bool)) - (3, 2)
    carried = here.carried(cells, there)
    geometries = [seat.geometry(window_of(of)) for seat, of in ((here, cells), (there, carried))]
    for cell, other in zip(cells - cells.min(axis=0), carried - carried.min(axis=0), strict=True):
        x, y = geometries[0].to_map(cell[1] + 0.5, cell[0] + 0.5)
        col, row = geometries[1].to_pixels(x, y)
        assert (np.floor(row), np.floor(col)) == tuple(other)
    assert here.carried(cells, here) is cells


def test_a_robot_that_lies_about_far_cells_takes_no_memory():
    kept = TileSet()
    assert kept.take(tiles([(5, 5)]), grows=True)
    assert not kept.take(tiles([(5, 64 * MOST_SPAN + 5), (-(2**20), 0)]), grows=True)
    assert kept.refused == 2
    assert kept.cells().tolist() == [[5, 5]]
    assert kept.take(tiles([(5, 64 * (MOST_SPAN - 1))]), grows=True)


def test_swept_cells_only_grow_and_of_ground_the_newest_counts():
    swept, ground = TileSet(), TileSet()
    for kept, grows, left in ((swept, True, [[1, 1], [2, 2]]), (ground, False, [[2, 2]])):
        kept.take(tiles([(1, 1)]), grows=grows)
        assert not kept.take(tiles([(1, 1)]), grows=grows)
        kept.take(tiles([(2, 2)]), grows=grows)
        assert kept.cells().tolist() == left


ROBOT = NotedRobot("r1", 0.2, 0.3, 0.0, 0.0, 0.0, 0.0)


def test_notes_are_read_back_and_invalid_ones_refused():
    batch = NoteBatch(NOTES_VERSION, 7, "house", [ROBOT], [])
    blob = encode_notes(batch)
    assert decode_notes(blob) == batch
    later = encode_notes(msgspec.structs.replace(batch, version=NOTES_VERSION + 1))
    for wrong in (b"", blob[:-3], b"x" + blob, later):
        with pytest.raises(ValueError, match="notes of a fleet"):
            decode_notes(wrong)
    for cell_m in (5e-324, 1e200):
        robots = [msgspec.structs.replace(ROBOT, cell_m=cell_m)]
        with pytest.raises(msgspec.ValidationError, match=r"at `\$\[3\]\[0\]\[2\]`"):
            decode_notes(encode_notes(msgspec.structs.replace(batch, robots=robots)))
