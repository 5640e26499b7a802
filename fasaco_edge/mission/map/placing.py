"""Placing of orders: zones given by name get the polygons of configured zones, or of rooms.

Polygons are in the map frame, except in ``rotated_order``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import Polygon
from fasaco_edge.grid.rotation import rotated_polygon
from fasaco_edge.mission.orders.order import ConfiguredZone, MissionOrder, RoomArea, Zone
from fasaco_edge.mission.orders.room_requests import USUAL_PRIORITY
from fasaco_edge.mission.rooms.room_book import LIKE_NUMBER, Room, RoomBook


def is_named(order: MissionOrder) -> bool:
    """Return whether an order has zones that are given by name alone."""
    return any(zone.polygon == () for zone in order.zones)


def located(
    order: MissionOrder, configured: tuple[ConfiguredZone, ...], book: RoomBook
) -> MissionOrder:
    """Return an order with its named zones in place: configured zones first, then rooms.

    Raises:
        OrderError: a name is unknown, and the order does not wait for a room; or no room has the
            number. An order never waits for a number, as any new room may get it.
    """
    known = {zone.name: tuple(zone.polygon) for zone in configured}
    may_wait = order.unknown == "wait"
    zones = (
        _looked_up(zone, index, known, book, may_wait=may_wait)
        for index, zone in enumerate(order.zones)
    )
    return placed(replace(order, zones=tuple(zones)), book)


def _looked_up(
    zone: Zone, index: int, configured: dict[str, Polygon], book: RoomBook, *, may_wait: bool
) -> Zone:
    """Return a zone with its polygon or its room's number; unchanged if it waits for a room."""
    if not zone.room and zone.polygon != ():
        return zone
    if not zone.room and zone.name in configured:
        return replace(zone, polygon=configured[zone.name])
    room = book.find(zone.room or zone.name)
    if room is not None and (room.outline or zone.polygon or may_wait):
        return replace(zone, room=room.id)
    is_by_number = zone.room or LIKE_NUMBER.fullmatch(zone.name)
    if room is None and may_wait and not is_by_number:
        return zone
    if zone.room:
        raise OrderError(
            f"there is no room {zone.room} on the map; {book.listed()}",
            hint="give the number of one of those, or none",
            key=f"zones[{index}].room",
        )
    there = f"there are {', '.join(configured)}" if configured else "it has none"
    raise OrderError(
        f"no zone {zone.name!r} in mission.zones of the daemon's "
        f"configuration; {there}; nor a room: {book.listed()}",
        hint="name one of those, or give the zone a polygon; with `unknown: wait` the order "
        "waits for a room of that name, but of no number",
        key=f"zones[{index}].name",
    )


def restored(order: MissionOrder, book: RoomBook) -> MissionOrder:
    """Return an order from before a restart, without the rooms that the book has lost.

    Zones of lost rooms keep their polygons, and no other room gets the numbers of lost rooms.
    """
    lost = {zone.room for zone in order.as_given.zones if zone.room >= book.next_id}
    if not lost:
        return order
    book.pass_over(max(lost))
    zones = (replace(zone, room=0) if zone.room in lost else zone for zone in order.as_given.zones)
    return replace(order.as_given, zones=tuple(zones))


def placed(order: MissionOrder, book: RoomBook, begun: int = -1) -> MissionOrder:
    """Return an order with its rooms' present outlines; the same object if nothing has changed.

    Zones that wait for a room come last.

    Args:
        order: the order.
        book: the rooms.
        begun: index of the zone being covered; zones up to this one keep their sequence.
    """
    rooms = [room for room in book.rooms if room.outline]
    skipped = tuple(_area(room, book) for room in rooms if room.settings.skip)
    ranked = tuple(_area(room, book) for room in rooms if room.settings.priority != USUAL_PRIORITY)
    zones = [_placed(zone, book, skipped, ranked) for zone in order.zones]
    zones[begun + 1 :] = sorted(zones[begun + 1 :], key=lambda zone: zone.polygon == ())
    is_same = all(here is there for here, there in zip(zones, order.zones, strict=True))
    return order if is_same else replace(order, zones=tuple(zones))


def _area(room: Room, book: RoomBook) -> RoomArea:
    return RoomArea(room.title, room.outline, book.holes(room), room.settings.priority)


def _placed(
    zone: Zone, book: RoomBook, skipped: tuple[RoomArea, ...], ranked: tuple[RoomArea, ...]
) -> Zone:
    if zone.polygon is None:
        is_same = (zone.without, zone.ranked) == (skipped, ranked)
        return zone if is_same else replace(zone, without=skipped, ranked=ranked)
    room = _room_of(zone, book) if zone.room or zone.polygon == () else None
    if room is None:
        return zone
    holes = book.holes(room)
    if (zone.room, zone.polygon, zone.holes) == (room.id, room.outline, holes):
        return zone
    priority = zone.priority
    if priority is None and room.settings.priority != USUAL_PRIORITY:
        priority = room.settings.priority
    zone = replace(zone, room=room.id, polygon=room.outline, holes=holes, priority=priority)
    if zone.is_as_usual and room.settings.passes is not None:
        return replace(
            zone, passes=room.settings.passes, kinds=room.settings.kinds, is_as_usual=False
        )
    return replace(zone, is_as_usual=False)


def _room_of(zone: Zone, book: RoomBook) -> Room | None:
    """Return the room of a zone; None if it is unknown, or has no outline."""
    room = book.find(zone.room or zone.name)
    return room if room is not None and room.outline else None


def are_same(one: MissionOrder, other: MissionOrder) -> bool:
    """Return whether two orders ask for the same, regardless of room outlines and priorities."""
    # Zones with different priorities may have been sorted since.
    is_ranked = any(len({zone.worth for zone in order.zones}) > 1 for order in (one, other))
    first, second = (_unplaced(order, is_ranked=is_ranked) for order in (one, other))
    return first == second


def _unplaced(order: MissionOrder, *, is_ranked: bool) -> MissionOrder:
    zones = [
        replace(zone, polygon=(), holes=(), priority=None)
        if zone.room
        else replace(zone, without=(), ranked=(), priority=None)
        for zone in order.zones
    ]
    if is_ranked:
        zones.sort(key=lambda zone: zone.name)
    return replace(order, zones=tuple(zones), keep_covered=False)


def left_out(zones: Iterable[Zone]) -> tuple[str, ...]:
    """Return the titles of the rooms that zones leave out."""
    return tuple(room.title for zone in zones for room in zone.without)


def rotated_order(order: MissionOrder, by_deg: float) -> MissionOrder:
    """Return an order with its polygons rotated by ``by_deg`` [deg]."""
    given = order.as_given
    if not by_deg:
        return given
    zones = tuple(_rotated(zone, by_deg) for zone in given.zones)
    keep_out = tuple(rotated_polygon(polygon, by_deg) for polygon in given.keep_out)
    return replace(given, zones=zones, keep_out=keep_out, given=given)


def _rotated(zone: Zone, by_deg: float) -> Zone:
    if not zone.polygon and not zone.without and not zone.ranked:
        return zone

    def rotated(polygons: Iterable[Polygon]) -> tuple[Polygon, ...]:
        return tuple(rotated_polygon(polygon, by_deg) for polygon in polygons)

    without, ranked = (
        tuple(
            room._replace(outline=rotated_polygon(room.outline, by_deg), holes=rotated(room.holes))
            for room in rooms
        )
        for rooms in (zone.without, zone.ranked)
    )
    polygon = rotated_polygon(zone.polygon, by_deg) if zone.polygon else zone.polygon
    holes = rotated(zone.holes)
    return replace(zone, polygon=polygon, holes=holes, without=without, ranked=ranked)
