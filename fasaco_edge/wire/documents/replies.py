"""Replies of a daemon to commands and queries, and the progress of its mission."""

from __future__ import annotations

from typing import Annotated, Final

import msgspec
from msgspec import Meta

from fasaco_edge.errors import FasacoError
from fasaco_edge.states import State
from fasaco_edge.wire.documents.json_text import (
    Amount,
    Corners,
    Count,
    Document,
    Name,
    Ordinal,
    allowed,
    encode_json,
)

STATES: Final = tuple(state.value for state in State)
StateName = Annotated[str, allowed(enum=STATES)]
TROUBLES: Final = (
    *("not_begun", "no_pose", "pose_jumped", "no_map", "no_battery", "no_dock", "no_current"),
    *("shut_in", "blocked", "stands", "beside_line", "two_publishers", "no_effect"),
)


class Point(Document, frozen=True):
    """A place.

    Attributes:
        x, y: [m] in the frame of the map.
    """

    x: float = 0.0
    y: float = 0.0


class CoverageReport(Document, frozen=True):
    """The coverage in cells, and the areas of these cells. For swept floor see FloorReport.

    Attributes:
        coverable: cells that are reachable, or have been since the order began.
        covered: coverable cells that are covered.
        recovered: coverable cells that are covered more than once.
        remaining: coverable cells that are still to cover.
        unreachable: cells where the robot would fit, but that it cannot reach.
        free_out_of_reach_m2: area that the map shows free, but in no reachable cell.
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
    fraction: Annotated[float, Meta(ge=0, le=1)] = 0.0


class FloorLeft(Document, frozen=True):
    """Unswept floor for one reason."""

    m2: Amount = 0.0
    reason: str = ""


class FloorReport(Document, frozen=True):
    """The swept floor, by the area that the tool passed over, not by cells.

    Attributes:
        swept_m2: floor that the tool has passed over, reachable now or not.
        reachable_m2: known floor that the tool can reach and has to sweep; while the robot is shut
            in, the floor that it could reach since the order began. Null if the robot drives
            through the centres of cells.
        left: unswept part of reachable_m2 by reason, the largest first; null if unknown.
        out_of_reach: free floor on the map that the tool cannot reach, whether part of the order or
            not, by reason, the largest first; null if unknown.
        possible_m2: floor that the tool would reach if walls and furniture were a pixel thinner
            than on the map; null before the end of an order, or if unknown.
    """

    swept_m2: Amount = 0.0
    reachable_m2: Amount | None = None
    left: Annotated[tuple[FloorLeft, ...], allowed(maxItems=20)] | None = None
    out_of_reach: Annotated[tuple[FloorLeft, ...], allowed(maxItems=20)] | None = None
    possible_m2: Amount | None = None

    @property
    def reached_m2(self) -> float | None:
        """Swept part of the reachable floor [m2]; None if unknown."""
        if self.reachable_m2 is None or self.left is None:
            return None
        return max(self.reachable_m2 - sum(left.m2 for left in self.left), 0.0)


class ZoneReport(Document, frozen=True):
    """The progress of a zone.

    Attributes:
        pass: number of its newest pass; 0 before the first.
        cells: number of reachable cells.
        covered: cells covered in that pass.
        polygon: corners x, y [m] in the frame of the map.
    """

    name: str = ""
    passes: Ordinal = 1
    pass_number: Count = msgspec.field(name="pass", default=0)
    cells: Count = 0
    covered: Count = 0
    polygon: Corners = ()


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
    """The part of the order that cannot be covered at present."""

    cells: Count = 0
    m2: Amount = 0.0
    areas: Annotated[tuple[UnreachedArea, ...], allowed(maxItems=20)] = ()
    areas_left_out: Count = 0


class KeepOutReport(Document, frozen=True):
    """A keep-out in force, of the order or of the operator.

    Attributes:
        name: name by which the operator removes it; "" for a keep-out of the order.
        polygon: corners x, y [m] in the frame of the map.
        by: whether the operator or the order set it.
    """

    name: str = ""
    polygon: Corners = ()
    by: Annotated[str, allowed(enum=("operator", "order"))] = "operator"


class MissionReport(Document, frozen=True):
    """The order and its progress.

    Attributes:
        paused: whether the mission is paused.
        zone: the zone being covered; null for everything reachable.
        pass: number of the present pass; null without an order.
        passes: number of all passes.
        pass_kind: how the present pass differs from a usual one, as text: edge, rest, cross, 30
            degrees; null if it does not.
        keep_out: number of keep-out zones, with those of the configuration; a mask counts as one.
        keep_outs: the keep-out zones in force, without those of the configuration.
        home: position the robot returns to; by default where the first order after a reset began.
        tries: retries of the cells left over.
        unreached: part of the order that cannot be covered at present.
        waits_for_room: name of the room that the order waits for; null for none.
        left_out: rooms that the order for everything leaves out, by their settings.
        time_left_s: time until the order ends with the robot at home [s]; null without a limit.
        first_from: floor of this priority or more is planned now, as time or battery do not suffice
            for all; null if all floor is planned.
        last_order: the cancelled order, as given, until another begins; null for none.
    """

    ordered: Annotated[str | None, allowed(enum=("command", "itself", None))] = None
    stage: Annotated[
        str | None, allowed(enum=("covering", "retrying", "returning", "over", None))
    ] = None
    paused: bool = False
    zone: str | None = None
    pass_number: Ordinal | None = msgspec.field(name="pass", default=None)
    passes: Ordinal | None = None
    pass_kind: Annotated[str, allowed(maxLength=64)] | None = None
    zones: tuple[ZoneReport, ...] = ()
    keep_out: Count = 0
    return_home: bool = False
    home: Point | None = None
    tries: Count = 0
    unreached: UnreachedReport = UnreachedReport()
    keep_outs: Annotated[tuple[KeepOutReport, ...], allowed(maxItems=200)] = ()
    waits_for_room: str | None = None
    left_out: Annotated[tuple[str, ...], allowed(maxItems=250)] = ()
    time_left_s: Amount | None = None
    first_from: Annotated[int, Meta(ge=1, le=100)] | None = None
    last_order: (
        Annotated[dict[str, object], allowed(**{"$ref": "mission.json#/$defs/OrderDocument"})]
        | None
    ) = None


class TroubleReport(Document, frozen=True):
    """A fault, reported beside the state of the mission.

    Attributes:
        text: what is wrong, for a person.
        do: what to do about it.
        since_s: for how long it has been reported [s].
    """

    code: Annotated[str, allowed(enum=TROUBLES)] = ""
    text: str = ""
    do: str = ""
    since_s: Amount = 0.0


class Reply(Document, frozen=True):
    """The reply to an accepted command."""

    robot: Name = ""
    state: StateName = ""
    reason: str = ""
    coverage: CoverageReport | None = None
    floor: FloorReport | None = None
    mission: MissionReport = MissionReport()
    troubles: Annotated[tuple[TroubleReport, ...], allowed(maxItems=len(TROUBLES))] = ()


class Replan(Document, frozen=True):
    """The reply to an accepted request for a new plan.

    Attributes:
        plan: number of the plan, which is made once plan.plans of the status has reached this
            number.
    """

    robot: Name
    plan: Ordinal
    accepted: Annotated[bool, allowed(const=True)] = True


class Version(Document, frozen=True):
    """The versions of a daemon.

    Attributes:
        version: version of the package.
        protocol: version of the keys.
        zenoh: version of eclipse-zenoh.
    """

    version: str
    protocol: Annotated[str, allowed(pattern="^v[0-9]+$")]
    zenoh: str
    package: Annotated[str, allowed(const="fasaco-edge")] = "fasaco-edge"


class Error(Document, frozen=True, forbid_unknown_fields=True):
    """An error; sent as Zenoh's error reply.

    Attributes:
        code: a code in errors.yaml.
        message: the fault and its place.
        hint: what to do about it; may be empty.
    """

    code: Annotated[str, allowed(pattern="^[a-z_]+$")] = ""
    message: Name = ""
    hint: str = ""


def encode_error(error: FasacoError) -> bytes:
    """Return the reply for a failed query."""
    return encode_json(Error(error.code, str(error), error.hint))
