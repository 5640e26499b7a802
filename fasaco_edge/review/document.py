"""The JSON document of a review: its members and what they mean."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

import msgspec

from fasaco_edge.text import percent

if TYPE_CHECKING:
    from fasaco_edge.recording.read.run import PartFile
    from fasaco_edge.review.floor_and_rooms import RoomChapter
    from fasaco_edge.review.moments import Stand
    from fasaco_edge.review.orders import CommandThen, OrderChapter
    from fasaco_edge.review.spot import LeftPatch


class MapSize(msgspec.Struct):
    """The size of a map."""

    rows: int
    cols: int
    resolution_m: float

    @property
    def sides_m(self) -> tuple[float, float]:
        """Width and depth [m]."""
        return self.cols * self.resolution_m, self.rows * self.resolution_m


class TroublePeriod(msgspec.Struct):
    """A period with a fault."""

    state: str
    reason: str
    at_s: float
    seconds: float


class Charge(msgspec.Struct, frozen=True):
    """A period of charging, with the battery level before and after."""

    at_s: float
    seconds: float
    level_from: float | None
    level_to: float | None


class ReviewDocument(msgspec.Struct):
    """All figures of a review; None where a recording does not hold them.

    Attributes:
        recording: common part of the files' names.
        files: each part: path, bytes, torn_bytes (cut off by a crash), ended (properly closed).
        robot, version, config: name, version and configuration in the daemon's last status.
        map: the last map: rows, cols, resolution_m.
        began: beginning of the recording, UTC.
        time_scale: simulated seconds per second; 1 for a real robot. Times and durations in [s] are
            by the robot's clock, unless described otherwise; those in [ms] are by the computer's.
        duration_s: duration of the recording [s].
        recorded_s: duration of the recording by the computer's clock [s].
        state: last state of the mission.
        orders: each order: ordered (`command`, or `itself` for an order without a command), at_s,
            until_s, ended_by (`start` of another order, `cancel`, `reset`; null for the end of the
            recording), state, complete, covered_cells, coverable_cells, order (its content; null if
            not recorded), replans (without its first plan), paused_s, driven_m, and unreached:
            areas not covered at its end, with cells, m2, place (x, y) [m] and reason.
        commands: each received command: at_s, command (as text).
        rooms: each room, with its outline at the end: room (its number), name, area_m2, seconds
            (of work in it, standstill included, pauses and charging excluded), entered (how often
            the robot entered it), swept_share and left_m2 (of its reachable floor, by recorded
            poses; null if unknown), counted_share (swept share of the current pass, by the daemon's
            last count), passes (current pass in the last order that names the room; null for none),
            skip (whether orders for everything leave it out).
        complete: whether the mission reached `done` in the last order, with every reachable cell
            (of its zones) covered.
        covered_cells, coverable_cells: numbers of covered and of reachable cells at the end, in the
            zones of the order, if it has any, by the daemon's last recorded count. Cells covered by
            other robots of the fleet are included.
        recovered_cells: number of cells covered more than once.
        unreachable_cells: number of cells where the robot would fit, but that it cannot reach.
        reachable_m2, swept_m2: floor at the end, in pixels of the last map [m2]. Reachable is what
            the tool's disc touches at any position that the robot can reach; swept is the part that
            the tool passed over, along the recorded poses. If all orders have zones, only floor in
            zones counts.
        swept_by_others_m2: reachable floor that other robots of the fleet swept, by their cells
            [m2]. ``reachable_m2`` and ``swept_m2`` leave it out. Null for a robot alone.
        patches_over_4_dm2, largest_patch_m2: number of connected unswept patches of this floor
            above 4 dm2; area of the largest one [m2].
        swept_before_m2: floor swept before the recording began, approximately, by the daemon's
            count [m2]. As its poses are missing, it counts as unswept until it is swept again.
        left: the largest unswept patches: m2, and a place in the middle (x, y) [m].
        ledger_swept_m2: floor that the daemon counted as swept at the end, reachable or not [m2].
        left_by_reason: unswept reachable floor at the end, or shortly before the order was
            cancelled, by the daemon's reasons [m2].
        out_of_reach_by_reason: free floor that the tool cannot reach, by reason [m2]; null if the
            robot drives through the centres of cells.
        reached_s: times at which 50, 90, 99 and 100 % of the cells coverable at the end were
            covered [s].
        driven_m: length of the track, without jumps [m].
        paths: number of published paths.
        replans: number of paths from a plan, without the first after each start of the daemon.
        replans_by_reason: number of replans by kind of reason.
        first_plan_ms: duration of the first plan [ms].
        replan_ms_p50, replan_ms_p99, replan_ms_max: percentiles of the duration of replans, by
            nearest rank [ms].
        replan_list: each replan: at_s, revision, reason, plan_ms, steps (to drive); of its plan,
            from the robot's position at that time: planned_steps, lower_bound_steps, cost_s (time
            of driving it, by the configuration), lower_bound_cost_s and gap (cost_s /
            lower_bound_cost_s - 1); changed, the changed rectangle of the map that caused it [m].
        memory_mb_max, recorder_memory_mb_max: peak memory of daemon and recorder [MB].
        processor_s, recorder_processor_s: total processor time of daemon and recorder, by the
            computer's clock [s].
        restored_cells: cells that were covered before a restart.
        states: seconds in each state.
        troubles: state, reason, at_s, seconds of each period in which the mission was degraded,
            blocked or silent, or had a trouble in another state (`reason` is then the trouble), or
            in which the recorder could not write (`recorder: disk full`, `recorder: stalled`).
        charges: each period of charging: at_s, seconds, level_from, level_to (0 to 1; null if
            unknown).
        longest_stand: the longest standstill during a mission: at_s, seconds, place (x, y) [m], and
            the states of the mission meanwhile, reason (of a path that led nowhere meanwhile, as
            one that waits for another robot); null for none.
        faults: number of messages refused by the daemon.
        faults_by_code: number of these messages by error code.
        recorder_lost: number of samples that the recorder could not write, by its own count.
        samples_missing: number of samples missing, by gaps in their sequence numbers.
        unreadable: number of samples in the recording that could not be decoded, by topic.
        remarks: warnings in the recorder's log.
        not_recorded: why figures of the floor, or of the daemon, are null.
    """

    recording: str = ""
    files: list[PartFile] = []
    robot: str | None = None
    version: str | None = None
    config: dict[str, str | float] = {}
    map: MapSize | None = None
    began: str = ""
    time_scale: float = 1.0
    duration_s: float = 0.0
    recorded_s: float = 0.0
    state: str | None = None
    complete: bool | None = None
    orders: list[OrderChapter] = []
    commands: list[CommandThen] = []
    rooms: list[RoomChapter] = []
    covered_cells: int | None = None
    coverable_cells: int | None = None
    recovered_cells: int | None = None
    unreachable_cells: int | None = None
    reachable_m2: float | None = None
    swept_m2: float | None = None
    swept_by_others_m2: float | None = None
    swept_before_m2: float = 0.0
    patches_over_4_dm2: int | None = None
    largest_patch_m2: float | None = None
    left: list[LeftPatch] = []
    ledger_swept_m2: float | None = None
    left_by_reason: dict[str, float] | None = None
    out_of_reach_by_reason: dict[str, float] | None = None
    reached_s: dict[str, float | None] | None = None
    driven_m: float | None = None
    paths: int = 0
    replans: int = 0
    replans_by_reason: dict[str, int] = {}
    first_plan_ms: float | None = None
    replan_ms_p50: float | None = None
    replan_ms_p99: float | None = None
    replan_ms_max: float | None = None
    replan_list: list[dict[str, object]] = []
    memory_mb_max: float | None = None
    recorder_memory_mb_max: float | None = None
    processor_s: float | None = None
    recorder_processor_s: float | None = None
    restored_cells: int = 0
    states: dict[str, float] = {}
    troubles: list[TroublePeriod] = []
    charges: list[Charge] = []
    longest_stand: Stand | None = None
    faults: int = 0
    faults_by_code: dict[str, int] = {}
    recorder_lost: int | None = None
    samples_missing: int = 0
    unreadable: dict[str, int] = {}
    remarks: list[str] = []
    not_recorded: dict[str, str] = {}

    @property
    def is_ended(self) -> bool:
        """Whether each part was closed properly."""
        return all(part.ended for part in self.files)

    @property
    def share_covered(self) -> str | None:
        """The share of the coverable cells that is covered [%], as text."""
        if self.covered_cells is None or not self.coverable_cells:
            return None
        return percent(self.covered_cells / self.coverable_cells)


def explanations() -> Iterator[str]:
    """Yield the name and meaning of each member of a document."""
    listed = inspect.getdoc(ReviewDocument) or ""
    for entry in re.split(r"\n {4}(?=\S)", listed.partition("Attributes:")[2])[1:]:
        yield " ".join(entry.split()).rstrip(".")
