"""Random choices in simulated annealing of a fleet: how much worse a change may be, and whose."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import lean_kernel
from fasaco_edge.kernels.random import index_of

# Robots in a set, a bit each.
MOST_ROBOTS = 62
# Quantiles of the exponential distribution, times ONE.
ONE = 64
QUANTILES: NDArray[np.int64] = np.round(-ONE * np.log((np.arange(1024) + 0.5) / 1024)).astype(
    np.int64
)


@lean_kernel
def most_energy(heat: int, bits: int) -> int:
    """Return how much energy a change may add at a temperature, drawn as Metropolis does."""
    return int(heat * QUANTILES[index_of(bits, QUANTILES.size)] // ONE)


@lean_kernel
def member(robots: int, count: int, bits: int) -> int:
    """Return one of a set of robots, which is not empty."""
    robot = (bits & 0xFFFF) % count
    while not robots >> robot & 1:
        robot = robot + 1 if robot + 1 < count else 0
    return robot
