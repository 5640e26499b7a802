"""A daemon's answers for people, and for programs that read no CDR."""

from __future__ import annotations

from typing import Any

import numpy as np
import yaml

from fasaco_edge.bus.queries import Reply
from fasaco_edge.cli import mission_view
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import figures, out
from fasaco_edge.wire import coverage, schemas
from fasaco_edge.wire.json_text import decode_json
from fasaco_edge.wire.maps import decode_occupancy_grid
from fasaco_edge.wire.paths import decode_path
from fasaco_edge.wire.pheromone import decode_pheromone


def print_answer(reply: Reply) -> None:
    """Print what came if it is JSON, escapes and all, else the figures of the message."""
    print_json(_figures(reply) if reply.schema else decode_json(reply.payload))


def show(name: str, reply: Reply) -> None:
    """Print the answer to question ``name``."""
    if reply.schema:
        rows = [(title, str(value)) for title, value in _figures(reply).items()]
        out().print(figures(rows))
    elif name in ("status", "mission"):
        mission_view.show(decode_json(reply.payload))
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
