"""The conversion of a review into its JSON document."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from msgspec import UNSET

from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.runcard import flat_settings
from fasaco_edge.review.document import (
    Charge,
    MapSize,
    ReviewDocument,
    TroublePeriod,
)
from fasaco_edge.review.moments import RECORDER_IN_ORDER, refused_by_code
from fasaco_edge.review.orders import commands_of
from fasaco_edge.review.spot import left_patches
from fasaco_edge.wire.documents.settings import known_settings

if TYPE_CHECKING:
    from fasaco_edge.review.review import Review
    from fasaco_edge.review.run_data import PathSample
    from fasaco_edge.wire.documents.replies import FloorLeft


def document_of(review: Review) -> ReviewDocument:
    """Return all figures of a review."""
    record, data, replans = review.record, review.data, review.replans
    refused, recorders = refused_by_code(data), [each.status.recorder for each in data.statuses]
    lost = [recorder.lost for recorder in recorders if recorder and recorder.lost is not UNSET]
    states: dict[str, float] = defaultdict(float)
    for span in review.states:
        states[span.name] += span.seconds
    began = datetime.fromtimestamp(1e-9 * record.began_ns, UTC)
    document = ReviewDocument(
        recording=record.name,
        files=list(record.parts),
        robot=data.robot or None,
        version=data.version or None,
        config=dict(flat_settings(data.config)),
        began=f"{began:%Y-%m-%dT%H:%M:%SZ}",
        time_scale=record.clock.scale,
        duration_s=round(review.duration_s, 3),
        recorded_s=round(1e-9 * (record.ended_ns - record.began_ns), 3),
        state=review.state or None,
        complete=review.complete,
        orders=[
            replace(order, at_s=round(order.at_s, 3), until_s=round(order.until_s, 3))
            for order in review.orders
        ],
        commands=commands_of(data),
        rooms=list(review.rooms),
        paths=len(data.paths),
        replans=len(replans.later),
        replans_by_reason=replans.by_reason,
        first_plan_ms=_rounded(replans.first.plan_ms) if replans.first else None,
        replan_ms_p50=_rounded(replans.milliseconds(50)),
        replan_ms_p99=_rounded(replans.milliseconds(99)),
        replan_ms_max=_rounded(replans.milliseconds(100)),
        replan_list=[_replan(path) for path in replans.later],
        restored_cells=data.restored_cells,
        states={name: round(seconds, 3) for name, seconds in states.items()},
        troubles=[
            TroublePeriod(s.name, s.reason, round(s.begin_s, 3), round(s.seconds, 3))
            for s in review.troubles
        ],
        charges=charges_of(review),
        longest_stand=review.longest_stand,
        faults=sum(refused.values()),
        faults_by_code=refused,
        recorder_lost=max(lost, default=None),
        samples_missing=review.missing,
        unreadable=dict(data.undecodable),
        remarks=[
            line
            for log in (entities.BUS_LOG, entities.RECORDER_LOG)
            for _, line in record.texts.get(log, ())
            if not line.startswith(tuple(f"{state}: " for state in RECORDER_IN_ORDER))
        ],
        not_recorded=_not_recorded(review),
    )
    _add_coverage(document, review)
    for member, entity in PLOTTED.items():
        if (points := record.plots.get(entity)) is not None:
            setattr(document, member, _rounded(float(points[:, 1].max())))
    document.processor_s = _rounded(_used([each.status.cpu_s for each in data.statuses]))
    of_recorder = record.plots.get(entities.RECORDER_CPU_S)
    if of_recorder is not None:
        document.recorder_processor_s = _rounded(_used(of_recorder[:, 1].tolist()))
    return document


def _used(counts: Sequence[float]) -> float | None:
    """Return the growth of a count that restarts at 0 with each process; None if unknown."""
    grown = (now - before if now >= before else now for before, now in pairwise(counts))
    return sum(grown) if len(counts) > 1 and counts[-1] else None


def charges_of(review: Review) -> list[Charge]:
    """Return each period of charging, with the battery levels at its beginning and end."""
    levels = [
        (each.at_s, each.status.battery.level)
        for each in review.data.statuses
        if each.status.battery is not None and each.status.battery.level is not None
    ]
    times = [at_s for at_s, _ in levels]

    def level(at_s: float) -> float | None:
        index = bisect_right(times, at_s) - 1
        return levels[index][1] if index >= 0 else None

    return [
        Charge(round(s.begin_s, 3), round(s.seconds, 3), level(s.begin_s), level(s.end_s))
        for s in review.states
        if s.name == "charging"
    ]


PLOTTED = {
    "memory_mb_max": entities.DAEMON_MEMORY,
    "recorder_memory_mb_max": entities.RECORDER_MEMORY,
}
"""Members that are the maximum of a curve, and the curve."""


def _add_coverage(document: ReviewDocument, review: Review) -> None:
    if (grid := review.data.grid) is not None:
        document.map = MapSize(grid.geometry.rows, grid.geometry.cols, grid.geometry.resolution)
    if (counts := review.data.counts) is not None:
        document.recovered_cells, document.unreachable_cells = counts.recovered, counts.unreachable
    if (cells := review.cells) is not None:
        document.covered_cells, document.coverable_cells = cells
    document.swept_before_m2 = round(review.data.swept_before_m2, 3)
    if (others := review.by_others) is not None and review.floor is not None:
        pixel_m2 = review.floor.geometry.resolution**2
        document.swept_by_others_m2 = round(int(np.count_nonzero(others)) * pixel_m2, 3)
    if (floor := review.floor) is not None:
        figures = floor.figures
        document.reachable_m2 = _rounded(figures.reachable_m2)
        document.swept_m2 = _rounded(figures.swept_m2)
        document.patches_over_4_dm2 = figures.patches_over_4_dm2
        document.largest_patch_m2 = _rounded(figures.largest_patch_m2)
        document.left = left_patches(floor)
    if (ledger := review.data.ledger_floor) is not None:
        document.ledger_swept_m2 = ledger.swept_m2
        held = review.data.ordered_floor or ledger
        document.left_by_reason = _by_reason(held.left)
        document.out_of_reach_by_reason = _by_reason(ledger.out_of_reach)
    if review.data.poses:
        document.driven_m = round(float(review.data.ways_m.sum()), 2)
    if (reached := review.reached_s) is not None:
        document.reached_s = {str(percent): _rounded(at_s) for percent, at_s in reached.items()}


def _by_reason(floor: tuple[FloorLeft, ...] | None) -> dict[str, float] | None:
    return None if floor is None else {part.reason: part.m2 for part in floor}


# Members of a path's attachment in the list of replans.
REPLAN = (
    *("revision", "reason", "steps", "planned_steps", "lower_bound_steps", "lower_bound_cost_s"),
    *("gap", "changed"),
)


def _replan(path: PathSample) -> dict[str, object]:
    about = path.about
    times = {"at_s": _rounded(path.at_s), "plan_ms": _rounded(path.plan_ms)}
    return (
        times | {"cost_s": about.planned_cost_s} | {name: getattr(about, name) for name in REPLAN}
    )


FLOOR = "reachable_m2, swept_m2, patches_over_4_dm2, largest_patch_m2"


def _not_recorded(review: Review) -> dict[str, str]:
    data, why = review.data, {}
    if not data.statuses:
        why["robot, version, config, state"] = "no status of the daemon was recorded"
    if review.lattice is None:
        why[FLOOR] = review.no_lattice
    elif review.data.restored_cells:
        restored = review.data.restored_cells
        before = f"{restored} cells were covered before the recording"
        why[FLOOR] = f"{before}, which does not show which ones"
    elif review.floor is None:
        why[FLOOR] = "no pose lies on the map"
    if known_settings(data.config).fleet.name and review.by_others is None:
        why["swept_by_others_m2"] = "no message of another robot was recorded"
    return why


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
