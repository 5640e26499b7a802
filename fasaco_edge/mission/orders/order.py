"""Orders and commands: zones, passes, keep-out zones; their JSON or YAML form and its schema.

``protocol/schema/mission.json`` is generated from these definitions; a test compares them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple

import msgspec
from msgspec import Meta

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import Point, Polygon
from fasaco_edge.host.documents import StrictDocument, converted
from fasaco_edge.mission.orders.keep_outs import (
    MOST_KEEP_OUT,
    Corners,
    KeepOut,
    PlaceName,
    name_faults,
    polygon_faults,
)
from fasaco_edge.mission.orders.passes import Passes, passes_document, passes_faults, passes_of
from fasaco_edge.mission.orders.room_requests import (
    USUAL_PRIORITY,
    Priority,
    RoomNumber,
    RoomRequest,
)
from fasaco_edge.planners.passes import Laid, Pass, laid

MOST_ZONES = 100
Minutes = Annotated[float, Meta(ge=0, le=1440)]


class RoomArea(NamedTuple):
    """A room in an order for everything; the polygons are corners (x, y) [m]."""

    title: str
    outline: Polygon
    holes: tuple[Polygon, ...] = ()
    priority: int = USUAL_PRIORITY


@dataclass(frozen=True, slots=True)
class Zone:
    """An area to cover.

    Attributes:
        name: unique in its order.
        polygon: corners (x, y) [m] in the map frame, the last joined to the first; None for
            everything reachable; () until ``map.placing`` finds the configured zone or room of that
            name.
        passes: number of passes.
        kinds: settings of each pass; () if all passes are usual.
        room: number of the room whose outline it follows; 0 for none.
        holes: polygons within ``polygon`` that are not part of it.
        without: the rooms that a zone of everything leaves out.
        priority: zones of higher priority come first if time or battery do not allow all; None for
            the room's priority, or the usual priority.
        ranked: the rooms in a zone of everything that have a priority of their own.
        is_as_usual: whether the order gives no passes, so that a room's settings apply.
    """

    name: str
    polygon: Polygon | None
    passes: int = 1
    kinds: tuple[Pass, ...] = ()
    room: int = 0
    holes: tuple[Polygon, ...] = ()
    without: tuple[RoomArea, ...] = ()
    priority: int | None = None
    ranked: tuple[RoomArea, ...] = ()
    is_as_usual: bool = field(default=False, compare=False)

    @property
    def worth(self) -> int:
        """Its priority."""
        return USUAL_PRIORITY if self.priority is None else self.priority

    def kind(self, number: int) -> Pass:
        """Return the settings of a pass, counted from 1."""
        return self.kinds[number - 1] if self.kinds else Pass()

    def laid(self, number: int) -> Laid:
        """Return a pass, counted from 1, with its lanes on a lattice."""
        return laid(self.kinds)[number - 1] if self.kinds else Laid()


EVERYTHING = "everything"
Unknown = Literal["refuse", "wait"]


@dataclass(frozen=True, slots=True)
class MissionOrder:
    """What to cover.

    Attributes:
        zones: covered one after the other, in this order; at least one.
        keep_out: polygons (x, y) [m] in the map frame that the robot must not touch.
        return_home: whether to drive back to the start at the end.
        keep_covered: whether the first pass skips cells that were covered before.
        unknown: whether an order with an unknown zone name is refused, or waits for a room of that
            name.
        until_min: time after which it ends, with the robot at home [min]; 0 for no limit, None for
            the configured limit.
        given: the order as given, in the map frame, if the polygons are rotated, see
            ``rotated_order``.
    """

    zones: tuple[Zone, ...] = (Zone(EVERYTHING, None),)
    keep_out: tuple[Polygon, ...] = ()
    return_home: bool = False
    keep_covered: bool = False
    unknown: Unknown = "refuse"
    until_min: float | None = None
    given: MissionOrder | None = field(default=None, compare=False, repr=False)

    @property
    def as_given(self) -> MissionOrder:
        """The order in the map frame, bit for bit as given."""
        return self.given or self


EVERYTHING_ONCE = MissionOrder()

CommandName = Literal[
    "start",
    "pause",
    "resume",
    "home",
    "cancel",
    "reset",
    "replan",
    "status",
    "keep_out_add",
    "keep_out_remove",
    "room_name",
    "room_split",
    "room_merge",
    "room_set",
]
# Destination of a drive outside the order; "" for none.
Errand = Literal["", "home", "charge"]


class Command(NamedTuple):
    """A command to a mission.

    Attributes:
        name: name of the command.
        order: what to cover, for ``start``.
        keep_out: what to add or remove, for ``keep_out_add`` and ``keep_out_remove``.
        discard: whether ``start`` and ``reset`` may forget covered cells.
        room: which room to change, and how, for the commands of rooms.
    """

    name: CommandName
    order: MissionOrder = EVERYTHING_ONCE
    keep_out: KeepOut | None = None
    discard: bool = False
    room: RoomRequest | None = None


class ConfiguredZone(StrictDocument, frozen=True):
    """A zone of the configuration, referred to by its name."""

    name: PlaceName
    polygon: Corners


class ZoneDocument(StrictDocument, frozen=True):
    """An area to cover; without a polygon, the configured zone or else the room of that name.

    Attributes:
        room: number of the room whose outline it follows.
        priority: zones of higher priority come first if time or battery do not allow all; by
            default the room's priority, or 50.
    """

    name: PlaceName
    polygon: Corners | None = None
    passes: Passes | None = None
    room: RoomNumber | None = None
    priority: Priority | None = None

    def faults(self) -> Iterator[OrderError]:
        yield from passes_faults(self.passes)


_Zones = Annotated[list[ZoneDocument], Meta(max_length=MOST_ZONES)]
_KeepOuts = Annotated[list[Corners], Meta(max_length=MOST_KEEP_OUT)]


class OrderDocument(StrictDocument, frozen=True):
    """What to cover. Without zones: everything the robot can reach.

    Attributes:
        passes: passes of everything, and of zones that give none; by default one pass, or for rooms
            the passes of their settings.
        unknown: whether an order with an unknown zone name is refused, or the zone waits, after
            all others, for a room of that name.
        until_min: time after which the order ends, with the robot at home [min]; 0 for no limit,
            null for `mission.until_min` of the configuration.
    """

    zones: _Zones = msgspec.field(default_factory=list)
    keep_out: _KeepOuts = msgspec.field(default_factory=list)
    passes: Passes | None = None
    return_home: bool = False
    keep_covered: bool = False
    unknown: Unknown = "refuse"
    until_min: Minutes | None = None

    def faults(self) -> Iterator[OrderError]:
        yield from passes_faults(self.passes)
        yield from place_faults(self.zones, self.keep_out)


def place_faults(
    zones: Sequence[ZoneDocument | ConfiguredZone], keep_out: Sequence[Sequence[Point]]
) -> Iterator[OrderError]:
    """Yield wrong and equal names of zones, and wrong polygons."""
    polygons = {f"keep_out[{at}]": tuple(each) for at, each in enumerate(keep_out) if each}
    names: set[str] = set()
    for index, zone in enumerate(zones):
        if not zone:
            continue
        yield from name_faults(zone.name, key := f"zones[{index}].name")
        if zone.name and zone.name in names:
            yield OrderError(f"there is a zone {zone.name!r} already", key=key)
        names.add(zone.name)
        if zone.polygon:
            polygons[f"zones[{index}].polygon"] = tuple(zone.polygon)
    yield from polygon_faults(polygons)


def read_order(document: object) -> MissionOrder:
    """Return the order in a parsed JSON or YAML document; None is an order for everything.

    Raises:
        OrderError: a member is wrong; the text names it, the expected and the given value.
    """
    return order_of(converted(OrderDocument, {} if document is None else document, OrderError))


def order_document(order: MissionOrder) -> dict[str, object]:
    """Return the document of an order, in the map frame; ``read_order`` reads it."""
    order = order.as_given
    rest = {
        "keep_out": order.keep_out,
        "return_home": order.return_home,
        "keep_covered": order.keep_covered,
    } | ({} if order.unknown == "refuse" else {"unknown": order.unknown})
    rest |= {} if order.until_min is None else {"until_min": order.until_min}
    first = order.zones[0]
    if first.polygon is None:
        return {"passes": passes_document(first.passes, first.kinds), **rest}
    return {"zones": list(map(_zone_document, order.zones)), **rest}


def _zone_document(zone: Zone) -> dict[str, object]:
    # A zone given by name alone may be a room with passes of its own.
    says_none = zone.is_as_usual and zone.polygon == ()
    passes = {} if says_none else {"passes": passes_document(zone.passes, zone.kinds)}
    polygon = {"polygon": zone.polygon} if zone.polygon else {}
    room = {"room": zone.room} if zone.room else {}
    priority = {} if zone.priority is None else {"priority": zone.priority}
    return {"name": zone.name, **passes, **polygon, **room, **priority}


def order_of(document: OrderDocument) -> MissionOrder:
    """Return the order in a document without faults."""
    usual, is_usual = passes_of(document.passes or 1), document.passes is None
    zones = tuple(
        Zone(
            zone.name,
            tuple(zone.polygon or ()),
            *(passes_of(zone.passes) if zone.passes else usual),
            room=zone.room or 0,
            priority=zone.priority,
            is_as_usual=is_usual and zone.passes is None,
        )
        for zone in document.zones
    )
    return MissionOrder(
        zones or (Zone(EVERYTHING, None, *usual),),
        tuple(map(tuple, document.keep_out)),
        document.return_home,
        document.keep_covered,
        document.unknown,
        document.until_min,
    )
