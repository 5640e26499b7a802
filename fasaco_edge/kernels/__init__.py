"""Compiled inner loops: arrays in, arrays out; the only layer that imports numba.

This file defines the states of a lattice cell and the four directions of a step, counter-clockwise
from east. It does not import numba, for code that only reads maps. Row 0 is the row with the
smallest y, so north is towards larger rows. Bit ``1 << direction`` of a cell's step mask is set if
that step is legal.
"""

UNKNOWN, BLOCKED, COVERABLE = 0, 1, 2

EAST, NORTH, WEST, SOUTH = 0, 1, 2, 3
ROW_STEP = (0, 1, 0, -1)
COL_STEP = (1, 0, -1, 0)
