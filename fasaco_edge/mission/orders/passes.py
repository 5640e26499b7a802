"""Passes in order documents: the number of equal passes, or a list with an item for each pass."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from fasaco_edge.errors import BadConfiguration, OrderError
from fasaco_edge.host.documents import StrictDocument
from fasaco_edge.planners.passes import (
    MOST_ANGLE_DEG,
    MOST_OVERLAP,
    MOST_PASSES,
    Covers,
    Direction,
    Pass,
    check_passes,
    read_pass,
)


class PassDocument(StrictDocument, frozen=True, omit_defaults=True):
    """A pass of an order.

    Attributes:
        covers: `all` cells; `edge`, cells along walls and furniture; `rest`, after an `edge` pass,
            all other cells.
        lanes: direction of the lanes: `auto` is the cheapest one, but along the cells' rows if the
            next pass is `cross`; `cross` is across the lanes of the pass before.
        angle_deg: angle of the lanes to the x axis of the map frame, in place of `lanes` [deg].
        overlap: share of the tool's width by which lanes overlap, in place of the configured one.
        speed_m_s: speed of the robot, below its usual speed [m/s].
    """

    covers: Covers = "all"
    lanes: Direction = "auto"
    angle_deg: Annotated[float, Meta(ge=-MOST_ANGLE_DEG, le=MOST_ANGLE_DEG)] | None = None
    speed_m_s: Annotated[float, Meta(gt=0, le=10)] | None = None
    overlap: Annotated[float, Meta(ge=0, le=MOST_OVERLAP)] | None = None


PassWord = Literal["auto", "cross", "edge", "rest"]
Passes = (
    Annotated[int, Meta(ge=1, le=MOST_PASSES, description="how often to cover")]
    | Annotated[
        list[PassWord | PassDocument],
        Meta(min_length=1, max_length=MOST_PASSES, description="what each pass is like"),
    ]
)


def passes_of(document: Passes) -> tuple[int, tuple[Pass, ...]]:
    """Return the number of passes, and the settings of each; () if all have the defaults."""
    if isinstance(document, int):
        return document, ()
    passes = _passes(document)
    return len(passes), () if all(each == Pass() for each in passes) else passes


def _passes(document: list[PassWord | PassDocument]) -> tuple[Pass, ...]:
    return tuple(
        read_pass(item) if isinstance(item, str) else Pass(**msgspec.structs.asdict(item))
        for item in document
    )


def passes_faults(document: Passes | None, key: str = "passes") -> Iterator[OrderError]:
    """Yield why passes cannot follow each other."""
    if isinstance(document, list) and all(document):
        try:
            check_passes(_passes(document), key)
        except BadConfiguration as error:
            yield error.within("", OrderError)


def passes_document(number: int, passes: tuple[Pass, ...]) -> int | list[object]:
    """Return the document of passes; ``passes_of`` reads it."""
    return [_item(each) for each in passes] or number


_USUAL = Pass()


def _item(each: Pass) -> object:
    members = {
        name: value
        for name in PassDocument.__struct_fields__
        if (value := getattr(each, name)) != getattr(_USUAL, name)
    }
    if len(members) > 1 or members.keys() & {"angle_deg", "overlap", "speed_m_s"}:
        return members
    return next(iter(members.values()), "auto")


def passes_words(document: Passes) -> str:
    """Return the words for passes, to follow a zone's name; "" for a single default pass."""
    number, passes = passes_of(document)
    if not passes:
        return f" {number} times" if number > 1 else ""
    return f" in passes: {', '.join(each.name or 'auto' for each in passes)}"
