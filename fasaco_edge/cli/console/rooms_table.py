"""The table of rooms on a terminal."""

from __future__ import annotations

from rich.table import Table

from fasaco_edge.cli.console.terminal import out
from fasaco_edge.mission.orders.room_requests import USUAL_PRIORITY
from fasaco_edge.text import duration, percent
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms


def show_rooms(rooms: Rooms) -> None:
    """Print rooms, one per line."""
    if not rooms.rooms:
        out().print("no rooms yet: they are found some seconds after the first map")
        return
    table = Table(
        *("room", "name", "m2", "swept", "to go", "beside", "settings"),
        title="Rooms",
        title_justify="left",
    )
    for room in rooms.rooms:
        beside = ", ".join(map(str, room.neighbours)) or "-"
        swept = "-" if room.swept is None else percent(room.swept)
        # 0 also for a room that the path does not enter.
        to_go = duration(room.to_go_s) if room.to_go_s else "-"
        row = f"{room.area_m2:.1f}", swept, to_go, beside, _settings(room)
        table.add_row(str(room.id), room.name or "-", *row)
    out().print(table)


def _settings(room: RoomReport) -> str:
    """Return a room's settings as text."""
    words = []
    if isinstance(room.passes, int):
        words.append(f"passes: {room.passes}")
    elif room.passes:
        each = (item if isinstance(item, str) else _pass(item) for item in room.passes)
        words.append(f"passes: {', '.join(each)}")
    words += ["skip"] * room.skip
    words += [] if room.priority == USUAL_PRIORITY else [f"priority: {room.priority}"]
    return "; ".join(words) or "-"


def _pass(members: dict[str, object]) -> str:
    return " ".join(f"{name} {value}" for name, value in sorted(members.items()))
