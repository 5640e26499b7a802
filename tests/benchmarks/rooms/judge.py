"""Judge of rooms: compares found rooms with true rooms, by pixels.

Recall and precision follow R. Bormann et al., "Room segmentation: survey, implementation, and
analysis", ICRA 2016: the share of each true room in its best match, and the share of each found
room in its best match. The Matthews correlation of each true room and its best match follows
M. Mielle et al., MAORIS, 2017.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Score:
    """How well rooms were found.

    Attributes:
        recall, precision: means over true rooms, and over found rooms.
        matthews: mean coefficient over true rooms.
        true, found: number of rooms, of those large enough.
    """

    recall: float
    precision: float
    matthews: float
    true: int
    found: int


def judge(truth: NDArray[np.int32], found: NDArray[np.int32], least: int) -> Score:
    """Return the score of found rooms.

    Args:
        truth: int32 (rows, cols), the true room of each pixel seen, from 1; 0 is not judged.
        found: int32 (rows, cols), rooms found, from 1; 0 for none.
        least: rooms of fewer pixels are not judged.
    """
    is_judged = truth > 0
    true, made = truth[is_judged], found[is_judged]
    common = np.zeros((int(truth.max()) + 1, int(found.max()) + 1), np.int64)
    np.add.at(common, (true, made), 1)
    true_sizes, made_sizes = common.sum(axis=1), common.sum(axis=0)
    rooms = [room for room in range(1, len(common)) if true_sizes[room] >= least]
    others = [room for room in range(1, common.shape[1]) if made_sizes[room] >= least]
    best = common[:, 1:].max(axis=1, initial=0)
    recall = [best[room] / true_sizes[room] for room in rooms]
    precision = [common[1:, room].max() / made_sizes[room] for room in others]
    matthews = [_matthews(common, room, len(true)) for room in rooms]
    return Score(_mean(recall), _mean(precision), _mean(matthews), len(rooms), len(others))


def _matthews(common: NDArray[np.int64], room: int, pixels: int) -> float:
    match = int(common[room, 1:].argmax()) + 1 if common.shape[1] > 1 else 0
    both = int(common[room, match])
    more, less = int(common[:, match].sum()) - both, int(common[room].sum()) - both
    neither = pixels - both - more - less
    square = (both + more) * (both + less) * (neither + more) * (neither + less)
    return (both * neither - more * less) / math.sqrt(square) if square else float(not more + less)


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else 1.0
