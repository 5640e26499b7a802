"""The last order given by command, which a page offers to give again."""

from __future__ import annotations

from typing import Any

from fasaco_edge.client.robot_state import RobotState
from fasaco_edge.grid.geometry import polygon_bounds
from fasaco_edge.wire.documents.replies import MissionReport, ZoneReport
from fasaco_edge.wire.documents.rooms import RoomReport

# A zone is the room of its name if their bounds differ by less [m]: outlines change as maps grow.
NEAR_M = 0.5


def rooms_of(view: RobotState) -> dict[str, RoomReport]:
    """Return the rooms that zones of an order may name, by their titles."""
    configured = {zone.name for zone in view.settings.mission.zones}
    return {room.title: room for room in view.rooms.rooms if room.title not in configured}


def room_of(zone: ZoneReport, rooms: dict[str, RoomReport]) -> RoomReport | None:
    """Return the room that a zone of an order names; None for an area with a room's name."""
    room = rooms.get(zone.name)
    if room is None or not (zone.polygon and room.outline):
        return room
    bounds = zip(polygon_bounds(zone.polygon), polygon_bounds(room.outline), strict=True)
    return room if all(abs(one - other) < NEAR_M for one, other in bounds) else None


def order_of(view: RobotState, mission: MissionReport) -> dict[str, Any] | None:
    """Return the order in a status; None without an order by command.

    A zone with name and bounds of a room is that room. The status has the number of passes, not
    their kinds.
    """
    if mission.ordered != "command":
        return None
    rooms, zones = rooms_of(view), list[dict[str, object]]()
    for zone in mission.zones:
        found: dict[str, object] = {"name": zone.name, "passes": zone.passes}
        if room := room_of(zone, rooms):
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


def again(order: dict[str, Any] | None) -> dict[str, object] | None:
    """Return the last order by command, which the user can repeat once it is over; None if unknown.

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
