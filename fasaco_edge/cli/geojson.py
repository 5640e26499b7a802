"""GeoJSON of rooms, lines and orders, for drawing programs and geographic information systems.

Coordinates are metres in the frame of the map, x before y, not the degrees of RFC 7946: that is
agreed between who writes and who reads. Polygons are closed, and their outlines run
counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TypeGuard

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import Point
from fasaco_edge.wire.documents.rooms import Rooms

SUFFIX = ".geojson"
HINT = "draw each zone as a Polygon; `rooms list --geojson` shows what one looks like"
# Properties of a feature that are members of a zone.
OF_ZONES = ("name", "passes", "room")
# Members of the collection that are members of an order.
OF_ORDERS = ("passes", "return_home", "keep_covered", "unknown")

Feature = dict[str, object]


def collection(frame: str, features: Iterable[Feature]) -> dict[str, object]:
    """Return a document of features in a frame."""
    return {"type": "FeatureCollection", "frame": frame, "features": list(features)}


def rooms_collection(rooms: Rooms) -> dict[str, object]:
    """Return the rooms as polygons: outlines, with the rooms that they enclose as holes."""
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
        features.append(feature("Polygon", rings, properties))
    return collection(rooms.frame, features)


def line_feature(points: Sequence[Sequence[float]], properties: dict[str, object]) -> Feature:
    """Return a line through points (x, y) [m]."""
    return feature("LineString", [list(point) for point in points], properties)


def feature(kind: str, coordinates: object, properties: dict[str, object]) -> Feature:
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
    """Return whether a document is a collection of features."""
    return isinstance(document, dict) and document.get("type") == "FeatureCollection"


def order_of(document: dict[str, object]) -> dict[str, object]:
    """Return the order that a collection of polygons stands for.

    A polygon is a zone, with ``name`` and ``passes`` of its properties; with ``"keep_out": true``
    it is one that the robot must not touch. A room is ordered by its number. ``passes``,
    ``return_home``, ``keep_covered`` and ``unknown`` of the collection are those of the order.

    Raises:
        OrderError: a feature is no polygon without holes.
    """
    zones: list[dict[str, object]] = []
    keep_out: list[object] = []
    features = document.get("features")
    for number, each in enumerate(features if isinstance(features, list) else ()):
        where, members = f"features[{number}]", each if isinstance(each, dict) else {}
        properties = members.get("properties") or {}
        if not isinstance(properties, dict):
            raise OrderError(f"{where}: properties must be an object", hint=HINT)
        own = {name: properties[name] for name in OF_ZONES if properties.get(name) is not None}
        named = {"name": f"zone {number + 1}"} | own
        if "room" in own:
            zones.append(named)
        elif properties.get("keep_out") is True:
            keep_out.append(_corners(members.get("geometry"), where))
        else:
            zones.append(named | {"polygon": _corners(members.get("geometry"), where)})
    order = {name: document[name] for name in OF_ORDERS if name in document}
    return order | {"zones": zones, "keep_out": keep_out}


def _corners(geometry: object, where: str) -> list[object]:
    """Return the corners of a polygon."""
    members = geometry if isinstance(geometry, dict) else {}
    rings, kind = members.get("coordinates"), members.get("type")
    if kind != "Polygon" or not isinstance(rings, list) or not rings:
        raise OrderError(f"{where}: must be a Polygon, is {kind or 'none'}", hint=HINT)
    if len(rings) > 1:
        hint = 'draw the hole as a polygon of its own, with the property "keep_out": true'
        raise OrderError(f"{where}: a zone has no holes, this one has {len(rings) - 1}", hint=hint)
    ring = rings[0]
    if not isinstance(ring, list) or len(ring) < 2 or ring[0] != ring[-1]:
        raise OrderError(f"{where}: the last corner must be the first again", hint=HINT)
    return ring[:-1]
