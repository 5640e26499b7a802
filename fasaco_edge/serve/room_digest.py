"""The page's documents about rooms: outlines, settings, tints, labels and swept shares."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from fasaco_edge.grid.geometry import Bounds, Polygon
from fasaco_edge.grid.label_place import label_place
from fasaco_edge.serve.digest import MOST_CORNERS, Digest
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms

# Limit on the rooms shown.
MOST_ROOMS = 250
# Number of tints in the style sheet; distance up to which two rooms get different tints [m].
TINTS, NEAR_M = 6, 0.4


def rooms(found: Rooms) -> Digest:
    """Return the document of rooms: outlines, settings, tints, and places of labels.

    Swept shares have a document of their own, as they change while the robot drives.
    """
    shown = [each for each in found.outlined[:MOST_ROOMS] if len(each.outline) <= MOST_CORNERS]
    tints = _tints(shown)
    return {"rooms": [_room(each, tints[each.id]) for each in shown]}


def shares(found: Rooms) -> Digest:
    """Return the swept share of each room by its number; None if it has no floor to sweep."""
    share = {
        str(each.id): None if each.swept is None else round(each.swept, 2)
        for each in found.rooms[:MOST_ROOMS]
    }
    return {"swept": share}


def _room(room: RoomReport, tint: int) -> Digest:
    label = _label(room.outline)
    return {
        "id": room.id,
        "name": room.name,
        "title": room.title,
        "outline": [[round(x, 2), round(y, 2)] for x, y in room.outline],
        "neighbours": room.neighbours,
        "encloses": room.encloses,
        "m2": round(room.area_m2, 1),
        "passes": room.passes,
        "skip": room.skip,
        "priority": room.priority,
        "tint": tint,
        "label": label and [round(value, 2) for value in label],
    }


# The cache helps because most rooms stay unchanged.
_label = lru_cache(MOST_ROOMS)(label_place)


def _tints(found: Sequence[RoomReport]) -> dict[int, int]:
    """Return a tint for each room by its number; rooms near to each other differ if possible.

    Rooms are tinted in order of number, so that a new room does not change the tints of others.
    """
    bounds = {room.id: _bounds(room.outline) for room in found}
    tints: dict[int, int] = {}
    for room in sorted(found, key=lambda room: room.id):
        near = (other for other in tints if _are_near(bounds[room.id], bounds[other]))
        taken = {tints[other] for other in near}
        order = [(room.id - 1 + index) % TINTS for index in range(TINTS)]
        tints[room.id] = next((tint for tint in order if tint not in taken), order[0])
    return tints


def _bounds(outline: Polygon) -> Bounds:
    xs, ys = [x for x, _ in outline], [y for _, y in outline]
    return min(xs), min(ys), max(xs), max(ys)


def _are_near(one: Bounds, other: Bounds) -> bool:
    return all(
        one[axis] < other[axis + 2] + NEAR_M and other[axis] < one[axis + 2] + NEAR_M
        for axis in (0, 1)
    )
