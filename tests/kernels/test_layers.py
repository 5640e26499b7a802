"""Layers of a ground, and the bound on the longest walk that they give."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.layers import NONE, layers_of, longest_by_layers
from tests import naive
from tests.support.drawn import free_cells, ground
from tests.support.examples import examples


def layered(steps, starts):
    """The layers of the ground around some starts."""
    cols = steps.shape[1]
    away = np.full(steps.shape, -1, np.int32)
    for start in starts:
        for cell, distance in naive.distances(steps, start).items():
            away[cell] = distance if away[cell] < 0 else min(away[cell], distance)
    away = away.ravel()
    cells = np.flatnonzero(away >= 0)
    inward = cells[np.argsort(-away[cells], kind="stable")]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    return layers_of(steps.ravel(), offsets, inward, away), away.reshape(steps.shape)


def naive_parts(steps, away, depth):
    """The connected parts of the cells at least some steps away."""
    around = naive.neighbours(steps)
    left = set(map(tuple, np.argwhere(away >= depth).tolist()))
    parts = []
    while left:
        part, ring = set(), [min(left)]
        while ring:
            part.update(ring)
            ring = {there for here in ring for there in around[here].values()} & left - part
        left -= part
        parts.append(part)
    return parts


def naive_visits(steps, away, depth, part, most):
    """The least visits of a part, and robots that come, if returning walks have some steps."""
    here = {cell for cell in part if away[cell] == depth}
    beyond = [inner for inner in naive_parts(steps, away, depth + 1) if inner <= part]
    found = [naive_visits(steps, away, depth + 1, inner, most) for inner in beyond]
    left = max(most - 2 * depth - 1, 0.5)
    visits = sum(inner for inner, _ in found)
    robots = max([int(np.ceil(visits / left)), *(robots for _, robots in found)])
    if not depth:
        return visits, robots
    visits += max(len(here), 2 * robots)
    return visits, max(robots, int(np.ceil(visits / (left + 2))))


@given(data=st.data())
@examples(60)
def test_layers_and_their_bound_are_those_counted_part_by_part(data):
    free = free_cells(data)
    steps = CoverageLattice.from_free(free).steps
    cells = ground(steps, free)
    if not cells:
        return
    starts = data.draw(st.lists(st.sampled_from(cells), min_size=1, max_size=4, unique=True))
    layers, away = layered(steps, starts)
    told = sorted(zip(layers.depths.tolist(), layers.cells.tolist(), strict=True))
    assert told == sorted(
        (depth, sum(away[cell] == depth for cell in part))
        for depth in range(away.max() + 1)
        for part in naive_parts(steps, away, depth)
    )
    for depth, above in zip(layers.depths, layers.above, strict=True):
        assert layers.depths[above] == depth - 1 if depth else above == NONE
    least = 2 * int(away.max())
    bound = longest_by_layers(layers, len(starts), least, 2)

    def is_enough(most):
        parts = [naive_visits(steps, away, 0, part, most) for part in naive_parts(steps, away, 0)]
        robots = max(robots for _, robots in parts)
        visits = sum(visits for visits, _ in parts)
        return robots <= len(starts) and visits <= len(starts) * max(most - 1, 0)

    assert is_enough(bound)
    assert bound == least or not is_enough(bound - 2)


def test_of_four_robots_one_has_one_of_three_rooms_for_itself():
    """Corridors of nine cells lead to rooms of 45; all robots together pass no layer that often."""
    free = np.zeros((15, 29), np.bool_)
    free[14, 5:24] = free[5:, 14] = True
    free[6:, :5] = free[6:, 24:] = free[:5, 10:19] = True
    layers, _ = layered(CoverageLattice.from_free(free).steps, [(14, 14)])
    assert longest_by_layers(layers, 4, 2, 2) >= 2 * 9 + 45
