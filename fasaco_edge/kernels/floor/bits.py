"""Bit rasters: yes or no for each pixel, 64 pixels of a row in a word.

A row is padded to whole words with pixels outside of the raster. Column j of a row is bit
``j & 63``, the lowest first, of its word ``j >> 6``.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, kernel, lean_inner_kernel

Bits = NDArray[np.uint64]
WORD = 64
NONE, ONE, ALL = np.uint64(0), np.uint64(1), np.uint64(2**64 - 1)
LAST = np.uint64(63)


def packed(mask: NDArray[np.bool_], beyond: bool) -> Bits:
    """Return a mask, bool (rows, cols), as bits; ``beyond``: value outside of it."""
    rows, cols = mask.shape
    words = -(-cols // WORD)
    padded = mask
    if cols % WORD:
        padded = np.full((rows, words * WORD), beyond, np.bool_)
        padded[:, :cols] = mask
    return np.packbits(padded, axis=1, bitorder="little").view("<u8")


def unpacked(bits: Bits, cols: int) -> NDArray[np.bool_]:
    """Return bits as a mask, bool (rows, cols)."""
    row = np.ascontiguousarray(bits).view(np.uint8)
    return np.unpackbits(row, axis=1, count=cols, bitorder="little").view(np.bool_)


@inlined
def is_marked(bits: NDArray[np.uint64], i: int, j: int) -> bool:
    """Return whether a pixel, which must be on the raster, is marked."""
    return bool((bits[i, j >> 6] >> np.uint64(j & 63)) & ONE)


@inlined
def any_between(row: NDArray[np.uint64], first: int, last: int) -> bool:
    """Return whether any pixel of a row from ``first`` to ``last`` is marked: ``last >= first``."""
    at, end = first >> 6, last >> 6
    low = ALL << np.uint64(first & 63)
    high = ALL >> np.uint64(63 - (last & 63))
    if at == end:
        return bool(row[at] & low & high)
    found = row[at] & low
    for word in range(at + 1, end):
        found |= row[word]
    return bool(found | (row[end] & high))


@lean_inner_kernel
def _widen(row: NDArray[np.uint64], times: int) -> None:
    """Mark the neighbours of marked pixels in a row, a number of times."""
    words = len(row)
    for _ in range(times):
        before = NONE
        for word in range(words):
            here = row[word]
            behind = row[word + 1] if word + 1 < words else NONE
            row[word] = here | here << ONE | here >> ONE | before >> LAST | behind << LAST
            before = here


@kernel
def spread(bits: NDArray[np.uint64], reach: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Return the pixels that a disc around a marked one touches, uint64 like ``bits``.

    Args:
        bits: uint64 (rows, words).
        reach: int64 (n,), falling: the number of pixels that the disc touches on either side of the
            middle one, for its own row first, then for each next row above, or below.
    """
    rows, words = bits.shape
    found = np.zeros((rows, words), np.uint64)
    row = np.empty(words, np.uint64)
    for i in range(rows):
        is_any = NONE
        for word in range(words):
            row[word] = bits[i, word]
            is_any |= row[word]
        if is_any == NONE:
            continue
        wide = 0
        for away in range(len(reach) - 1, -1, -1):
            _widen(row, reach[away] - wide)
            wide = reach[away]
            if i >= away:
                for word in range(words):
                    found[i - away, word] |= row[word]
            if i + away < rows:
                for word in range(words):
                    found[i + away, word] |= row[word]
    return found
