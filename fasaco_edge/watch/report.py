"""A daemon's status as values. What is missing keeps its default, what is unknown is left out."""

from __future__ import annotations

from typing import Any, TypeVar

import msgspec

from fasaco_edge.errors import MalformedMessage

Part = TypeVar("Part", bound=msgspec.Struct)


class Place(msgspec.Struct, frozen=True):
    """Where the robot is [m, rad]."""

    x: float
    y: float
    yaw: float = 0.0


class Coverage(msgspec.Struct, frozen=True):
    """How many cells are covered."""

    coverable: int = 0
    covered: int = 0
    recovered: int = 0
    remaining: int = 0
    unreachable: int = 0
    fraction: float = 0.0
    covered_m2: float = 0.0
    to_cover_m2: float = 0.0


class PathReport(msgspec.Struct, frozen=True):
    """How much is left of the path, and of the plan it follows."""

    revision: int = 0
    reason: str = ""
    steps: int = 0
    remaining_steps: int = 0
    planner: str | None = None
    planned_steps: int | None = None
    lower_bound_steps: int | None = None
    gap: float | None = None


class PathNote(msgspec.Struct, frozen=True):
    """What comes attached to a path."""

    revision: int = 0
    reason: str = ""
    steps: int = 0


class Plans(msgspec.Struct, frozen=True):
    """How many plans were made."""

    plans: int = 0
    planning: bool = False


class Latencies(msgspec.Struct, frozen=True):
    """How long the last map, plan, and way from map to path took [ms]."""

    ingest: float | None = None
    plan: float | None = None
    map_to_path: float | None = None


class Errors(msgspec.Struct, frozen=True):
    """What was refused."""

    total: int = 0
    last: str = ""
    by_code: dict[str, int] = {}


class Ledger(msgspec.Struct, frozen=True):
    """How old the progress on disk is [s], and what is wrong with it."""

    age_s: float | None = None
    restored_cells: int = 0
    fault: str | None = None


class Recorder(msgspec.Struct, frozen=True):
    """How a supervised recorder is."""

    state: str = ""
    reason: str = ""
    bytes: int = 0


class Zone(msgspec.Struct, frozen=True):
    """How far a zone is."""

    name: str = ""
    passes: int = 1
    turn: int = msgspec.field(name="pass", default=0)
    cells: int = 0
    covered: int = 0


class Unreached(msgspec.Struct, frozen=True):
    """What of the order stays uncovered as things are."""

    cells: int = 0
    m2: float = 0.0


class Mission(msgspec.Struct, frozen=True):
    """The order, and how far it is."""

    stage: str | None = None
    paused: bool = False
    zone: str | None = None
    turn: int | None = msgspec.field(name="pass", default=None)
    passes: int | None = None
    zones: tuple[Zone, ...] = ()
    keep_out: int = 0
    return_home: bool = False
    tries: int = 0
    unreached: Unreached = Unreached()


class RobotShape(msgspec.Struct, frozen=True):
    """The robot's size [m]."""

    radius_m: float = 0.0


class PoseType(msgspec.Struct, frozen=True):
    """The type of poses whose sender names none."""

    schema: str = ""


class Config(msgspec.Struct, frozen=True):
    """What of the configuration is of use here."""

    robot: RobotShape = RobotShape()
    pose: PoseType = PoseType()


class ClaimReport(msgspec.Struct, frozen=True):
    """Who has said it, and whether that daemon plans."""

    id: str = ""
    stand: str = "plans"


class Report(msgspec.Struct, frozen=True):
    """A status."""

    state: str
    reason: str = ""
    claim: ClaimReport = ClaimReport()
    uptime_s: float = 0.0
    pose: Place | None = None
    coverage: Coverage | None = None
    path: PathReport | None = None
    plan: Plans = Plans()
    latency_ms: Latencies = Latencies()
    errors: Errors = Errors()
    ledger: Ledger = Ledger()
    recorder: Recorder | None = None
    mission: Mission = Mission()
    rss_mb: float = 0.0
    config: Config = Config()


def read(document: dict[str, Any], kind: type[Part]) -> Part:
    """Return a JSON object as values of ``kind``.

    Raises:
        MalformedMessage: a member it must have is missing, or one is of another type.
    """
    try:
        return msgspec.convert(document, kind)
    except msgspec.ValidationError as error:
        raise MalformedMessage(f"{kind.__name__.lower()}: {error}") from error
