"""The cells that a trail passes, found slowly: sample by sample along it, a millimetre apart."""

from __future__ import annotations

import math
from itertools import pairwise

STRIDE_M = 0.001


def passed_cells(trail, cell_m, reach=0.5):
    """Return the cells (row, col) whose centre came to lie under the tool, and after how far [m].

    The tool reaches so many cells around its middle: as wide as a cell, half of one. A cell is
    passed anew once the tool has left its centre.
    """
    passed, under, way = [], None, 0.0
    points = [trail[0]]
    for begin, end in pairwise(trail):
        count = max(math.ceil(math.dist(begin, end) / STRIDE_M), 1)
        points += [begin + (end - begin) * (k + 1) / count for k in range(count)]
    last = points[0]
    for point in points:
        way += math.dist(last, point)
        last = point
        cell = (math.floor(point[1] / cell_m), math.floor(point[0] / cell_m))
        centre = ((cell[1] + 0.5) * cell_m, (cell[0] + 0.5) * cell_m)
        now = cell if math.dist(point, centre) < reach * cell_m - 1e-9 else None
        if now is not None and now != under:
            passed.append((now, way))
        under = now
    return passed
