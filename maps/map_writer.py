"""A writer of map files as nav2's map saver has them: for the maps here, and for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from fasaco_edge.grid.occupancy import OccupancyGrid

# What nav2's map saver writes for unknown, free and occupied, and the thresholds
# that lie between: 205 is 19.608 % occupied.
UNKNOWN_GREY, FREE_GREY, OCCUPIED_GREY = 205, 254, 0
WRITTEN_THRESHOLDS = {"occupied_thresh": 0.65, "free_thresh": 0.196}
FREE_AT_MOST, OCCUPIED_AT_LEAST = 25, 65


def write_map(grid: OccupancyGrid, path: str | Path) -> None:
    """Write ``grid`` in trinary mode: a YAML file at ``path`` and a PGM file beside it.

    Values up to 25 are written as free and from 65 on as occupied, as nav2's map
    saver does; what lies between is written as unknown.
    """
    path = Path(path)
    image = path.with_suffix(".pgm")
    known = grid.cells >= 0
    grey = np.full(grid.cells.shape, UNKNOWN_GREY, np.uint8)
    grey[known & (grid.cells <= FREE_AT_MOST)] = FREE_GREY
    grey[grid.cells >= OCCUPIED_AT_LEAST] = OCCUPIED_GREY
    geometry = grid.geometry
    header = f"P5\n{geometry.cols} {geometry.rows}\n255\n"
    image.write_bytes(header.encode() + grey[::-1].tobytes())
    origin = geometry.origin
    description = {
        "image": image.name,
        "mode": "trinary",
        "resolution": geometry.resolution,
        "origin": [origin.x, origin.y, origin.yaw],
        "negate": 0,
        **WRITTEN_THRESHOLDS,
    }
    text = yaml.safe_dump(description, sort_keys=False, default_flow_style=None)
    path.write_text(text, encoding="utf-8")
