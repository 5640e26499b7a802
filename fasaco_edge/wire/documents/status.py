"""Status documents: what a daemon and a recorder publish about themselves, and read back.

The structs are the contract: ``protocol/schema`` is generated from them. Each member has a
default, so that a reader takes a document of another version (``json_text.decode_tolerant``).
"""

from __future__ import annotations

from typing import Annotated, Final

import msgspec
from msgspec import UNSET, UnsetType

from fasaco_edge.wire.documents.json_text import Amount, Count, Document, Name, Ordinal, allowed
from fasaco_edge.wire.documents.path_documents import PathReport
from fasaco_edge.wire.documents.replies import (
    CoverageReport,
    FloorReport,
    MissionReport,
    Point,
    State,
)
from fasaco_edge.wire.documents.settings import Settings

RECORDER_STATES: Final = ("recording", "disk full", "stalled", "stopping")
SUPERVISED_STATES: Final = ("starting", *RECORDER_STATES, "silent", "restarting")
CLAIMS: Final = ("looks", "waits", "yields", "plans")


class ClaimReport(Document, frozen=True):
    """Who sends a status, and whether that daemon plans: of several of one name one does.

    Attributes:
        id: its Zenoh id.
        stand: its role. looks: whether another plans is not known yet; waits: another plans;
            yields: another plans, and this one did before; plans: this one does.
    """

    id: Annotated[str, allowed(pattern="^[0-9a-f]{1,32}$")] = ""
    stand: Annotated[str, allowed(enum=CLAIMS)] = "plans"


class MapReport(Document, frozen=True):
    """The newest map.

    Attributes:
        resolution_m: edge of a pixel.
        revision: goes up by one with each new state of the map; updates that come together count
            once.
        frame: name of its frame.
        lattice_deg: the angle of the cells' rows to the x axis of that frame.
    """

    rows: Ordinal = 1
    cols: Ordinal = 1
    resolution_m: Annotated[float, allowed(exclusiveMinimum=0)] = 1.0
    revision: Ordinal = 1
    stamp_ns: int = 0
    frame: str = ""
    lattice_deg: float = 0.0


class PoseReport(Point, frozen=True):
    """Where the robot is.

    Attributes:
        x, y: [m] in the frame of the map.
        yaw: [rad], counter-clockwise.
    """

    yaw: float = 0.0


class PlanCounts(Document, frozen=True):
    """How many plans were made.

    Attributes:
        plans: how many plans were made.
        unchanged: plans that found the path there is.
        outdated: plans that did not hold any more when they came.
        attempts: how often spare time went into a better path.
        planning: whether one is being made.
    """

    plans: Count = 0
    unchanged: Count = 0
    outdated: Count = 0
    attempts: Count = 0
    planning: bool = False


class Latencies(Document, frozen=True):
    """How long things took last [ms]; null before the first time.

    Attributes:
        ingest: taking in the newest map.
        plan: making the newest plan.
        map_to_path: from the arrival of a map to the publication of the path it led to.
    """

    ingest: Amount | None = None
    plan: Amount | None = None
    map_to_path: Amount | None = None


class LoopTimes(Document, frozen=True):
    """Cycles of the daemon's loop since its start, and how long they took [ms].

    Attributes:
        turns: how many there were.
        late: of those, longer than 100 ms.
        p50: half of the cycles took at most so long, to within 10 %; null before the first.
        p99: 99 of 100.
        p99_9: 999 of 1,000.
        max: the longest.
    """

    turns: Count = 0
    late: Count = 0
    p50: Amount | None = None
    p99: Amount | None = None
    p99_9: Amount | None = None
    max: Amount | None = None


class DriveReport(Document, frozen=True):
    """What driving takes the robot, as its poses show; null of what too little was seen.

    Attributes:
        planned_quarter_turn_s: what paths are planned by, of robot.quarter_turn_s or its limits.
        speed_m_s: in straight driving.
        quarter_turn_s: a turn by about 90 degrees on the spot, braking and starting included.
        half_turn_s: a turn by about 180 degrees.
        turns: how many turns were measured.
    """

    planned_quarter_turn_s: Amount = 0.0
    speed_m_s: Amount | None = None
    quarter_turn_s: Amount | None = None
    half_turn_s: Amount | None = None
    turns: Count = 0


class BatteryReport(Document, frozen=True):
    """The battery; levels are shares of a full one, null where they are not known.

    Attributes:
        level: its charge.
        power: what the supply does, as its message says; "" before there was one.
        age_s: how long no charge has come that is believed.
        drain_per_h: what driving takes an hour, as measured.
        turns_back_at: the robot goes to charge at this level.
        goes_on_at: it goes on at this level; null where it does not charge.
    """

    level: Amount | None = None
    power: str = ""
    age_s: Amount = 0.0
    drain_per_h: Amount | None = None
    turns_back_at: Amount | None = None
    goes_on_at: Amount | None = None


class ErrorCounts(Document, frozen=True):
    """Faults since the start: what was refused, could not be published, or failed.

    Attributes:
        last: message of the newest.
        by_code: how often, by the codes in errors.yaml.
    """

    total: Count = 0
    last: str = ""
    by_code: Annotated[
        dict[str, Ordinal], allowed(propertyNames={"type": "string", "pattern": "^[a-z_]+$"})
    ] = msgspec.field(default_factory=dict)


class LedgerReport(Document, frozen=True):
    """The progress on disk.

    Attributes:
        path: the file; .previous behind its name is the one before.
        age_s: since it was last written; null before the first time.
        restored_cells: covered cells loaded at the start.
        fault: what is or was wrong with it, and what to do.
    """

    path: str = ""
    age_s: Amount | None = None
    restored_cells: Count = 0
    fault: str | None = None


class Recorder(Document, frozen=True):
    """What the recorder says about itself, on its key.

    Attributes:
        reason: why, for a person; may be empty.
        file: the part being written; empty while there is none.
        bytes: its size.
        messages: samples taken from the bus.
        lost: samples that were not written, or may not have been.
        malformed: samples that were not what they should be.
        rss_mb: memory of the process [MB].
    """

    state: Annotated[str, allowed(enum=RECORDER_STATES)] = ""
    reason: str = ""
    file: str = ""
    bytes: Count = 0
    messages: Count = 0
    lost: Count = 0
    malformed: Count = 0
    rss_mb: Amount = 0.0
    pid: Ordinal = 0


class SupervisedRecorder(Document, frozen=True):
    """A supervised recorder: what it says, see recorder.json, if it has said anything.

    Attributes:
        restarts: how often it was started again.
        reason: why, for a person; may be empty.
        file: the part being written; empty while there is none.
        bytes: its size.
        messages: samples taken from the bus.
        lost: samples that were not written, or may not have been.
        malformed: samples that were not what they should be.
        rss_mb: memory of the process [MB].
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
    pid: Ordinal | UnsetType = UNSET


class MemberReport(Document, frozen=True):
    """Another robot of the fleet.

    Attributes:
        name: of the robot.
        state: of its mission, as it said last.
        heard_s: since then.
        away: why it takes no part in what is left; null where it does.
        swept_cells: cells that count for this robot, too.
    """

    name: Name = ""
    state: str = ""
    heard_s: Amount = 0.0
    away: str | None = None
    swept_cells: Count = 0


class FleetReport(Document, frozen=True):
    """The fleet, as this robot knows it.

    Attributes:
        name: of the fleet.
        division: number of the newest division of what is left.
        part_cells: how many cells of what it can reach are this robot's; null where all are.
        members: the other robots, by name.
    """

    name: Name = ""
    division: Count = 0
    part_cells: Count | None = None
    members: tuple[MemberReport, ...] = ()


class Status(Document, frozen=True):
    """What a daemon says about itself. Members may be added; readers ignore unknown ones.

    Attributes:
        version: of the package.
        reason: why it is in that state.
        rss_mb: memory of the process [MB].
        cpu_s: processor time the process has used [s].
        threads: of the process.
    """

    robot: Name = ""
    version: str = ""
    state: State = ""
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
    threads: Ordinal = 0
    config: Annotated[Settings, allowed(**{"$ref": "config.json"})] = msgspec.field(
        default_factory=dict
    )
    mission: MissionReport = MissionReport()
    fleet: FleetReport | None = None
