"""Answers of a review as text: whether each order was completed, one moment, one spot."""

from __future__ import annotations

from collections.abc import Iterator

from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.review.document import ReviewDocument
from fasaco_edge.review.figures import floor_words
from fasaco_edge.review.instant import (
    DRIVE_S,
    MAP_S,
    Instant,
    MapThen,
    PathThen,
    PlanThen,
    direction,
)
from fasaco_edge.review.orders import ordered_words
from fasaco_edge.review.spot import SWEPT_BY_OTHERS, Spot
from fasaco_edge.wire.documents.path_documents import Rectangle
from fasaco_edge.wire.reasons import plain

# Least saving of a cohort or of local search that is shown [s].
LEAST_SAVED_S = 0.05


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
    commanded = next((order for order in document.orders if order.ended_by), None)
    at_end = commanded or document
    covered, coverable = at_end.covered_cells, at_end.coverable_cells
    if at_end.state == "done" and (covered or 0) < (coverable or 0):
        cells = f"{covered} of {coverable} cells{zones} covered"
        return f"not complete: the mission was done with {cells}"
    if commanded:
        ended = f"ended by the command {commanded.ended_by} at {clock(commanded.until_s)}"
        return f"not complete: {ended}"
    how = "ended" if document.is_ended else "broke off"
    swept = f"; {floor}{zones} swept" if zones and floor else ""
    return f"not complete: the recording {how} while the mission was {document.state}{swept}"


def instant_rows(instant: Instant) -> Iterator[tuple[str, str]]:
    """Yield name and text of each known fact about a moment."""
    state, why = instant.state or "not known", plain(instant.state_reason or "")
    # A reason that names a path, as "path 3", is left out: the path has its own row.
    yield "state", f"{state}: {why}" if why and not why.startswith("path ") else state
    if instant.order:
        yield "order", instant.order
    if instant.x is not None and instant.yaw_deg is not None:
        moving = "" if instant.speed_m_s is None else f", {instant.speed_m_s:.2f} m/s"
        facing = direction(instant.yaw_deg)
        yield "robot", f"at ({instant.x:.2f}, {instant.y:.2f}) m, facing {facing}{moving}"
    if instant.sweeps_m2 is not None and instant.sweeps_new_m2 is not None:
        new = f"{instant.sweeps_new_m2:.2f} of {instant.sweeps_m2:.2f} m2 for the first time"
        yield "sweeps", f"{new}, in the next {DRIVE_S:.0f} s"
    if (turn := instant.turn) is not None:
        side = "left" if turn.degrees > 0 else "right"
        span = f"{clock(turn.begin_s)} to {clock(turn.end_s)}"
        yield "turned", f"{abs(turn.degrees):.0f} deg to the {side}, {span}: {turn.why}"
    for name, path in (
        ("path before", instant.path_before),
        ("path", instant.path),
        ("path after", instant.path_after),
    ):
        if path is not None:
            yield name, _path_words(path, clock(path.at_s))
    if (plan := instant.plan) is not None:
        yield "planned", _plan_words(plan, clock(plan.at_s))
    if (change := instant.map) is not None:
        yield "map", _map_words(change, clock(change.since_s))
    for name, command in (("command", instant.command), ("next command", instant.next_command)):
        if command is not None:
            yield name, f"{clock(command.at_s)} {command.command}"


def _path_words(path: PathThen, when: str) -> str:
    leads = "" if path.leads_deg is None else f"; leads {direction(path.leads_deg)} from there"
    where = "" if path.changed is None else f", map changed {_box_words(path.changed)}"
    return f"{path.revision} at {when}: {plain(path.reason)}{where}; {path.steps} steps{leads}"


def _plan_words(plan: PlanThen, when: str) -> str:
    found = [
        f"ants of velocity {velocity} saved {saved_s:.1f} s"
        for velocity, saved_s in plan.saved_by_velocity_s.items()
        if saved_s >= LEAST_SAVED_S
    ]
    if plan.saved_by_local_search_s >= LEAST_SAVED_S:
        found.append(f"local search saved {plan.saved_by_local_search_s:.1f} s")
    why = ", ".join(found) or "nothing saved"
    return (
        f"{plan.revision} at {when}: {plain(plan.reason)}; {plan.planner}, {plan.ants} ants; {why}"
    )


def _map_words(change: MapThen, since: str) -> str:
    parts = [
        f"{m2:.2f} m2 {what}"
        for m2, what in (
            (change.seen_m2, "seen for the first time"),
            (change.blocked_m2, "now blocked"),
            (change.freed_m2, "now free"),
        )
        if m2
    ]
    if not parts or change.around is None:
        return f"no change in the {MAP_S:.0f} s before"
    return f"since {since} {', '.join(parts)}, {_box_words(change.around)}"


def _box_words(box: Rectangle) -> str:
    return f"within ({box.x_min:.1f}, {box.y_min:.1f}) to ({box.x_max:.1f}, {box.y_max:.1f}) m"


def spot_rows(spot: Spot) -> Iterator[tuple[str, str]]:
    """Yield name and text of each known fact about a spot."""
    known = {True: "swept", False: "not swept", None: "not known"}[spot.swept]
    known += " by this robot" if spot.why == SWEPT_BY_OTHERS else ""
    yield "at", f"({spot.x:.2f}, {spot.y:.2f}) m: {known}"
    yield "why", spot.words if spot.words.startswith(spot.why) else f"{spot.why}: {spot.words}"
    if spot.patch_m2 is not None:
        yield "in one piece", f"{spot.patch_m2:.2f} m2 of floor not swept"
