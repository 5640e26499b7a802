"""Limits of messages; ``protocol/limits.yaml`` is the same table as data."""

from __future__ import annotations

from typing import Final

from fasaco_edge.grid import geometry

MAX_MESSAGE_BYTES: Final = 64 * 1024 * 1024
"""Longest message of any kind; the session refuses longer ones (``bus.session``)."""

MAX_STRING_BYTES: Final = 256
"""Longest string, in UTF-8, without its NUL."""

MAX_COORDINATE_M: Final = geometry.FARTHEST_M
"""Largest magnitude of a position's x, y or z [m]."""

MIN_RESOLUTION_M: Final = geometry.MIN_RESOLUTION_M
MAX_RESOLUTION_M: Final = geometry.MAX_RESOLUTION_M
"""Edge of a grid's pixel, and of the cells of a fleet's robot [m]."""

QUATERNION_TOLERANCE: Final = 0.01
"""Largest deviation of a quaternion's norm from 1."""

MAX_GRID_TILT: Final = 0.01
"""Largest magnitude of x and y in a grid's quaternion: a map lies in the plane."""

MAX_TRANSFORM_TILT: Final = 0.2
"""Largest magnitude of x and y in the quaternion between map and robot: a ramp of 23 degrees."""

MAX_GRID_CELLS: Final = 64_000_000
MAX_PATH_POSES: Final = 1_000_000
MAX_TRANSFORMS: Final = 4096
"""Limit on the transforms of one tf message, and on the frames that are kept."""

MAX_POSE_BYTES: Final = 1_048_576
"""Longest pose or tf message."""

MAX_SCAN_BEAMS: Final = 32_768
"""Limit on the beams of a laser scan."""
MAX_SCAN_SPAN_RAD: Final = 6.5
"""Largest angle from the first beam of a scan to the last [rad]: a full turn, and rounding."""

MAX_JSON_BYTES: Final = 1_048_576
MAX_JSON_DEPTH: Final = 32
"""Levels of objects and arrays in a JSON document, including the document itself."""
MAX_JSON_INTEGER: Final = 2**63 - 1
"""Largest magnitude of an integer in a JSON document."""
MAX_JSON_NUMBER: Final = 1e15
"""Largest magnitude of any other number in a JSON document."""

MAX_FLEET_TILES: Final = 24
"""Limit on the tiles of 64 x 64 cells in one progress message of a fleet's robot (17 kB), and in
one ground message."""
MAX_FLEET_PARTS: Final = 33
"""Limit on the parts of a division, one for each robot: the largest fleet."""
MAX_FLEET_INDEX: Final = geometry.MOST_INDEX
"""Largest magnitude of a cell's row and column: as far as any lattice reaches."""
MAX_FLEET_POINTS: Final = 64
"""Limit on the points of a robot's path ahead, in a message of the fleet."""
MAX_BLOCKED_BYTES: Final = 16_384
"""Longest report of a robot that is blocked."""
MAX_BLOCKED_POINTS: Final = 64
"""Limit on the points ahead of a robot in its report that it is blocked."""
MAX_PRIORITY_BYTES: Final = 1_048_576
"""Longest grid of priorities, one byte per pixel: 250 m by 250 m of floor at 0.25 m."""
