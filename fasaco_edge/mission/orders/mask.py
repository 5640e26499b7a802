"""A keep-out mask: pixels of a map_server image that the robot must not touch, as rectangles.

Nav2 draws its keep-out zones in the same way (nav2_costmap_2d, KeepoutFilter): what is occupied is
kept out of; its lesser costs count for nothing here.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import BadConfiguration, MapFileError
from fasaco_edge.grid.geometry import GridGeometry, Polygon, Pose2D
from fasaco_edge.grid.map_files import MAX_PIXELS, read_map

# A hand-drawn outline has a rectangle for each step of its stairs.
MOST_RECTANGLES = 2_000
# An image that was read is kept in the configuration itself: a replay has no file.
INLINE = "mask:"


class _Inline(msgspec.Struct, frozen=True):
    geometry: tuple[int, int, float, float, float, float]
    deflated: str


def inline_mask(file: Path, occupied_at_least: int) -> str:
    """Return what ``mask_polygons`` reads, of a map_server YAML file.

    Args:
        file: of the YAML.
        occupied_at_least: from which value on a pixel is kept out of [percent].

    Raises:
        BadConfiguration: it cannot be read, or its outlines are too fine.
    """
    try:
        grid = read_map(file)
    except MapFileError as error:
        raise BadConfiguration(f"mission.keep_out_mask: {error}") from error
    kept_out = grid.cells >= occupied_at_least
    if len(_rectangles(kept_out)) > MOST_RECTANGLES:
        raise BadConfiguration(
            f"mission.keep_out_mask: {file}: its outlines take more than {MOST_RECTANGLES} "
            "rectangles",
            hint="draw with straight edges, or larger pixels; or give mission.keep_out polygons",
        )
    place = grid.geometry
    deflated = base64.b64encode(zlib.compress(np.packbits(kept_out).tobytes(), 9)).decode()
    document = _Inline(
        (*kept_out.shape, place.resolution, place.origin.x, place.origin.y, place.origin.yaw),
        deflated,
    )
    return INLINE + msgspec.json.encode(document).decode()


def mask_polygons(inline: str) -> tuple[Polygon, ...]:
    """Return the rectangles of a mask, by their corners (x, y) [m]; none of "".

    Raises:
        BadConfiguration: it is none that ``inline_mask`` has returned.
    """
    if not inline:
        return ()
    try:
        document = msgspec.json.decode(inline.removeprefix(INLINE), type=_Inline)
        rows, cols, resolution, x, y, yaw = document.geometry
        if not 0 < rows * cols <= MAX_PIXELS:
            raise ValueError(f"{rows} x {cols} pixels")
        deflated = base64.b64decode(document.deflated, validate=True)
        bits = np.frombuffer(zlib.decompressobj().decompress(deflated, MAX_PIXELS // 8), np.uint8)
        if len(bits) != -(-rows * cols // 8):
            raise ValueError(f"{rows} x {cols} pixels in {len(bits)} bytes")
        kept_out = np.unpackbits(bits, count=rows * cols).reshape(rows, cols).astype(bool)
        rectangles = _rectangles(kept_out)
        if len(rectangles) > MOST_RECTANGLES:
            raise ValueError(f"more than {MOST_RECTANGLES} rectangles")
    except (msgspec.DecodeError, binascii.Error, zlib.error, ValueError) as error:
        raise BadConfiguration(f"mission.keep_out_mask: not a mask: {error}") from error
    geometry = GridGeometry(rows, cols, resolution, Pose2D(x, y, yaw))
    return tuple(
        tuple(
            geometry.to_map(col, row)
            for col, row in ((col0, row0), (col1, row0), (col1, row1), (col0, row1))
        )
        for row0, col0, row1, col1 in rectangles
    )


def _rectangles(marked: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    """Return row0, col0, row1, col1 of rectangles that are all that is marked, bool (rows, cols).

    Equal stretches of rows that follow each other are one. Of more than ``MOST_RECTANGLES`` not
    all are returned: a picture that is no mask must hold nobody up.
    """
    found: list[tuple[int, int, int, int]] = []
    open_since: dict[tuple[int, int], int] = {}
    for row in range(len(marked) + 1):
        stretches: dict[tuple[int, int], None] = {}
        if row < len(marked) and marked[row].any():
            borders = np.flatnonzero(np.diff(marked[row].astype(np.int8), prepend=0, append=0))
            stretches = {(int(low), int(high)): None for low, high in borders.reshape(-1, 2)}
        for ended in [stretch for stretch in open_since if stretch not in stretches]:
            found.append((open_since.pop(ended), ended[0], row, ended[1]))
        for stretch in stretches:
            open_since.setdefault(stretch, row)
        if len(found) > MOST_RECTANGLES:
            break
    return found
