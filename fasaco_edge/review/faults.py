"""The faults in a recording: refused messages, lost samples, torn files."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import RunRecord
from fasaco_edge.review.moments import RECORDER_IN_ORDER
from fasaco_edge.review.run_data import RunData

_ERROR = re.compile(r"error (\d+): ")
# Log lines of a recorder where nothing is wrong.
IN_ORDER = tuple(f"{state}: " for state in RECORDER_IN_ORDER)
NOT_RECORDED = "code not recorded"


@dataclass(frozen=True, slots=True)
class Faults:
    """Refused messages and losses.

    Attributes:
        by_code: what the daemon refused; under ``NOT_RECORDED`` what it counted after the last
            counts by code that were recorded.
        lost: samples that the recorder could not write; None where that is not recorded.
        torn_bytes: what a crash tore off the files [bytes].
        complaints: warnings in the recorder's log.
    """

    by_code: dict[str, int]
    lost: int | None
    torn_bytes: int
    complaints: tuple[str, ...]

    @property
    def total(self) -> int:
        """All that the daemon refused."""
        return sum(self.by_code.values())


def faults_of(data: RunData, record: RunRecord) -> Faults:
    """Return the faults in a recording."""
    by_code = _over_restarts(each.status.errors.by_code for each in data.statuses)
    # As curves they are recorded up to the end; of a daemon that was started again not each one.
    by_code |= _plotted(record.plots)
    total = _counted(line for _, line in record.log.get(entities.MISSION_LOG, ()))
    if total > by_code.total():
        by_code[NOT_RECORDED] = total - by_code.total()
    recorders = [each.status.recorder for each in data.statuses]
    lost = [recorder.lost for recorder in recorders if recorder and recorder.lost is not UNSET]
    return Faults(
        by_code=dict(sorted(by_code.items())),
        lost=max(lost, default=None),
        torn_bytes=sum(part.torn_bytes for part in record.parts),
        complaints=tuple(
            line
            for log in (entities.BUS_LOG, entities.RECORDER_LOG)
            for _, line in record.log.get(log, ())
            if not line.startswith(IN_ORDER)
        ),
    )


def _plotted(plots: Mapping[str, NDArray[np.float64]]) -> Counter[str]:
    """Return the counts by code by their curves, over restarts."""
    counts: Counter[str] = Counter()
    for entity, points in plots.items():
        if entity.startswith(f"{entities.ERRORS}/"):
            values = points[:, 1]
            ended = values[:-1][np.diff(values) < 0]
            counts[entity.removeprefix(f"{entities.ERRORS}/")] = round(ended.sum() + values[-1])
    return counts


def _over_restarts(counts: Iterable[Mapping[str, int]]) -> Counter[str]:
    """Return the sum of counts that a restart of the daemon resets."""
    ended: Counter[str] = Counter()
    newest: Counter[str] = Counter()
    for count in counts:
        now = Counter(dict(count))
        if now.total() < newest.total():
            ended += newest
        newest = now
    return ended + newest


def _counted(lines: Iterable[str]) -> int:
    """Return how many errors the log counts, over restarts."""
    ended = newest = 0
    for line in lines:
        match = _ERROR.match(line)
        if match:
            now = int(match[1])
            ended += newest if now <= newest else 0
            newest = now
    return ended + newest
