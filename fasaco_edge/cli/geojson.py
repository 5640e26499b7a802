"""GeoJSON of rooms, lines and orders, for drawing programs and geographic information systems.

Coordinates are (x, y) [m] in the frame of the map, not the degrees of RFC 7946: writer and reader
have to agree on that. Polygons are closed, their outlines counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import TypeGuard

from fasaco_edge.errors import OrderError, joined
from fasaco_edge.grid.geometry import Point
from fasaco_edge.host.documents import inspected
from fasaco_edge.mission.orders.order import OrderDocument
from fasaco_edge.text import nearest, shown
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

Members = dict[str, object]


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


def _feature(kind: str, coordinates: object, properties: dict[str, object]) -> Members:
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


def drawn_order(document: dict[str, object]) -> tuple[OrderDocument, list[OrderError]]:
    """Return the order in a collection of polygons, and all faults, with keys of the collection.

    A polygon is a zone, whose members are its properties ``OF_ZONES``; with ``"keep_out": true`` it
    is a keep-out. A feature with the number of a room orders that room, whatever its outline. With
    ``"skip": true`` a feature is ignored. The members ``OF_ORDERS`` of the collection are those of
    the order.
    """
    zones: list[dict[str, object]] = []
    keep_out: list[object] = []
    # The feature of each zone and keep-out, and the name of each feature.
    origins: dict[str, str] = {}
    names: dict[str, object] = {}
    faults = list(_misspelt(document, OF_ORDERS))
    features = document.get("features")
    if (kind := document["type"]) != "FeatureCollection":
        faults.append(OrderError(f"must be FeatureCollection, got {shown(kind)}", key="type"))
    elif not isinstance(features, list) or not features:
        faults.append(OrderError("there is none", key="features"))
    for index, each in enumerate(features if isinstance(features, list) else ()):
        key, members = f"features[{index}]", each if isinstance(each, dict) else {}
        properties = members.get("properties") or {}
        if not isinstance(properties, dict):
            faults.append(OrderError("expected object", key=f"{key}.properties"))
            continue
        faults += _misspelt(properties, (*OF_ZONES, *OF_FEATURES), f"{key}.properties")
        faults += _flags(properties, f"{key}.properties")
        names[key] = properties.get("name") or members.get("id")
        is_kept_out = properties.get("keep_out") is True
        if properties.get("skip") is True and not is_kept_out:
            continue
        own = {name: properties[name] for name in OF_ZONES if properties.get(name) is not None}
        corners = None
        if is_kept_out or "room" not in own:
            corners = _corners(members.get("geometry"), f"{key}.geometry", faults)
        if not is_kept_out:
            origins[f"zones[{len(zones)}]"] = key
            zones.append({"name": f"zone {index + 1}", "polygon": corners} | own)
        elif corners is not None:
            origins[f"keep_out[{len(keep_out)}]"] = key
            keep_out.append(corners)
    order = {name: document[name] for name in OF_ORDERS if name in document}
    read, found = inspected(
        OrderDocument, order | {"zones": zones, "keep_out": keep_out}, OrderError
    )
    for fault in found:
        place = fault.key[: fault.key.find("]") + 1]
        if place in origins:
            rest = fault.key.removeprefix(place)
            is_corner = place.startswith("keep_out") or rest.startswith(".polygon")
            part = ".geometry.coordinates[0]" if is_corner else ".properties"
            fault.key = f"{origins[place]}{part}{rest.removeprefix('.polygon')}"
    for fault in (faults := faults + found):
        # A file may be one line, so that its number says nothing.
        if name := names.get(fault.key[: fault.key.find("]") + 1]):
            fault.what += f" (feature {name!r:.80})"
        fault.hint = HINT if fault.hint == OrderError.hint else fault.hint
    return read, faults


def _misspelt(members: Members, known: Sequence[str], key: str = "") -> Iterator[OrderError]:
    """Yield members that are probably misspelt; other unknown ones may come from any program."""
    for name in (each for each in members if each not in (*known, *OF_COLLECTIONS)):
        if near := nearest(name, known, ALIKE):
            text = f"unknown key; did you mean {joined(key, near[0])}?"
            yield OrderError(text, key=joined(key, name))


def _flags(properties: Members, key: str) -> Iterator[OrderError]:
    for name in OF_FEATURES:
        if properties.get(name) not in (None, True, False):
            text = f"must be true or false, got {shown(properties[name])}"
            yield OrderError(text, key=f"{key}.{name}")


def _corners(geometry: object, key: str, faults: list[OrderError]) -> list[object] | None:
    """Return the corners of a polygon without holes; None, and a fault, for another geometry."""
    members = geometry if isinstance(geometry, dict) else {}
    rings, kind = members.get("coordinates"), members.get("type")
    rings = rings if isinstance(rings, list) else []
    hint, place = HINT, f"{key}.coordinates"
    if kind != "Polygon" or not rings:
        text, place = f"must be a Polygon, got {shown(kind or geometry)}", key
    elif len(rings) > 1:
        text = (
            f"the polygon must have one ring, got {len(rings)}: rings after the first are holes "
            "in it, and an order takes no holes"
        )
        hint = (
            "delete the holes; to keep the robot out of one, draw it as a Polygon of its own, "
            'with the property "keep_out": true'
        )
    elif not isinstance(ring := rings[0], list) or len(ring) < 2 or ring[0] != ring[-1]:
        text, place = "the last corner must be the first again", f"{place}[0]"
    else:
        # Drawing programs add a height.
        return [corner[:2] if isinstance(corner, list) else corner for corner in ring[:-1]]
    faults.append(OrderError(text, hint=hint, key=place))
    return None
