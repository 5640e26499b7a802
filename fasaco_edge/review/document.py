"""A review as a JSON document: what its members are, what they mean, and how they are filled."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import msgspec

from fasaco_edge.drawing.spread import percentile
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.runcard import flat_settings

if TYPE_CHECKING:
    from fasaco_edge.review.moments import Moment
    from fasaco_edge.review.orders import OrderChapter
    from fasaco_edge.review.review import Review
    from fasaco_edge.review.run_data import PublishedPath
    from fasaco_edge.wire.path_documents import Rectangle
    from fasaco_edge.wire.replies import FloorLeft


MILESTONES = (50, 90, 99, 100)
"""Shares of the cells that can be covered at the end [percent]."""


class RecordedFile(msgspec.Struct):
    """A file of a recording."""

    path: str
    bytes: int
    torn_bytes: int
    ended: bool


class MapSize(msgspec.Struct):
    """The size of a map."""

    rows: int
    cols: int
    resolution_m: float

    @property
    def sides_m(self) -> tuple[float, float]:
        """Width and depth [m]."""
        return self.cols * self.resolution_m, self.rows * self.resolution_m


class Replan(msgspec.Struct):
    """A plan made anew that became a path."""

    at_s: float | None
    revision: int
    reason: str
    plan_ms: float | None
    steps: int
    planned_steps: int | None
    lower_bound_steps: int | None
    lower_bound_cost_s: float | None
    gap: float | None
    cost_s: float | None
    changed: Rectangle | None


class TimesTaken(msgspec.Struct):
    """The median and the slowest of some replans [ms]."""

    p50: float | None
    max: float | None


class Trouble(msgspec.Struct):
    """A time in which something was not as it should be."""

    state: str
    reason: str
    at_s: float | None
    seconds: float | None


class PheromoneFigures(msgspec.Struct, frozen=True):
    """The pheromone that was drawn; None where nothing tells."""

    fields: int
    cells_share: float | None
    branching: float | None


class ReviewDocument(msgspec.Struct):
    """All figures of a review; None where a recording does not hold them.

    Attributes:
        recording: what the parts of the run share in their names.
        files: each part: path, bytes, torn_bytes (cut off by a crash), ended (in order).
        robot, version, config: of the daemon, as its last status has them.
        map: the last one: rows, cols, resolution_m.
        began: when the recording began, UTC.
        duration_s: from its first entry to its last [s].
        state: what the mission said last.
        orders: each order, in a chapter of its own: ordered (`command`, or `itself` for one nobody
            gave while it was recorded), at_s, until_s, ended_by (`start` of another, `cancel`,
            `reset`; null for the end of the recording), state, complete, covered_cells,
            coverable_cells.
        complete: of the last order: whether the mission came to `done` with no reachable cell, or
            no cell of its zones, left over.
        covered_cells, coverable_cells: at the end: cells that are reachable, those of them covered.
        recovered_cells: cells of these that were covered more than once.
        unreachable_cells: cells where the robot would fit but cannot come to.
        reachable_m2, swept_m2: floor at the end, on the pixels of the last map, not of cells: what
            the tool's disc touches where the robot's disc can come to, and what of it the tool
            passed over along the recorded poses [m2].
        patches_over_4_dm2, largest_patch_m2: what of it was left, in one piece [m2].
        ledger_swept_m2: floor that the daemon had as swept at the end, in reach or not [m2].
        left_by_reason: what the daemon said at the end of reachable floor that is not swept [m2].
        out_of_reach_by_reason: and of free floor that the tool cannot come to [m2]; null
            where the robot drives through the middles of cells.
        coverage_from: who counted: `status` (the daemon) or `trail` (from the recorded poses and
            the last map, where the daemon's last recorded count is outdated).
        reached_s: when 50, 90, 99 and 100 % of the cells coverable at the end were covered [s].
        steps: moves from cell to cell; a cell counts when the tool passes over its centre.
        revisits: visits of cells beyond each one's first.
        turns_90, turns_180: quarter-turns and about-turns between steps.
        driven_m: length of the trail, without jumps [m].
        paths: paths that were published.
        replans: those that came of a plan, without the first of each start of the daemon.
        replans_by_reason: how many for each kind of reason.
        first_plan_ms: how long the first plan took [ms].
        replan_ms_p50, replan_ms_p99, replan_ms_max: how long replans took [ms], nearest rank.
        replan_ms_by_reason: median (p50) and slowest (max) of each kind of reason [ms].
        replan_list: each replan: at_s, revision, reason, plan_ms, steps (to drive); of the plan as
            it was made, from where the robot was then: planned_steps, lower_bound_steps, cost_s
            (driving it, by the configuration), lower_bound_cost_s and gap (cost_s over that
            bound, as a share of it); changed, the rectangle of the map that led to it [m].
        plans, plans_unused: by the turn log: plans that were made, those of them that became no
            path, because they found the one there was or did not hold any more.
        plan_ms_p50, plan_ms_p99, plan_ms_max: how long they took, the unused ones too [ms].
        attempts, attempts_used: plans that were only to make the path better, and did.
        pheromone: fields (how often the field was drawn), cells_share (cells that the last field
            spans over those where the robot would fit, reachable or not), branching (at the end:
            mean number of directions of a cell within reach of its strongest).
        memory_mb_max, recorder_memory_mb_max: most memory of daemon and recorder [MB].
        processor_percent_max, threads_max: of the daemon: processor time over half a minute [% of
            a core], threads.
        restored_cells: cells that were covered before a restart.
        states: seconds in each state.
        troubles: each time the mission was degraded, blocked or silent, or the recorder could not
            write (`recorder: disk full`, `recorder: stalled`): state, reason, at_s, seconds.
        worst: moments that stand out: what, value, unit, at_s, note.
        faults: messages that the daemon refused.
        faults_by_code: the same by code.
        recorder_lost: samples that the recorder says it could not write.
        samples_missing: gaps in the numbers of the samples.
        unreadable: samples in the recording that could not be decoded, by topic.
        remarks: what the recorder wrote into its log.
        not_recorded: why a figure is null.
    """

    recording: str = ""
    files: list[RecordedFile] = []
    robot: str | None = None
    version: str | None = None
    config: dict[str, str | float] = {}
    map: MapSize | None = None
    began: str = ""
    duration_s: float = 0.0
    state: str | None = None
    complete: bool | None = None
    orders: list[OrderChapter] = []
    covered_cells: int | None = None
    coverable_cells: int | None = None
    recovered_cells: int | None = None
    unreachable_cells: int | None = None
    reachable_m2: float | None = None
    swept_m2: float | None = None
    patches_over_4_dm2: int | None = None
    largest_patch_m2: float | None = None
    ledger_swept_m2: float | None = None
    left_by_reason: dict[str, float] | None = None
    out_of_reach_by_reason: dict[str, float] | None = None
    coverage_from: str | None = None
    reached_s: dict[str, float | None] | None = None
    steps: int | None = None
    revisits: int | None = None
    turns_90: int | None = None
    turns_180: int | None = None
    driven_m: float | None = None
    paths: int = 0
    replans: int = 0
    replans_by_reason: dict[str, int] = {}
    first_plan_ms: float | None = None
    replan_ms_p50: float | None = None
    replan_ms_p99: float | None = None
    replan_ms_max: float | None = None
    replan_ms_by_reason: dict[str, TimesTaken] = {}
    replan_list: list[Replan] = []
    plans: int | None = None
    plans_unused: int | None = None
    plan_ms_p50: float | None = None
    plan_ms_p99: float | None = None
    plan_ms_max: float | None = None
    attempts: int | None = None
    attempts_used: int | None = None
    pheromone: PheromoneFigures = PheromoneFigures(0, None, None)
    memory_mb_max: float | None = None
    recorder_memory_mb_max: float | None = None
    processor_percent_max: float | None = None
    threads_max: float | None = None
    restored_cells: int = 0
    states: dict[str, float] = {}
    troubles: list[Trouble] = []
    worst: list[Moment] = []
    faults: int = 0
    faults_by_code: dict[str, int] = {}
    recorder_lost: int | None = None
    samples_missing: int = 0
    unreadable: dict[str, int] = {}
    remarks: list[str] = []
    not_recorded: dict[str, str] = {}

    @property
    def is_ended(self) -> bool:
        """Whether each part was ended in order."""
        return all(part.ended for part in self.files)

    @property
    def share_covered(self) -> str | None:
        """The share of the coverable cells that is covered [%], as text."""
        if self.covered_cells is None or not self.coverable_cells:
            return None
        return f"{100 * self.covered_cells / self.coverable_cells:.1f} %"


def explanations() -> Iterator[str]:
    """Yield what each member of a document means, behind its name."""
    listed = inspect.getdoc(ReviewDocument) or ""
    for entry in re.split(r"\n {4}(?=\S)", listed.partition("Attributes:")[2])[1:]:
        yield " ".join(entry.split()).rstrip(".")


def document_of(review: Review) -> ReviewDocument:
    """Return all figures of a review."""
    record, data, replans, faults = review.record, review.data, review.replans, review.faults
    began = datetime.fromtimestamp(1e-9 * record.began_ns, UTC)
    told = ReviewDocument(
        recording=record.recording_id,
        files=[
            RecordedFile(str(part.path), part.bytes, part.torn_bytes, part.has_footer)
            for part in record.parts
        ],
        robot=data.robot or None,
        version=data.version or None,
        config=dict(flat_settings(data.config)),
        began=f"{began:%Y-%m-%dT%H:%M:%SZ}",
        duration_s=round(review.duration_s, 3),
        state=review.state or None,
        complete=review.complete,
        orders=[
            replace(order, at_s=round(order.at_s, 3), until_s=round(order.until_s, 3))
            for order in review.orders
        ],
        paths=len(data.paths),
        replans=len(replans.later),
        replans_by_reason=replans.by_reason,
        first_plan_ms=_rounded(replans.first.plan_ms) if replans.first else None,
        replan_ms_p50=_rounded(replans.milliseconds(50)),
        replan_ms_p99=_rounded(replans.milliseconds(99)),
        replan_ms_max=_rounded(replans.milliseconds(100)),
        replan_ms_by_reason={
            kind: TimesTaken(_rounded(median), _rounded(most))
            for kind, (median, most) in replans.spread_by_reason.items()
        },
        replan_list=[_replan(path) for path in replans.later],
        restored_cells=data.restored_cells,
        states={name: round(s, 3) for name, s in review.seconds_by_state.items()},
        troubles=[
            Trouble(s.name, s.reason, _rounded(s.begin_s), _rounded(s.seconds))
            for s in review.troubles
        ],
        worst=[replace(m, value=round(m.value, 3), at_s=round(m.at_s, 3)) for m in review.moments],
        faults=faults.total,
        faults_by_code=faults.by_code,
        recorder_lost=faults.lost,
        samples_missing=review.missing,
        unreadable=dict(data.undecodable),
        remarks=list(faults.complaints),
        not_recorded=_not_recorded(review),
    )
    _add_coverage(told, review)
    _add_plans(told, review)
    told.pheromone = _pheromone(review)
    for member, entity in PLOTTED.items():
        if (points := record.plots.get(entity)) is not None:
            setattr(told, member, _rounded(float(points[:, 1].max())))
    return told


PLOTTED = {
    "memory_mb_max": f"{entities.MEMORY}/planner",
    "recorder_memory_mb_max": f"{entities.MEMORY}/recorder",
    "processor_percent_max": entities.PROCESSOR,
    "threads_max": entities.THREADS,
}
"""Members that are the most of a curve, and the curve."""


def _add_coverage(told: ReviewDocument, review: Review) -> None:
    if (grid := review.data.grid) is not None:
        told.map = MapSize(grid.geometry.rows, grid.geometry.cols, grid.geometry.resolution)
    if (counts := review.counts) is not None:
        told.covered_cells, told.coverable_cells = counts.covered, counts.coverable
        told.recovered_cells, told.unreachable_cells = counts.recovered, counts.unreachable
        told.coverage_from = counts.source
    if (floor := review.floor) is not None:
        figures = floor.figures
        told.reachable_m2 = _rounded(figures.reachable_m2)
        told.swept_m2 = _rounded(figures.swept_m2)
        told.patches_over_4_dm2 = figures.patches_over_4_dm2
        told.largest_patch_m2 = _rounded(figures.largest_patch_m2)
    if (ledger := review.data.ledger_floor) is not None:
        told.ledger_swept_m2 = ledger.swept_m2
        told.left_by_reason = _by_reason(ledger.left)
        told.out_of_reach_by_reason = _by_reason(ledger.out_of_reach)
    if (walk := review.walk) is not None:
        told.steps, told.revisits = walk.steps, walk.revisits
        told.turns_90, told.turns_180 = walk.turns_90, walk.turns_180
    if review.drive is not None:
        told.driven_m = round(review.drive.driven_m, 2)
    if (reached := review.reached_s) is not None:
        told.reached_s = {str(percent): _rounded(at_s) for percent, at_s in reached.items()}


def _by_reason(floor: tuple[FloorLeft, ...] | None) -> dict[str, float] | None:
    return None if floor is None else {part.reason: part.m2 for part in floor}


def _add_plans(told: ReviewDocument, review: Review) -> None:
    """Add counts and times of plans by the turn log, if there is one."""
    made = review.data.plan_log.plans
    if not made:
        return
    plans = [plan for plan in made if not plan.is_attempt]
    attempts = [plan for plan in made if plan.is_attempt]
    took = [plan.took_ms for plan in plans]
    told.plans, told.plans_unused = len(plans), sum(not plan.is_used for plan in plans)
    told.plan_ms_p50, told.plan_ms_p99, told.plan_ms_max = (
        _rounded(percentile(took, percent)) for percent in (50, 99, 100)
    )
    told.attempts, told.attempts_used = len(attempts), sum(plan.is_used for plan in attempts)


def _pheromone(review: Review) -> PheromoneFigures:
    plots = review.record.plots
    spanned, branching = (
        float(points[-1, 1]) if (points := plots.get(entity)) is not None else None
        for entity in (entities.TRAIL_CELLS, entities.BRANCHING)
    )
    counts = review.counts
    fitting = counts.coverable + (counts.unreachable or 0) if counts is not None else 0
    share = spanned / fitting if spanned is not None and fitting else None
    return PheromoneFigures(review.record.field_count, _rounded(share), _rounded(branching))


def _replan(path: PublishedPath) -> Replan:
    about = path.about
    return Replan(
        at_s=_rounded(path.at_s),
        revision=about.revision,
        reason=about.reason,
        plan_ms=_rounded(path.plan_ms),
        steps=about.steps,
        planned_steps=about.planned_steps,
        lower_bound_steps=about.lower_bound_steps,
        lower_bound_cost_s=about.lower_bound_cost_s,
        gap=about.gap,
        cost_s=about.planned_cost_s,
        changed=about.changed,
    )


FLOOR = "reachable_m2, swept_m2, patches_over_4_dm2, largest_patch_m2"


def _not_recorded(review: Review) -> dict[str, str]:
    data, why = review.data, {}
    if not data.statuses:
        why["robot, version, config, state"] = "there is no status of a daemon"
    if review.drive is None:
        why["steps, revisits, turns_90, turns_180, driven_m, reached_s"] = review.no_lattice
        why[FLOOR] = review.no_lattice
    elif review.data.restored_cells:
        restored = review.data.restored_cells
        before = f"{restored} cells were covered before, and a recording does not tell which"
        why["reached_s"] = why[FLOOR] = before
    elif review.floor is None:
        why[FLOOR] = "no pose lies on the map"
    if data.ledger_floor is None:
        why["ledger_swept_m2, left_by_reason, out_of_reach_by_reason"] = (
            "no recorded status tells of floor"
        )
    if review.counts is None:
        why["covered_cells, coverable_cells, recovered_cells"] = (
            "the daemon's last recorded count is outdated, and the trail does not tell all"
        )
    if not review.replans.later:
        why["replan_ms_p50, replan_ms_p99, replan_ms_max"] = "no plan was made anew"
    if not data.plan_log.plans:
        why["plans, plans_unused, plan_ms_p50, plan_ms_p99, plan_ms_max, attempts"] = (
            "there is no turn log"
        )
    if review.faults.lost is None:
        why["recorder_lost"] = "no recorded status tells of the recorder"
    return why


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
