"""Pseudo-random numbers in integer arithmetic.

No libm function is called, so results are equal on all machines.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_inner_kernel

# The lowest bits select one of few alternatives, the highest an index: they do not overlap.
INDEX_BITS = 41
WORD = 0xFFFFFFFF


@inlined
def draw(random: NDArray[np.uint64]) -> int:
    """Advance the stream, uint64 (1,), not 0; return 63 random bits.

    Source: Marsaglia, "Xorshift RNGs", 2003.
    """
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


@inlined
def draw_share(random: NDArray[np.uint64]) -> float:
    """Advance a stream as ``draw`` does; return a number in [0, 1)."""
    return float(draw(random) >> 10) / 9007199254740992.0


@lean_inner_kernel
def draw_unit(state: NDArray[np.int64]) -> float:
    """Advance a stream of four words of 32 bits, int64 (4,); return a number in [0, 1).

    Source: xoshiro128++, Blackman and Vigna 2019. Words live in int64 and are masked, so that
    nothing overflows in plain Python.
    """
    total = (state[0] + state[3]) & WORD
    word = ((((total << 7) & WORD) | (total >> 25)) + state[0]) & WORD
    shifted = (state[1] << 9) & WORD
    state[2] ^= state[0]
    state[3] ^= state[1]
    state[1] ^= state[2]
    state[0] ^= state[3]
    state[2] ^= shifted
    state[3] = ((state[3] << 11) & WORD) | (state[3] >> 21)
    return float(word / 4294967296.0)
