"""GeoJSON of rooms, lines and orders, for drawing programs, and the reader of files of orders.

Coordinates are (x, y) [m] in the frame of the map, not the degrees of RFC 7946: writer and reader
have to agree on that. Polygons are closed, their outlines counter-clockwise.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeGuard

from msgspec import UNSET, Meta, structs

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import Point
from fasaco_edge.host.documents import StrictDocument, inspected
from fasaco_edge.host.plain_yaml import read_written
from fasaco_edge.mission.orders.order import MissionOrder, OrderDocument, order_of
from fasaco_edge.wire.documents.rooms import Rooms

SUFFIX = ".geojson"
HINT = (
    "draw each zone as a Polygon, in metres in the frame of the map; `rooms list --geojson` shows "
    "what one looks like"
)
Members = dict[str, object]


def read_order_file(path: Path) -> MissionOrder:
    """Return the order in a YAML, JSON or GeoJSON file.

    Raises:
        OrderError: the file cannot be read, or the order is invalid. It is the first fault, and
            holds the others as ``rest``, each with file and line.
    """
    # JSON is not read as YAML 1.1, in which 1e3 is a text.
    parse = json.loads if path.suffix in (".json", SUFFIX) else None
    text = read_written(path, OrderError, missing="name a file that can be read", parse=parse)
    if text.values is None:
        # It may be the rest of a file that was not written in full.
        hint = 'write what to cover; for everything, `passes: 1` (in JSON {"passes": 1})'
        text.check([OrderError("there is no order in it", hint=hint)])
    if is_geojson(text.values):
        order, faults = drawn_order(text.values)
    else:
        order, faults = inspected(OrderDocument, text.values, OrderError)
    text.check(faults)
    return order_of(order)


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


class _Drawn(StrictDocument, frozen=True):
    """An object of GeoJSON, which may have members of other programs."""

    is_open: ClassVar[bool] = True


class _Polygon(_Drawn, frozen=True):
    coordinates: Annotated[list[Annotated[list[Any], Meta(min_length=4)]], Meta(min_length=1)]

    def faults(self) -> Iterator[OrderError]:
        rings = self.coordinates or []
        if len(rings) > 1:
            yield OrderError(
                f"the polygon must have one ring, got {len(rings)}: rings after the first are "
                "holes in it, and an order takes no holes",
                hint="delete the holes; to keep the robot out of one, draw it as a Polygon of its "
                'own, with the property "keep_out": true',
                key="coordinates",
            )
        if rings and rings[0] and rings[0][0] != rings[0][-1]:
            text = "the last corner must equal the first"
            yield OrderError(text, key="coordinates[0]")

    @property
    def corners(self) -> list[Any]:
        """Its corners (x, y) [m], without the height that drawing programs add."""
        ring = self.coordinates[0][:-1] if self.coordinates else []
        return [corner[:2] if isinstance(corner, list) else corner for corner in ring]


class _Properties(_Drawn, frozen=True):
    """Properties of a feature: a zone's, which ``OrderDocument`` checks, keep_out and skip."""

    name: Any = None
    passes: Any = None
    room: Any = None
    priority: Any = None
    keep_out: bool | None = None
    skip: bool | None = None


class _Feature(_Drawn, frozen=True):
    geometry: Any = None
    properties: _Properties | None = None
    id: Any = None

    @property
    def known(self) -> _Properties:
        return self.properties or _Properties()

    def polygon(self) -> tuple[_Polygon, list[OrderError]]:
        """Return its outline and the outline's faults; both empty if no outline is needed."""
        known = self.known
        if not known.keep_out and (known.skip or known.room is not None):
            return _Polygon(coordinates=[]), []
        kind = self.geometry.get("type") if isinstance(self.geometry, dict) else None
        if kind != "Polygon":
            return _Polygon(coordinates=[]), [OrderError(f"must be a Polygon, is {kind or 'none'}")]
        return inspected(_Polygon, self.geometry, OrderError)

    def faults(self) -> Iterator[OrderError]:
        for fault in self.polygon()[1]:
            yield fault.within("geometry", OrderError)


class _Collection(_Drawn, frozen=True):
    """Features, and members of an order; ``OrderDocument`` checks the members."""

    type: Literal["FeatureCollection"]
    features: Annotated[list[_Feature], Meta(min_length=1)]
    passes: Any = UNSET
    return_home: Any = UNSET
    keep_covered: Any = UNSET
    unknown: Any = UNSET
    until_min: Any = UNSET


ORDER_MEMBERS = _Collection.__struct_fields__[2:]


def drawn_order(document: Members) -> tuple[OrderDocument, list[OrderError]]:
    """Return the order in a collection of polygons, and all faults with keys in the collection.

    A polygon is a zone, whose members are its properties; with ``"keep_out": true`` it is a
    keep-out. A feature with the number of a room orders that room, whatever its outline. With
    ``"skip": true`` a feature is ignored.
    """
    zones: list[Members] = []
    keep_out: list[list[Any]] = []
    # The feature of each zone and keep-out, and the name of each feature.
    origins: dict[str, str] = {}
    names: dict[str, object] = {}
    drawn, faults = inspected(_Collection, document, OrderError)
    for index, feature in enumerate(drawn.features or ()):
        if not feature:
            continue
        key, known, (polygon, flaws) = f"features[{index}]", feature.known, feature.polygon()
        names[key] = known.name or feature.id
        corners = None if flaws else polygon.corners or None
        if known.keep_out and corners:
            origins[f"keep_out[{len(keep_out)}]"] = key
            keep_out.append(corners)
        elif not known.keep_out and not known.skip:
            members = structs.asdict(known) | {"polygon": corners}
            del members["keep_out"], members["skip"]
            own = {name: value for name, value in members.items() if value is not None}
            origins[f"zones[{len(zones)}]"] = key
            zones.append({"name": f"zone {index + 1}"} | own)
    given = structs.asdict(drawn).items()
    order = {name: value for name, value in given if name in ORDER_MEMBERS and value is not UNSET}
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
        # Name the feature: line numbers do not help if the file is one line.
        if name := names.get(fault.key[: fault.key.find("]") + 1]):
            fault.what += f" (feature {name!r:.80})"
        if fault.hint == OrderError.hint:
            fault.advise(HINT)
    return read, faults
