"""GeoJSON of rooms, lines and orders, for drawing programs and geographic information systems.

Coordinates are (x, y) [m] in the frame of the map, not the degrees of RFC 7946: writer and reader
have to agree on that. Polygons are closed, their outlines counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TypeGuard

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import Point
from fasaco_edge.text import nearest
from fasaco_edge.wire.documents.rooms import Rooms

SUFFIX = ".geojson"
HINT = "draw each zone as a Polygon; `rooms list --geojson` shows what one looks like"
# Properties of a feature that become members of a zone.
OF_ZONES = ("name", "passes", "room", "priority")
# Members of the collection that become members of an order.
OF_ORDERS = ("passes", "return_home", "keep_covered", "unknown", "until_min")
# Other known properties of a feature, and other known members of a collection.
OF_FEATURES, OF_COLLECTIONS = ("keep_out", "skip"), ("type", "features", "name", "crs", "bbox")
# Least similarity of an unknown member to a known one that counts as a misspelling.
ALIKE = 0.8

Feature = dict[str, object]


def lines_collection(
    lines: Iterable[tuple[Sequence[Sequence[float]], dict[str, object]]],
) -> dict[str, object]:
    """Return lines through points (x, y) [m], each with its properties, as a collection."""
    features = [
        _feature("LineString", [list(point[:2]) for point in points], properties)
        for points, properties in lines
    ]
    return {"type": "FeatureCollection", "features": features}


def rooms_collection(rooms: Rooms) -> dict[str, object]:
    """Return the rooms as polygons, whose holes are the rooms that they enclose."""
    outlined = {room.id: room for room in rooms.outlined}
    features = []
    for room in outlined.values():
        holes = [outlined[each].outline for each in room.encloses if each in outlined]
        rings = [_ring(room.outline), *(_ring(hole)[::-1] for hole in holes)]
        properties = {
            "room": room.id,
            "name": room.title,
            "area_m2": room.area_m2,
            "swept": room.swept,
            "skip": room.skip,
        }
        features.append(_feature("Polygon", rings, properties))
    return {"type": "FeatureCollection", "frame": rooms.frame, "features": features}


def _feature(kind: str, coordinates: object, properties: dict[str, object]) -> Feature:
    """Return a feature of one geometry."""
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _ring(outline: Sequence[Point]) -> list[list[float]]:
    """Return a closed, counter-clockwise ring."""
    ring = [list(point) for point in outline]
    ring.append(ring[0])
    twice = sum(ax * by - bx * ay for (ax, ay), (bx, by) in pairwise(ring))
    return ring if twice >= 0 else ring[::-1]


def is_geojson(document: object) -> TypeGuard[dict[str, object]]:
    """Return whether a document is GeoJSON: an order has no member ``type``."""
    return isinstance(document, dict) and "type" in document


def order_of(document: dict[str, object]) -> tuple[dict[str, object], dict[str, str]]:
    """Return the order in a collection of polygons, and the feature of each zone and keep-out.

    A polygon is a zone, whose members are its properties ``OF_ZONES``; with ``"keep_out": true`` it
    is a keep-out. A feature with the number of a room orders that room, whatever its outline. With
    ``"skip": true`` a feature is ignored. The members ``OF_ORDERS`` of the collection are those of
    the order.

    Raises:
        OrderError: there is no feature, a feature is no polygon or has holes, or a property is
            probably misspelt.
    """
    zones: list[dict[str, object]] = []
    keep_out: list[object] = []
    origins: dict[str, str] = {}
    features = document.get("features")
    _check_spelling(document, OF_ORDERS, "the collection")
    if (kind := document["type"]) != "FeatureCollection":
        raise OrderError(f"type: must be FeatureCollection, got {kind!r:.80}", hint=HINT)
    if not isinstance(features, list) or not features:
        raise OrderError("features: there is none", hint=HINT)
    for number, each in enumerate(features):
        where, members = f"features[{number}]", each if isinstance(each, dict) else {}
        properties = members.get("properties") or {}
        if not isinstance(properties, dict):
            raise OrderError(f"{where}: properties must be an object", hint=HINT)
        name = properties.get("name") or members.get("id")
        where += "" if name is None else f" {name!r:.80}"
        geometry = members.get("geometry")
        if _is_set(properties, "keep_out", where):
            origins[f"keep_out[{len(keep_out)}]"] = where
            keep_out.append(_corners(geometry, where))
        elif not _is_set(properties, "skip", where):
            own = {name: properties[name] for name in OF_ZONES if properties.get(name) is not None}
            named = {"name": f"zone {number + 1}"} | own
            placed = {} if "room" in own else {"polygon": _corners(geometry, where)}
            origins[f"zones[{len(zones)}]"] = where
            zones.append(named | placed)
        _check_spelling(properties, (*OF_ZONES, *OF_FEATURES), where)
    order = {name: document[name] for name in OF_ORDERS if name in document}
    return order | {"zones": zones, "keep_out": keep_out}, origins


def _check_spelling(members: dict[str, object], known: Sequence[str], where: str) -> None:
    """Check that no member is a misspelling; other unknown members may come from any program."""
    for name in (each for each in members if each not in (*known, *OF_COLLECTIONS)):
        if near := nearest(name, known, ALIKE):
            raise OrderError(f"{where}: unknown member {name}; did you mean {near[0]}?", hint=HINT)


def _is_set(properties: dict[str, object], name: str, where: str) -> bool:
    """Return a boolean property; False if it is missing."""
    value = properties.get(name)
    if value is not None and not isinstance(value, bool):
        raise OrderError(f"{where}: {name}: must be true or false, is {value!r}", hint=HINT)
    return bool(value)


def _corners(geometry: object, where: str) -> list[object]:
    """Return the corners of a polygon without holes."""
    members = geometry if isinstance(geometry, dict) else {}
    rings, kind = members.get("coordinates"), members.get("type")
    if kind != "Polygon" or not isinstance(rings, list) or not rings:
        raise OrderError(f"{where}: must be a Polygon, is {kind or 'none'}", hint=HINT)
    if len(rings) > 1:
        raise OrderError(
            f"{where}: the polygon must have one ring, got {len(rings)}: rings after the first are "
            "holes in it, and an order takes no holes",
            hint="delete the holes; to keep the robot out of one, draw it as a Polygon of its own, "
            'with the property "keep_out": true',
        )
    ring = rings[0]
    if not isinstance(ring, list) or len(ring) < 2 or ring[0] != ring[-1]:
        raise OrderError(f"{where}: the last corner must be the first again", hint=HINT)
    # Drawing programs add a height.
    return [corner[:2] if isinstance(corner, list) else corner for corner in ring[:-1]]
