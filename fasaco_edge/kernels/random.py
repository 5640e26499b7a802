"""Random numbers in whole numbers, the same on every machine.

Source: Marsaglia, "Xorshift RNGs", 2003. No function of the mathematical
library takes part, so no machine rounds otherwise.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined

# The lowest bits choose among few things, the highest an index: they do not meet.
INDEX_BITS = 41


@inlined
def draw(random: NDArray[np.uint64]) -> int:
    """Advance the stream, uint64 (1,), not 0; return 63 random bits."""
    word = random[0]
    word ^= word << np.uint64(13)
    word ^= word >> np.uint64(7)
    word ^= word << np.uint64(17)
    random[0] = word
    return int(word >> np.uint64(1))


@inlined
def index_of(bits: int, size: int) -> int:
    """Return an index in 0..size - 1, size < 2^22, from the upper bits of a ``draw``."""
    return ((bits >> 22) * size) >> INDEX_BITS
