"""Layers of a ground: connected parts of the cells that are equally far away from the starts.

The cells at least d steps away fall into connected parts; the cells of one that are d steps away
are a layer. Every robot that goes into such a part passes its layer. So layers form trees, the
nearer above the farther.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel, lean_kernel
from fasaco_edge.kernels.lattice.areas import root

NONE = -1


class Layers(NamedTuple):
    """Layers, the farthest first.

    Attributes:
        depths: int64 (m,), distance of each from the nearest start.
        cells: int64 (m,), number of its cells.
        above: int64 (m,), the next layer on the way to the starts, NONE for none.
    """

    depths: NDArray[np.int64]
    cells: NDArray[np.int64]
    above: NDArray[np.int64]


@lean_kernel
def _join(
    steps: NDArray[np.uint8], offsets: NDArray[np.int64], joined: NDArray[np.int32], here: int
) -> None:
    """Join the parts around a cell to its own."""
    for direction in range(4):
        if steps[here] >> direction & 1:
            there = here + offsets[direction]
            if joined[there] != NONE:
                joined[root(joined, there)] = root(joined, here)


@kernel
def layers_of(
    steps: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    cells: NDArray[np.int64],
    distances: NDArray[np.int32],
) -> Layers:
    """Return the layers of a ground.

    Args:
        steps: step masks, uint8 (size,).
        offsets: int64 (4,), difference of flat index for a step in each direction.
        cells: int64 (n,), flat cells of the ground, the farthest first.
        distances: int32 (size,), from the nearest start [steps].
    """
    joined, of = np.full(steps.size, NONE, np.int32), np.full(steps.size, NONE, np.int32)
    depths, sizes = np.zeros(cells.size, np.int64), np.zeros(cells.size, np.int64)
    above = np.full(cells.size, NONE, np.int64)
    begin = count = 0
    while begin < cells.size:
        depth, end = distances[cells[begin]], begin
        while end < cells.size and distances[cells[end]] == depth:
            joined[cells[end]] = cells[end]
            end += 1
        for here in cells[begin:end]:
            _join(steps, offsets, joined, here)
        for here in cells[begin:end]:
            # A part with cells of this layer is stood for by one of them.
            part = root(joined, here)
            if of[part] == NONE:
                of[part], depths[count] = count, depth
                count += 1
            of[here] = of[part]
            sizes[of[here]] += 1
        for here in cells[begin:end]:
            for direction in range(4):
                if steps[here] >> direction & 1:
                    there = here + offsets[direction]
                    if of[there] != NONE and distances[there] > depth:
                        above[of[there]] = of[here]
        begin = end
    return Layers(depths[:count], sizes[:count], above[:count])


@kernel
def _is_enough(
    layers: Layers,
    robots: int,
    most: int,
    times: int,
    visits: NDArray[np.int64],
    passing: NDArray[np.int64],
) -> bool:
    """Tell whether walks of at most ``most`` steps may be enough for all layers."""
    visits[:] = 0
    passing[:] = 0
    total = 0
    for layer in range(layers.depths.size):
        depth, beyond = layers.depths[layer], visits[layer]
        # Of a robot that goes beyond, after what it takes to get there.
        left = most - times * depth - (times - 1)
        if beyond and left <= 0:
            return False
        if beyond:
            passing[layer] = max(passing[layer], -(-beyond // left))
        if passing[layer] > robots:
            return False
        if not depth:
            total += beyond
            continue
        here = beyond + max(layers.cells[layer], times * passing[layer])
        coming = max(passing[layer], -(-here // (left + times)))
        above = layers.above[layer]
        visits[above] += here
        passing[above] = max(passing[above], coming)
    return total <= robots * max(most - (times - 1), 0)


@kernel
def longest_by_layers(layers: Layers, robots: int, least: int, times: int) -> int:
    """Return a lower bound on the steps of the longest walk.

    Args:
        layers: of all cells.
        robots: how many.
        least: a bound on it so far.
        times: how often a walk passes each layer on its way to one beyond it, and back: 2, or 1
            if it does not return.
    """
    visits, passing = np.zeros(layers.depths.size, np.int64), np.zeros(layers.depths.size, np.int64)
    while not _is_enough(layers, robots, least, times, visits, passing):
        least += times
    return least
