"""The page's documents about a robot: state, progress, areas and events."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any

from fasaco_edge.client import phrases
from fasaco_edge.client.phrases import EventLog
from fasaco_edge.client.robot_state import RobotState
from fasaco_edge.serve import plain
from fasaco_edge.wire.documents.json_text import Corners
from fasaco_edge.wire.documents.replies import FloorReport, MissionReport
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
# States with a path to drive.
UNDERWAY = ("planning", "covering", "returning", "degraded", "paused", "charging")


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
        order = _order_of(view, ordered.mission)
    return found | {
        "state": status.state,
        "word": plain.WORDS.get(status.state, status.state),
        "does": plain.last_seen(status) if absent else plain.does(status),
        "needs": plain.needs(status),
        "left": [
            {"m2": part.m2, "reason": part.reason, "marks": part.marks, "places": part.places}
            for part in plain.left(status, ordered)
        ],
        "reason": _reason(status),
        "cells": status.coverage.fraction if status.coverage else None,
        "floor": _floor(floor) if floor else None,
        "to_go_s": _to_go_s(view, status),
        "grows": view.grows(now),
        "simulated": phrases.scale_words(view.settings.robot.time_scale),
        "time_scale": view.settings.robot.time_scale,
        "mission": _mission(mission),
        "again": _again(order),
        "battery": battery and {"level": battery.level, "power": battery.power},
        "in_trouble": bool(status.troubles),
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
    if status.state not in UNDERWAY or view.gone_since is not None or path is None:
        return None
    # Without steps only a paused robot will go on with its line.
    is_driven = path.steps or status.state == "paused"
    left_s = path.line_s if is_driven else None
    return None if not left_s or left_s > MOST_TO_GO_S else round(left_s)


def _mission(mission: MissionReport) -> Digest:
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
                "share": zone.covered / zone.cells if zone.cells else 0.0,
            }
            for zone in mission.zones[:MOST_AREAS]
        ],
        "left_out": list(mission.left_out),
        "return_home": mission.return_home,
        "time_left_s": mission.time_left_s,
        "home": [mission.home.x, mission.home.y] if mission.home else None,
    }


def _part(mission: MissionReport) -> str:
    """Return what the figures refer to: pass, place, places, or "" for all reachable floor."""
    is_covering = mission.stage == "covering"
    if is_covering and (mission.passes or 1) > 1:
        return "pass"
    count = len(mission.zones)
    return "" if not count else "place" if is_covering or count == 1 else "places"


def _comes_more(mission: MissionReport) -> bool:
    """Return whether another pass or zone follows the current one."""
    if mission.stage != "covering" or mission.passes is None:
        return False
    is_last_pass = (mission.pass_number or 1) >= mission.passes
    is_last_zone = mission.zone in (None, *(zone.name for zone in mission.zones[-1:]))
    return not (is_last_pass and is_last_zone)


def _order_of(view: RobotState, mission: MissionReport) -> dict[str, Any] | None:
    """Return the order in a status, for an order commanded before this server began; else None.

    A zone with the name of a room is that room. The status has the number of passes, not their
    kinds.
    """
    if mission.ordered != "command":
        return None
    configured = {zone.name for zone in view.settings.mission.zones}
    rooms = {room.title: room for room in view.rooms.rooms if room.title not in configured}
    zones: list[Digest] = []
    for zone in mission.zones:
        found: Digest = {"name": zone.name, "passes": zone.passes}
        if room := rooms.get(zone.name):
            found["room"], usual = room.id, room.passes or 1
            if zone.passes == (usual if isinstance(usual, int) else len(usual)):
                del found["passes"]
        elif zone.polygon:
            found["polygon"] = zone.polygon
        zones.append(found)
    return {
        "zones": zones,
        "keep_out": [each.polygon for each in mission.keep_outs if each.by == "order"],
        "return_home": mission.return_home,
    }


def _again(order: dict[str, Any] | None) -> Digest | None:
    """Return the last order by command, which the user can repeat once it is over; else None.

    It is sent from the order's beginning on: the page keeps it if this server restarts before the
    end. It is empty if it equals the order of the Start button.
    """
    if order is None:
        return None
    # A room is repeated by its number only, as its outline may have changed since.
    given = order.get("zones")
    zones = [
        {name: value for name, value in zone.items() if name != "polygon" or "room" not in zone}
        for zone in (given if isinstance(given, list) else ())
        if isinstance(zone, dict)
    ]
    is_usual = order.get("passes") in (None, 1) and not (
        zones or order.get("keep_out") or order.get("return_home")
    )
    return {} if is_usual else order | {"zones": zones, "keep_covered": False}


def _faults(status: Status) -> Iterator[str]:
    """Yield troubles and faults as text for engineers."""
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
            "does": "away" if member.away else plain.WORDS.get(member.state, member.state),
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
    # The page shows wall-clock times; entries have monotonic ones.
    offset = time.time() - phrases.steady_now()
    return [
        {"at_s": round(entry.at_s + offset, 1), "text": entry.text, "tone": entry.tone}
        for entry in reversed(entries)
    ]
