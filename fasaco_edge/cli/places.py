"""Where a robot starts when nobody says."""

from __future__ import annotations

from pathlib import Path

from fasaco_edge.grid.map_files import suggested_start


def start_point(map_file: Path) -> tuple[float, float]:
    """Return a built-in map's start (x, y) [m]; the map frame's origin for any other map."""
    return suggested_start(map_file) or (0.0, 0.0)
