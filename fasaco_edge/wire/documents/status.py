"""Status documents of daemon and recorder, written and read.

The structs are the contract: ``protocol/schema`` is generated from them. Each member has a
default, so that a reader accepts a document of another version (``json_text.decode_tolerant``).
"""

from __future__ import annotations

from typing import Annotated, Final

import msgspec
from msgspec import UNSET, Meta, UnsetType

from fasaco_edge.wire.documents.json_text import (
    Amount,
    Count,
    Document,
    Name,
    Ordinal,
    Settings,
    ZenohId,
    allowed,
)
from fasaco_edge.wire.documents.path_documents import PathReport
from fasaco_edge.wire.documents.replies import (
    TROUBLES,
    CoverageReport,
    FloorReport,
    MissionReport,
    Point,
    StateName,
    TroubleReport,
)

RECORDER_STATES: Final = ("recording", "disk full", "stalled", "stopping")
SUPERVISED_STATES: Final = ("starting", *RECORDER_STATES, "silent", "restarting", "failed")
CLAIMS: Final = ("looks", "waits", "yields", "plans")


class ClaimReport(Document, frozen=True):
    """The sender of a status and its role: of several daemons with one name, one plans.

    Attributes:
        id: its Zenoh id.
        stand: its role. plans: this daemon plans; waits: another daemon plans; yields: another
            daemon plans, and this one did before; looks: not known yet whether another daemon
            plans.
    """

    id: ZenohId = ""
    stand: Annotated[str, allowed(enum=CLAIMS)] = "plans"


class MapReport(Document, frozen=True):
    """The newest map.

    Attributes:
        resolution_m: edge of a pixel.
        revision: counts the states of the map; updates that arrive together count once.
        frame: name of its frame.
        lattice_deg: the angle of the cells' rows to the x axis of that frame.
    """

    rows: Ordinal = 1
    cols: Ordinal = 1
    resolution_m: Annotated[float, Meta(gt=0)] = 1.0
    revision: Ordinal = 1
    stamp_ns: int = 0
    frame: str = ""
    lattice_deg: float = 0.0


class PoseReport(Point, frozen=True):
    """The robot's pose.

    Attributes:
        x, y: [m] in the frame of the map.
        yaw: [rad], counter-clockwise.
    """

    yaw: float = 0.0


class PlanCounts(Document, frozen=True):
    """Counts of plans.

    Attributes:
        plans: plans made.
        unchanged: plans equal to the path in force.
        outdated: plans that were no longer valid when they were finished.
        attempts: attempts to improve the path in spare time.
        planning: whether a plan is being made.
    """

    plans: Count = 0
    unchanged: Count = 0
    outdated: Count = 0
    attempts: Count = 0
    planning: bool = False


class Latencies(Document, frozen=True):
    """The last durations [ms]; null before the first.

    Attributes:
        ingest: taking in the newest map.
        plan: making the newest plan.
        map_to_path: from the arrival of a map to the publication of its path.
    """

    ingest: Amount | None = None
    plan: Amount | None = None
    map_to_path: Amount | None = None


class LoopTimes(Document, frozen=True):
    """Cycles of the daemon's loop since its start, and their durations [ms].

    Attributes:
        turns: number of cycles.
        late: cycles longer than 100 ms.
        p50: median of the durations, to within 10 %; null before the first cycle.
        p99: 99th percentile.
        p99_9: 99.9th percentile.
        max: the longest.
    """

    turns: Count = 0
    late: Count = 0
    p50: Amount | None = None
    p99: Amount | None = None
    p99_9: Amount | None = None
    max: Amount | None = None


class DriveReport(Document, frozen=True):
    """The robot's driving, measured from its poses; null for too few measurements.

    Attributes:
        planned_quarter_turn_s: value used in planning, from robot.quarter_turn_s or its limits.
        speed_m_s: speed in straight driving.
        quarter_turn_s: a turn by about 90 degrees on the spot, with braking and starting.
        half_turn_s: a turn by about 180 degrees.
        turns: number of measured turns.
    """

    planned_quarter_turn_s: Amount = 0.0
    speed_m_s: Amount | None = None
    quarter_turn_s: Amount | None = None
    half_turn_s: Amount | None = None
    turns: Count = 0


class BatteryReport(Document, frozen=True):
    """The battery; levels are shares of a full battery, null if unknown.

    Attributes:
        level: its charge.
        power: power supply status of its message; "" before the first.
        age_s: time since the last plausible charge.
        drain_per_h: discharge an hour while driving, measured.
        turns_back_at: level at which the robot drives to its dock.
        goes_on_at: level at which it leaves the dock again; null if it does not charge.
    """

    level: Amount | None = None
    power: str = ""
    age_s: Amount = 0.0
    drain_per_h: Amount | None = None
    turns_back_at: Amount | None = None
    goes_on_at: Amount | None = None


class ErrorCounts(Document, frozen=True):
    """Faults since the start: refused input, failed publications, other failures.

    Attributes:
        last: message of the newest fault.
        by_code: counts by the codes in errors.yaml.
    """

    total: Count = 0
    last: str = ""
    by_code: Annotated[
        dict[str, Ordinal], allowed(propertyNames={"type": "string", "pattern": "^[a-z_]+$"})
    ] = msgspec.field(default_factory=dict)


class LedgerReport(Document, frozen=True):
    """The progress on disk.

    Attributes:
        path: the file; the previous one has .previous after its name.
        age_s: time since it was last written; null before the first write.
        restored_cells: covered cells loaded at the start.
        fault: its present or past fault, and what to do.
    """

    path: str = ""
    age_s: Amount | None = None
    restored_cells: Count = 0
    fault: str | None = None


class Recorder(Document, frozen=True):
    """The recorder's status, on its own key.

    Attributes:
        reason: reason of the state, for a person; may be empty.
        file: the part being written; empty while there is none.
        bytes: its size.
        messages: samples taken from the bus.
        lost: samples that were not written, or may not have been.
        malformed: malformed samples.
        rss_mb: memory of the process [MB].
        cpu_s: processor time the process has used [s].
    """

    state: Annotated[str, allowed(enum=RECORDER_STATES)] = ""
    reason: str = ""
    file: str = ""
    bytes: Count = 0
    messages: Count = 0
    lost: Count = 0
    malformed: Count = 0
    rss_mb: Amount = 0.0
    cpu_s: Amount = 0.0
    pid: Count = 0


class SupervisedRecorder(Document, frozen=True):
    """A supervised recorder: its own status, see recorder.json, once it has published one.

    Attributes:
        restarts: number of restarts.
        reason: reason of the state, for a person; may be empty.
        file: the part being written; empty while there is none.
        bytes: its size.
        messages: samples taken from the bus.
        lost: samples that were not written, or may not have been.
        malformed: malformed samples.
        rss_mb: memory of the process [MB].
        cpu_s: processor time the process has used [s].
    """

    state: Annotated[str, allowed(enum=SUPERVISED_STATES)] = ""
    restarts: Count = 0
    reason: str | UnsetType = UNSET
    file: str | UnsetType = UNSET
    bytes: Count | UnsetType = UNSET
    messages: Count | UnsetType = UNSET
    lost: Count | UnsetType = UNSET
    malformed: Count | UnsetType = UNSET
    rss_mb: Amount | UnsetType = UNSET
    cpu_s: Amount | UnsetType = UNSET
    pid: Ordinal | UnsetType = UNSET


class MemberReport(Document, frozen=True):
    """Another robot of the fleet.

    Attributes:
        name: name of the robot.
        state: state of its mission, in its last message.
        heard_s: time since its last message [s].
        away: why it gets no part of the remaining cells; null if it gets one.
        swept_cells: cells swept by it that this robot need not sweep.
    """

    name: Name = ""
    state: str = ""
    heard_s: Amount = 0.0
    away: str | None = None
    swept_cells: Count = 0


class FleetReport(Document, frozen=True):
    """The fleet, as this robot knows it.

    Attributes:
        name: name of the fleet.
        division: number of the newest division of the remaining cells.
        part_cells: number of reachable cells assigned to this robot; null if all are.
        members: the other robots, by name.
    """

    name: Name = ""
    division: Count = 0
    part_cells: Count | None = None
    members: tuple[MemberReport, ...] = ()


class Status(Document, frozen=True):
    """The status of a daemon. Members may be added; readers ignore unknown ones.

    Attributes:
        version: version of the package.
        reason: why it is in that state.
        troubles: the present troubles, at most one of each code.
        rss_mb: memory of the process [MB].
        cpu_s: processor time the process has used [s].
        threads: number of threads of the process.
    """

    robot: Name = ""
    version: str = ""
    state: StateName = ""
    reason: str = ""
    claim: ClaimReport = ClaimReport()
    uptime_s: Amount = 0.0
    map: MapReport | None = None
    pose: PoseReport | None = None
    coverage: CoverageReport | None = None
    floor: FloorReport | None = None
    path: PathReport | None = None
    plan: PlanCounts = PlanCounts()
    latency_ms: Latencies = Latencies()
    loop_ms: LoopTimes = LoopTimes()
    drive: DriveReport = DriveReport()
    battery: BatteryReport | None = None
    errors: ErrorCounts = ErrorCounts()
    ledger: LedgerReport = LedgerReport()
    recorder: SupervisedRecorder | None = None
    rss_mb: Amount = 0.0
    cpu_s: Amount = 0.0
    threads: Count = 0
    config: Annotated[Settings, allowed(**{"$ref": "config.json"})] = msgspec.field(
        default_factory=dict
    )
    mission: MissionReport = MissionReport()
    fleet: FleetReport | None = None
    troubles: Annotated[tuple[TroubleReport, ...], allowed(maxItems=len(TROUBLES))] = ()
