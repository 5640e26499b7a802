"""Replies: what a daemon answers to commands and queries, and how far its mission is."""

from __future__ import annotations

from typing import Annotated, Final

import msgspec

from fasaco_edge.errors import FasacoError
from fasaco_edge.wire.documents.json_text import (
    Amount,
    Count,
    Document,
    Name,
    Ordinal,
    allowed,
    encode_json,
)

STATES: Final = (
    *("idle", "waiting for map", "waiting for pose", "loading", "planning", "covering"),
    *("returning", "charging", "paused", "blocked", "degraded", "done"),
)
State = Annotated[str, allowed(enum=STATES)]


class Point(Document, frozen=True):
    """A place.

    Attributes:
        x, y: [m] in the frame of the map.
    """

    x: float = 0.0
    y: float = 0.0


class CoverageReport(Document, frozen=True):
    """How many cells are covered; areas are of cells, of floor see FloorReport.

    Attributes:
        coverable: cells that are coverable and that the robot can reach.
        covered: of those.
        recovered: of those, covered more than once.
        remaining: of those, still to cover.
        unreachable: cells where the robot would fit, but that it cannot get to.
        free_out_of_reach_m2: area the map knows to be free, but in no reachable cell.
        fraction: covered share of coverable.
    """

    coverable: Count = 0
    covered: Count = 0
    recovered: Count = 0
    remaining: Count = 0
    unreachable: Count = 0
    covered_m2: Amount = 0.0
    to_cover_m2: Amount = 0.0
    free_out_of_reach_m2: Amount = 0.0
    fraction: Annotated[float, allowed(minimum=0, maximum=1)] = 0.0


class FloorLeft(Document, frozen=True):
    """Floor that is not swept, for one reason."""

    m2: Amount = 0.0
    reason: str = ""


class FloorReport(Document, frozen=True):
    """How much floor is swept, by what the tool passed over and not by cells.

    Attributes:
        swept_m2: floor that the tool has passed over, within reach now or not.
        reachable_m2: floor that the tool can reach and is asked to sweep, as far as that is known;
            null if the robot drives through the centres of cells.
        left: what of that is not swept, and why, the largest first; null where that is not known.
        out_of_reach: floor that the map shows free and the tool cannot come to, asked for or not,
            and why, the largest first; null where that is not known.
    """

    swept_m2: Amount = 0.0
    reachable_m2: Amount | None = None
    left: Annotated[tuple[FloorLeft, ...], allowed(maxItems=20)] | None = None
    out_of_reach: Annotated[tuple[FloorLeft, ...], allowed(maxItems=20)] | None = None

    @property
    def reached_m2(self) -> float | None:
        """What of the reachable floor is swept [m2]; None where that is not known."""
        if self.reachable_m2 is None or self.left is None:
            return None
        return max(self.reachable_m2 - sum(left.m2 for left in self.left), 0.0)


class ZoneReport(Document, frozen=True):
    """How far a zone is.

    Attributes:
        pass: its newest pass; 0: to come.
        cells: that can be reached.
        covered: in that pass.
    """

    name: str = ""
    passes: Ordinal = 1
    pass_number: Count = msgspec.field(name="pass", default=0)
    cells: Count = 0
    covered: Count = 0


class UnreachedArea(Document, frozen=True):
    """An area of the order that stays uncovered.

    Attributes:
        x, y: [m] in the frame of the map.
    """

    cells: Ordinal = 1
    m2: Amount = 0.0
    x: float = 0.0
    y: float = 0.0
    reason: str = ""


class UnreachedReport(Document, frozen=True):
    """What of the order stays uncovered as things are."""

    cells: Count = 0
    m2: Amount = 0.0
    areas: Annotated[tuple[UnreachedArea, ...], allowed(maxItems=20)] = ()
    areas_left_out: Count = 0


class MissionReport(Document, frozen=True):
    """The order, and how far it is.

    Attributes:
        paused: whether the mission is paused.
        zone: what is being covered; null for everything reachable.
        pass: which pass that is; null without an order.
        passes: of how many.
        keep_out: how many keep-out zones there are, standing ones too; a mask counts as one.
        home: where the robot returns to; without one in the configuration where the mission began.
        tries: how often what was left over was tried again.
        unreached: what of the order stays uncovered as things are.
    """

    ordered: Annotated[str | None, allowed(enum=("command", "itself", None))] = None
    stage: Annotated[
        str | None, allowed(enum=("covering", "retrying", "returning", "over", None))
    ] = None
    paused: bool = False
    zone: str | None = None
    pass_number: Ordinal | None = msgspec.field(name="pass", default=None)
    passes: Ordinal | None = None
    zones: tuple[ZoneReport, ...] = ()
    keep_out: Count = 0
    return_home: bool = False
    home: Point | None = None
    tries: Count = 0
    unreached: UnreachedReport = UnreachedReport()


class Reply(Document, frozen=True):
    """The answer to a command that was taken."""

    robot: Name = ""
    state: State = ""
    reason: str = ""
    coverage: CoverageReport | None = None
    floor: FloorReport | None = None
    mission: MissionReport = MissionReport()


class Replan(Document, frozen=True):
    """The answer to a wish for a new plan that was taken.

    Attributes:
        plan: number of the plan: it is made once plan.plans of the status has come to it.
    """

    robot: Name
    plan: Ordinal
    accepted: Annotated[bool, allowed(const=True)] = True


class Version(Document, frozen=True):
    """What answers.

    Attributes:
        version: of the package.
        protocol: of these keys.
        zenoh: of eclipse-zenoh.
    """

    version: str
    protocol: Annotated[str, allowed(pattern="^v[0-9]+$")]
    zenoh: str
    package: Annotated[str, allowed(const="fasaco-edge")] = "fasaco-edge"


class Error(Document, frozen=True, forbid_unknown_fields=True):
    """Every answer that is an error. It comes as Zenoh's error reply.

    Attributes:
        code: one of those in errors.yaml.
        message: what was wrong, and where.
        hint: what to do about it; may be empty.
    """

    code: Annotated[str, allowed(pattern="^[a-z_]+$")] = ""
    message: Name = ""
    hint: str = ""


def encode_error(error: FasacoError) -> bytes:
    """Return the reply for a failed query."""
    return encode_json(Error(error.code, str(error), error.hint))
