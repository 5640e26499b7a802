"""The verdicts of a review: a text for each order on whether it was completed."""

from __future__ import annotations

from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.review.comparison import floor_words
from fasaco_edge.review.document import ReviewDocument
from fasaco_edge.review.orders import ordered_words


def verdicts(document: ReviewDocument) -> list[tuple[bool | None, str]]:
    """Return whether each order was completed (None if unknown), and a text on it."""
    orders = document.orders
    if len(orders) < 2:
        return [(document.complete, _ending(document))]
    found: list[tuple[bool | None, str]] = []
    for number, order in enumerate(orders, 1):
        span = f"{clock(order.at_s)} to {clock(order.until_s)}"
        who = "ordered" if order.ordered == "command" else "begun by itself"
        ended = "another order" if order.ended_by == "start" else order.ended_by
        how = {
            True: "complete",
            False: f"not complete: {order.state or 'no state recorded'}"
            + (f" when {ended} came" if ended else " at the end of the recording"),
            None: "not known whether it was completed",
        }[order.complete]
        cells = f", {order.covered_cells} of {order.coverable_cells} cells"
        counted = "" if None in (order.covered_cells, order.coverable_cells) else cells
        what = f"order {number}{ordered_words([order])}, {who}, {span}"
        found.append((order.complete, f"{what}: {how}{counted}"))
    return found


def _ending(document: ReviewDocument) -> str:
    floor, zones = floor_words(document), ordered_words(document.orders)
    if document.complete:
        swept = f"; {floor} of {'its ' if zones else ''}floor swept"
        if others_m2 := document.swept_by_others_m2:
            swept += f", {others_m2:.1f} m2 more by other robots"
        return f"complete: every cell{zones} covered" + (swept if floor else "")
    if document.complete is None:
        return "not recorded whether it was completed"
    covered, coverable = document.covered_cells, document.coverable_cells
    if document.state == "done" and (covered or 0) < (coverable or 0):
        cells = f"{covered} of {coverable} cells{zones} covered"
        return f"not complete: the mission was done with {cells}"
    how = "ended" if document.is_ended else "broke off"
    swept = f"; {floor}{zones} swept" if zones and floor else ""
    return f"not complete: the recording {how} while the mission was {document.state}{swept}"
