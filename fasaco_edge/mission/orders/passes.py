"""Passes in documents of orders: a number of equal ones, or a list with one item for each."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from fasaco_edge.errors import BadConfiguration, OrderError
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


class PassDocument(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True
):
    """A pass of an order.

    Attributes:
        covers: all cells; `edge`, those along walls and furniture; after an `edge` the `rest`,
            all others.
        lanes: direction of the lanes: `auto`, as they are cheapest, along the cells' rows if the
            next pass crosses them; `cross`, across those of the pass before.
        angle_deg: angle of the lanes to the x axis of the map frame, in place of `lanes` [deg].
        overlap: share of the tool's width by which the lanes overlap, in place of the robot's.
        speed_m_s: speed of the robot, if less than its usual one [m/s].
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


def passes_of(document: Passes, where: str) -> tuple[int, tuple[Pass, ...]]:
    """Return the number of passes, and what is special about each; () if nothing is.

    Args:
        document: the passes.
        where: member of the order that has them.

    Raises:
        OrderError: they do not go together.
    """
    if isinstance(document, int):
        return document, ()
    passes = tuple(
        read_pass(item) if isinstance(item, str) else Pass(**msgspec.structs.asdict(item))
        for item in document
    )
    try:
        check_passes(passes, where)
    except BadConfiguration as error:
        raise OrderError(str(error)) from error
    return len(passes), () if all(each == Pass() for each in passes) else passes


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
    """Return passes as text that follows what they cover; "" for one without anything special."""
    number, passes = passes_of(document, "passes")
    if not passes:
        return f" {number} times" if number > 1 else ""
    return f" in passes: {', '.join(each.name or 'auto' for each in passes)}"
