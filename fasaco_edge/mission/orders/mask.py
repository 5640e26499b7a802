"""A keep-out mask: pixels of a map_server image that the robot must not touch, as rectangles.

Nav2 draws its keep-out zones in the same way (nav2_costmap_2d, KeepoutFilter): what is occupied is
kept out of; its lesser costs count for nothing here.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import BadConfiguration, MapFileError
from fasaco_edge.grid.geometry import GridGeometry, Polygon, Pose2D
from fasaco_edge.grid.map_files import read_map_rows
from fasaco_edge.grid.map_images import MAX_PIXELS

# A hand-drawn outline has a rectangle for each step of its stairs.
MOST_RECTANGLES = 2_000
# Some rows of bits are looked at as bytes.
MOST_COLS = 100_000
# An image that was read is kept in the configuration itself: a replay has no file.
INLINE = "mask:"


class _Inline(msgspec.Struct, frozen=True):
    geometry: tuple[int, int, float, float, float, float]
    deflated: str


def inline_mask(file: Path, occupied_at_least: int, most_bytes: int | None = None) -> str:
    """Return what ``mask_polygons`` reads, of a map_server YAML file.

    Args:
        file: of the YAML.
        occupied_at_least: from which value on a pixel is kept out of [percent].
        most_bytes: what it may take to read it [bytes]; None for anything.

    Raises:
        BadConfiguration: it cannot be read, takes more than that, or its outlines are too fine.
    """
    try:
        place, stripes = read_map_rows(file, most_bytes)
        _check_width(place.cols)
        # A stripe ends with a byte of bits: it has a multiple of 8 rows.
        packed = [np.packbits(stripe >= occupied_at_least) for stripe in stripes]
    except (MapFileError, ValueError) as error:
        hint = getattr(error, "hint", "")
        raise BadConfiguration(f"mission.keep_out_mask: {error}", hint=hint) from error
    bits, shape = np.concatenate(packed), (place.rows, place.cols)
    if len(_rectangles(bits, *shape)) > MOST_RECTANGLES:
        raise BadConfiguration(
            f"mission.keep_out_mask: {file}: its outlines take more than {MOST_RECTANGLES} "
            "rectangles",
            hint="draw with straight edges, or larger pixels; or give mission.keep_out polygons",
        )
    deflated = base64.b64encode(zlib.compress(bits.data, 9)).decode()
    document = _Inline(
        (*shape, place.resolution, place.origin.x, place.origin.y, place.origin.yaw),
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
        _check_width(cols)
        deflated = base64.b64decode(document.deflated, validate=True)
        bits = np.frombuffer(zlib.decompressobj().decompress(deflated, MAX_PIXELS // 8), np.uint8)
        if len(bits) != -(-rows * cols // 8):
            raise ValueError(f"{rows} x {cols} pixels in {len(bits)} bytes")
        rectangles = _rectangles(bits, rows, cols)
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


def _check_width(cols: int) -> None:
    if cols > MOST_COLS:
        raise ValueError(f"{cols} pixels wide, more than {MOST_COLS}")


def _rows(bits: NDArray[np.uint8], rows: int, cols: int) -> Iterator[NDArray[np.uint8]]:
    """Yield the rows of packed pixels, uint8 (cols,) of 0 and 1; 8 of them are whole bytes."""
    for row in range(0, rows, 8):
        count = min(rows - row, 8)
        some = np.unpackbits(bits[row // 8 * cols :][:cols], count=count * cols)
        yield from some.reshape(count, cols)


def _rectangles(bits: NDArray[np.uint8], rows: int, cols: int) -> list[tuple[int, int, int, int]]:
    """Return row0, col0, row1, col1 of rectangles that are all that is marked.

    Equal stretches of rows that follow each other are one. Of more than ``MOST_RECTANGLES`` not
    all are returned: a picture that is no mask must hold nobody up.

    Args:
        bits: the pixels, row after row without a gap, packed into uint8.
        rows, cols: how many there are.
    """
    found: list[tuple[int, int, int, int]] = []
    open_since: dict[tuple[int, int], int] = {}
    for row, marked in enumerate(chain(_rows(bits, rows, cols), (np.zeros(cols, np.uint8),))):
        borders = np.flatnonzero(np.diff(marked.view(np.int8), prepend=0, append=0))
        # Each is a rectangle here, or will be one.
        stretches = {
            (int(low), int(high)): None
            for low, high in borders.reshape(-1, 2)[: MOST_RECTANGLES + 1]
        }
        for ended in [stretch for stretch in open_since if stretch not in stretches]:
            found.append((open_since.pop(ended), ended[0], row, ended[1]))
        for stretch in stretches:
            open_since.setdefault(stretch, row)
        if len(found) + len(open_since) > MOST_RECTANGLES:
            found += [(since, low, row + 1, high) for (low, high), since in open_since.items()]
            break
    return found
