"""A daemon's answers as tables for people, or as JSON where they came as CDR."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import yaml
from rich.table import Table

from fasaco_edge.bus.queries import Reply
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import figures, out
from fasaco_edge.watch import phrases
from fasaco_edge.wire import coverage, schemas
from fasaco_edge.wire.json_text import decode_json, decode_tolerant
from fasaco_edge.wire.maps import decode_occupancy_grid
from fasaco_edge.wire.paths import decode_path
from fasaco_edge.wire.pheromone import decode_pheromone
from fasaco_edge.wire.replies import Reply as MissionReply
from fasaco_edge.wire.replies import UnreachedReport, ZoneReport


def show_mission(reply: Reply) -> None:
    """Print the state and the mission in a status, or in the answer to a command."""
    told = decode_tolerant(reply.payload, MissionReply)
    mission, console = told.mission, out()
    console.print(figures(_rows(told)))
    if mission.zones:
        console.print(_zones(mission.zones))
    if mission.unreached.areas:
        console.print(_unreached(mission.unreached))


def _rows(told: MissionReply) -> list[tuple[str, str]]:
    mission = told.mission
    rows = [("robot", told.robot), ("state", told.state), ("reason", told.reason)]
    if mission.ordered is not None:
        began = "begun by itself" if mission.ordered == "itself" else "as ordered"
        stage = phrases.stage(mission)
        rows.append(("mission", f"{stage}, {began}"))
    if told.coverage is not None:
        rows.append(("covered", phrases.covered(told.coverage)))
    if mission.keep_out:
        rows.append(("keep-out zones", str(mission.keep_out)))
    if mission.return_home:
        home = mission.home
        rows.append(("home", f"({home.x:.2f}, {home.y:.2f}) m" if home else "not known yet"))
    return rows


def _zones(zones: Sequence[ZoneReport]) -> Table:
    table = Table("zone", "pass", "covered", title="Zones", title_justify="left")
    for zone in zones:
        table.add_row(zone.name, *phrases.zone_progress(zone))
    return table


def _unreached(unreached: UnreachedReport) -> Table:
    table = Table("cells", "m2", "at", "why", title="Not reached", title_justify="left")
    for area in unreached.areas:
        place = f"({area.x:.2f}, {area.y:.2f}) m"
        table.add_row(str(area.cells), f"{area.m2:.2f}", place, area.reason)
    if unreached.areas_left_out:
        table.caption = f"and {unreached.areas_left_out} smaller areas"
    return table


def print_answer(reply: Reply) -> None:
    """Print what came if it is JSON, escapes and all, else the figures of the message."""
    print_json(_figures(reply) if reply.schema else decode_json(reply.payload))


def show(name: str, reply: Reply) -> None:
    """Print the answer to question ``name``."""
    if reply.schema:
        rows = [(title, str(value)) for title, value in _figures(reply).items()]
        out().print(figures(rows))
    elif name in ("status", "mission"):
        show_mission(reply)
    else:
        document = decode_json(reply.payload)
        print(yaml.safe_dump(document, sort_keys=False), end="")


def _figures(reply: Reply) -> dict[str, Any]:
    match reply.schema:
        case schemas.PATH:
            return _path_figures(reply)
        case schemas.OCCUPANCY_GRID:
            return _coverage_figures(reply)
        case _:
            return _trail_figures(reply)


def _path_figures(reply: Reply) -> dict[str, Any]:
    path = decode_path(reply.payload)
    length_m = float(np.hypot(*np.diff(path.xy, axis=0).T).sum())
    return {
        "frame": path.frame,
        "poses": len(path.xy),
        "length_m": round(length_m, 2),
        **decode_json(reply.attachment),
    }


def _coverage_figures(reply: Reply) -> dict[str, Any]:
    grid = decode_occupancy_grid(reply.payload)
    values = {name.lower(): value for name, value in vars(coverage).items() if name.isupper()}
    return {
        "frame": grid.frame,
        "rows": grid.geometry.rows,
        "cols": grid.geometry.cols,
        "cell_m": grid.geometry.resolution,
        **{name: int(np.count_nonzero(grid.cells == value)) for name, value in values.items()},
    }


def _trail_figures(reply: Reply) -> dict[str, Any]:
    trail = decode_pheromone(reply.payload)
    return {
        "frame": trail.frame,
        "rows": trail.geometry.rows,
        "cols": trail.geometry.cols,
        "cell_m": trail.geometry.resolution,
        "cohort": trail.cohort,
        "velocity": trail.velocity,
        "ants": trail.ants,
        "best_steps": trail.best_steps,
        "trail_min": trail.trail_min,
        "trail_max": trail.trail_max,
    }
