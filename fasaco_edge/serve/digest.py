"""The page's documents about a robot: state, progress, areas, rooms and events."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import islice
from typing import Any

from fasaco_edge.client import phrases
from fasaco_edge.client.phrases import EventLog
from fasaco_edge.client.robot_state import RobotState
from fasaco_edge.grid.geometry import Bounds, Polygon
from fasaco_edge.grid.label_place import label_place
from fasaco_edge.serve import plain
from fasaco_edge.serve.last_order import again, order_of, room_of, rooms_of
from fasaco_edge.states import Activity, states_of
from fasaco_edge.wire.documents.json_text import Corners
from fasaco_edge.wire.documents.replies import FloorReport, MissionReport, ZoneReport
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms
from fasaco_edge.wire.documents.settings import KnownSettings
from fasaco_edge.wire.documents.status import FleetReport, Status
from fasaco_edge.wire.reasons import plain as plain_words

Digest = dict[str, object]

# Limits on the shown entries of received lists.
MOST_ENTRIES, MOST_AREAS, MOST_ROBOTS = 40, 100, 50
MOST_CORNERS = 1_000
# Longer remaining times come from a speed of almost 0 [s].
MOST_TO_GO_S = 1e8
# Coordinates beyond this are invalid [m].
MOST_M = 1e6
DRIVING = states_of(Activity.DRIVING)


def state(
    view: RobotState,
    now: float,
    ordered: Status | None = None,
    order: dict[str, Any] | None = None,
) -> Digest:
    """Return the document of the newest status; ``absent`` says why there is no newer status.

    Args:
        view: state of the robot.
        now: time by the clock of ``view`` [s].
        ordered: the newest status with an order.
        order: the newest order given by command; None if unknown.
    """
    status = view.status
    others = sorted(view.robots - {view.robot})[:MOST_ROBOTS]
    absent = _absent(view, now)
    found: Digest = {"robot": view.robot, "absent": absent, "others": others, "bus": view.trouble}
    if status is None:
        return found
    mission, floor, battery = status.mission, status.floor, status.battery
    if mission.last_order is not None:
        order = mission.last_order
    elif order is None and ordered is not None:
        order = order_of(view, ordered.mission)
    return found | {
        "state": status.state,
        "look": plain.look(status),
        "word": plain.word(status.state),
        "does": plain.last_seen(status) if absent else plain.does(status),
        "needs": plain.needs(status),
        "left": [
            {"m2": part.m2, "reason": part.reason, "marks": part.marks, "places": part.places}
            for part in plain.left(status, ordered)
        ],
        "reason": _reason(status),
        # After a restart the new map may not show any floor of an order that is done.
        "cells": coverage.fraction
        if (coverage := status.coverage) and coverage.coverable
        else None,
        "floor": _floor(floor) if floor else None,
        "to_go_s": _to_go_s(view, status),
        "grows": view.grows(now),
        "simulated": phrases.scale_words(view.settings.robot.time_scale),
        "time_scale": view.settings.robot.time_scale,
        "mission": _mission(view, status),
        "again": again(order),
        "battery": battery and {"level": battery.level, "power": battery.power},
        "faults": list(_faults(status)),
        "fleet": _fleet(status.fleet) if status.fleet else None,
        "radius_m": view.settings.robot.radius_m,
        "version": status.version,
    }


def _absent(view: RobotState, now: float) -> str:
    """Return why there is no new status; "" if there is one."""
    if view.trouble:
        return "No contact with the robot's network; trying again"
    if view.gone_since is not None:
        gone = phrases.age(round(now - view.gone_since))
        return f"The robot has been gone for {gone}: is it switched on?"
    if not view.is_here:
        return f"No robot named {view.robot} has been found yet: is it switched on?"
    if view.status is None:
        return "The robot has sent nothing yet"
    silent = view.silent_s(now)
    return f"The robot has been silent for {phrases.age(round(silent))}" if silent else ""


def _reason(status: Status) -> str:
    path = status.path
    if path is not None and status.reason == f"path {path.revision}":
        return plain_words(path.reason) if path.steps else ""
    return plain_words(status.reason)


def _floor(floor: FloorReport) -> Digest:
    return {
        "swept_m2": floor.swept_m2,
        "reached_m2": floor.reached_m2,
        "reachable_m2": floor.reachable_m2,
    }


def _to_go_s(view: RobotState, status: Status) -> int | None:
    path = status.path
    if view.gone_since is not None or path is None:
        return None
    # At rest only a paused robot will continue on its line.
    is_driven = status.state == "paused" or (path.steps and status.state in DRIVING)
    left_s = path.line_s if is_driven else None
    return None if not left_s or left_s > MOST_TO_GO_S else round(left_s)


def _mission(view: RobotState, status: Status) -> Digest:
    mission, rooms = status.mission, rooms_of(view)
    return {
        "ordered": mission.ordered,
        "stage": mission.stage,
        "paused": mission.paused,
        "zone": mission.zone,
        "pass": mission.pass_number,
        "passes": mission.passes,
        "part": _part(mission),
        "more": _comes_more(mission),
        "zones": [
            {
                "name": zone.name,
                "pass": zone.pass_number,
                "passes": zone.passes,
                "share": _share(zone, room_of(zone, rooms), status),
            }
            for zone in mission.zones[:MOST_AREAS]
        ],
        "left_out": list(mission.left_out),
        "return_home": mission.return_home,
        "time_left_s": mission.time_left_s,
        "home": [mission.home.x, mission.home.y] if mission.home else None,
    }


def _share(zone: ZoneReport, room: RoomReport | None, status: Status) -> float | None:
    """Return which share of a zone is done. For a room it is the share of floor shown on the map;
    for the only zone of an order, the share of the order's floor; else the share of the zone's
    cells, None if it has no cells."""
    if room is not None and room.swept is not None:
        return room.swept
    floor = status.floor
    if len(status.mission.zones) == 1 and floor and floor.reachable_m2 and floor.left is not None:
        return (floor.reached_m2 or 0.0) / floor.reachable_m2
    return zone.covered / zone.cells if zone.cells else None


def _part(mission: MissionReport) -> str:
    """Return what the figures refer to: pass, place, places, or "" for all reachable floor."""
    is_covering = mission.stage == "covering"
    if is_covering and (mission.passes or 1) > 1:
        return "pass"
    count = len(mission.zones)
    return "" if not count else "place" if is_covering or count == 1 else "places"


def _comes_more(mission: MissionReport) -> bool:
    if mission.stage != "covering" or mission.passes is None:
        return False
    is_last_pass = (mission.pass_number or 1) >= mission.passes
    is_last_zone = mission.zone in (None, *(zone.name for zone in mission.zones[-1:]))
    return not (is_last_pass and is_last_zone)


def _faults(status: Status) -> Iterator[str]:
    for what, to_do in phrases.troubles(status):
        yield f"{what}. {to_do[:1].upper()}{to_do[1:]}."
    if status.errors.total:
        count = status.errors.total
        yield f"refused or failed {count} times since the start, last: {status.errors.last}"
    if status.ledger.fault:
        yield f"progress on disk: {status.ledger.fault}"
    recorder = status.recorder
    if recorder is not None and recorder.state not in ("recording", "starting"):
        yield f"recorder {recorder.state}: {recorder.reason or ''}"


def _fleet(fleet: FleetReport) -> list[Digest]:
    return [
        {
            "name": member.name,
            "does": "away" if member.away else plain.word(member.state),
            "away": member.away,
        }
        for member in fleet.members[:MOST_ROBOTS]
    ]


def areas(settings: KnownSettings, report: MissionReport) -> Digest:
    """Return configured zones, the zones of the order, and keep-outs in force."""
    mission = settings.mission
    return {
        "zones": [
            *_areas((zone.name, zone.polygon, "standing") for zone in mission.zones),
            *_areas((zone.name, zone.polygon, "ordered") for zone in report.zones),
        ],
        "keep_out": [
            *_areas((each.name, each.polygon, each.by) for each in report.keep_outs),
            *_areas(("", polygon, "standing") for polygon in mission.keep_out),
        ],
    }


def _areas(found: Iterable[tuple[str, Corners, str]]) -> Iterator[Digest]:
    """Yield documents of the valid areas (name, polygon, kind), up to a limit."""
    drawn = (area for area in found if _is_polygon(area[1]))
    for name, polygon, kind in islice(drawn, 2 * MOST_AREAS):
        yield {"name": name, "polygon": polygon, "is": kind}


def _is_polygon(corners: Corners) -> bool:
    return 3 <= len(corners) <= MOST_CORNERS and all(
        abs(value) < MOST_M for corner in corners for value in corner
    )


def lately(events: EventLog) -> list[Digest]:
    """Return the documents of the newest events, the newest first."""
    entries = list(events.entries)[-MOST_ENTRIES:]
    # The page shows wall-clock times; entries have monotonic times.
    offset = time.time() - phrases.steady_now()
    return [
        {"at_s": round(entry.at_s + offset, 1), "text": entry.text, "tone": entry.tone}
        for entry in reversed(entries)
    ]


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
