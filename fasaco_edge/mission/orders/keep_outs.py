"""Keep-outs of the operator: named areas that apply to every order until they are removed.

They are part of the order's state, so they are kept with the ledger. Keep-outs of an order end with
the order.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from fasaco_edge.errors import OrderError
from fasaco_edge.grid.geometry import FARTHEST_M, Polygon
from fasaco_edge.grid.polygons import polygon_flaw
from fasaco_edge.host.documents import StrictDocument

# Limits on the places of an order, which is part of the ledger: this is written once a second.
MOST_KEEP_OUT = 100
MOST_POINTS = 1_000
MOST_POINTS_IN_ALL = 5_000
LONGEST_NAME = 64

Corners = Annotated[
    list[Annotated[tuple[float, float], Meta(description="x, y [m] in the map frame")]],
    Meta(min_length=3, max_length=MOST_POINTS, description="corners; the last joins the first"),
]
PlaceName = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]


class KeepOutDocument(StrictDocument, frozen=True):
    """A keep-out of the operator; a request to remove it has no polygon."""

    name: PlaceName
    polygon: Corners | None = None

    def faults(self) -> Iterator[OrderError]:
        yield from name_faults(self.name)
        yield from polygon_faults({"polygon": tuple(self.polygon)} if self.polygon else {})


@dataclass(frozen=True, slots=True)
class KeepOut:
    """An area that the robot must not touch.

    Attributes:
        name: unique among the operator's keep-outs.
        polygon: corners (x, y) [m] in the map frame, on any lattice; () in a request to remove it.
    """

    name: str
    polygon: Polygon = ()


KeepOuts = tuple[KeepOut, ...]


def keep_out_of(document: KeepOutDocument) -> KeepOut:
    """Return the keep-out in a document."""
    return KeepOut(document.name, tuple(document.polygon or ()))


def keep_out_document(keep_out: KeepOut) -> dict[str, object]:
    """Return the document of a keep-out; ``keep_out_of`` reads it."""
    named: dict[str, object] = {"name": keep_out.name}
    return named | ({"polygon": keep_out.polygon} if keep_out.polygon else {})


def added(keep_outs: KeepOuts, new: KeepOut) -> KeepOuts:
    """Return keep-outs with ``new`` added; unchanged if they contain it.

    Raises:
        OrderError: another keep-out has its name, or there are too many keep-outs or corners.
    """
    if new in keep_outs:
        return keep_outs
    if any(new.name == known.name for known in keep_outs):
        raise OrderError(
            f"there is a keep-out {new.name!r} already, with other corners",
            key="keep_out.name",
            hint="give it another name, or remove that one first",
        )
    together = (*keep_outs, new)
    if len(together) > MOST_KEEP_OUT:
        raise OrderError(
            f"there are {MOST_KEEP_OUT} keep-outs already", hint="remove one of them first"
        )
    points = sum(len(known.polygon) for known in together)
    if points > MOST_POINTS_IN_ALL:
        raise OrderError(
            f"keep-outs must have at most {MOST_POINTS_IN_ALL} corners in all, got {points}",
            hint="draw it with fewer corners, or remove another one first",
        )
    return together


def removed(keep_outs: KeepOuts, unwanted: KeepOut) -> KeepOuts:
    """Return keep-outs without the keep-out that has the name of ``unwanted``.

    Raises:
        OrderError: there is no keep-out of this name.
    """
    rest = tuple(known for known in keep_outs if known.name != unwanted.name)
    if rest == keep_outs:
        names = ", ".join(repr(known.name) for known in keep_outs)
        there = f"there are {names:.400}" if names else "there are none"
        raise OrderError(
            f"no keep-out {unwanted.name!r} was added; {there}",
            key="keep_out.name",
            hint="name one of those; keep-outs of an order end with it, and those of the "
            "configuration are changed there",
        )
    return rest


def name_faults(name: str, key: str = "name") -> Iterator[OrderError]:
    """Yield the fault of a place's name that is not printable, or has a space at an end."""
    if name and not (name.isprintable() and name.strip() == name):
        text = f"must be 1..{LONGEST_NAME} printable characters, got {name!r:.80}"
        yield OrderError(text, key=key)


def polygon_faults(polygons: Mapping[str, Polygon]) -> Iterator[OrderError]:
    """Yield the first fault of each polygon, or one fault if they have too many points in all."""
    points = sum(map(len, polygons.values()))
    if points > MOST_POINTS_IN_ALL:
        text = f"polygons must have at most {MOST_POINTS_IN_ALL} points, got {points}"
        yield OrderError(text, others=list(polygons))
        return
    for key, polygon in polygons.items():
        # A negated comparison, so that NaN is caught too.
        far = (at for at, (x, y) in enumerate(polygon) if not math.hypot(x, y) <= FARTHEST_M)
        if (index := next(far, None)) is not None:
            text = f"must be finite and within {FARTHEST_M:g} m of 0, got {polygon[index]}"
            yield OrderError(text, key=f"{key}[{index}]")
        elif why := polygon_flaw(polygon):
            yield OrderError(why, key=key)
