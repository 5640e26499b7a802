"""Keep-out mask: rectangles of pixels of a map_server image that the robot must not touch.

As in Nav2 (nav2_costmap_2d, KeepoutFilter), occupied pixels are kept out; lesser costs are ignored.
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
from fasaco_edge.grid.occupancy import OccupancyGrid

# A hand-drawn outline needs one rectangle for each step of its staircase.
MOST_RECTANGLES = 2_000
# Bounds memory: unpacking expands eight rows of bits to bytes at a time.
MOST_COLS = 100_000
# Prefix of a mask stored in the configuration itself: a replay has no file.
INLINE = "mask:"
# Key of the mask in a configuration.
MASK = "mission.keep_out_mask"


class _Inline(msgspec.Struct, frozen=True, omit_defaults=True):
    geometry: tuple[int, int, float, float, float, float]
    deflated: str
    # Frame of the map that the mask belongs to; "" for any, as a file names none.
    frame: str = ""


def inline_mask(file: Path, occupied_at_least: int, most_bytes: int | None = None) -> str:
    """Return the inline form of a map_server YAML file, the input of ``mask_polygons``.

    Args:
        file: the YAML file.
        occupied_at_least: threshold of occupied pixels [percent].
        most_bytes: memory limit for reading it [bytes]; None for no limit.

    Raises:
        BadConfiguration: it cannot be read, exceeds the limit, or its outlines are too fine.
    """
    try:
        place, stripes = read_map_rows(file, most_bytes, is_mask=True)
        _check_width(place.cols)
        # Stripes are packed separately, so each has a multiple of 8 rows.
        packed = [np.packbits(stripe >= occupied_at_least) for stripe in stripes]
    except MapFileError as error:
        text = "; ".join(str(each) for each in (error, *error.rest))
        raise BadConfiguration(text, hint=error.hint, key=MASK) from error
    except ValueError as error:
        raise BadConfiguration(str(error), key=MASK) from error
    return _inline(place, np.concatenate(packed), MASK)


def inline_grid(grid: OccupancyGrid, occupied_at_least: int) -> str:
    """Return the inline form of a mask received as a message, the input of ``mask_polygons``.

    Raises:
        BadConfiguration: its outlines are too fine, or it is too wide.
    """
    place = grid.geometry
    try:
        _check_width(place.cols)
    except ValueError as error:
        raise BadConfiguration(str(error), key="keep_out_mask") from error
    bits = np.packbits(grid.cells >= occupied_at_least)
    return _inline(place, bits, "keep_out_mask", grid.frame)


def mask_frame(inline: str) -> str:
    """Return the frame of the map that a mask belongs to; "" for any, or without a mask."""
    return msgspec.json.decode(inline.removeprefix(INLINE), type=_Inline).frame if inline else ""


def _inline(place: GridGeometry, bits: NDArray[np.uint8], key: str, frame: str = "") -> str:
    shape = (place.rows, place.cols)
    if len(_rectangles(bits, *shape)) > MOST_RECTANGLES:
        raise BadConfiguration(
            f"its outlines take more than {MOST_RECTANGLES} rectangles",
            key=key,
            hint="draw with straight edges, or larger pixels; or give mission.keep_out polygons",
        )
    deflated = base64.b64encode(zlib.compress(bits.data, 9)).decode()
    document = _Inline(
        (*shape, place.resolution, place.origin.x, place.origin.y, place.origin.yaw),
        deflated,
        frame,
    )
    return INLINE + msgspec.json.encode(document).decode()


def mask_polygons(inline: str) -> tuple[Polygon, ...]:
    """Return the rectangles of a mask, by their corners (x, y) [m]; none for "".

    Raises:
        BadConfiguration: ``inline`` was not made by ``inline_mask``.
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
        raise BadConfiguration(f"not a mask: {error}", key=MASK) from error
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
    """Yield the rows of packed pixels, uint8 (cols,) of 0 and 1; eight rows fill whole bytes."""
    for row in range(0, rows, 8):
        count = min(rows - row, 8)
        some = np.unpackbits(bits[row // 8 * cols :][:cols], count=count * cols)
        yield from some.reshape(count, cols)


def _rectangles(bits: NDArray[np.uint8], rows: int, cols: int) -> list[tuple[int, int, int, int]]:
    """Return rectangles (row0, col0, row1, col1) that cover exactly the marked pixels.

    Equal runs in successive rows are merged. Stops after ``MOST_RECTANGLES``, which bounds the time
    for an image that is no mask.

    Args:
        bits: the pixels, row by row without gaps, packed into uint8.
        rows, cols: size of the image.
    """
    found: list[tuple[int, int, int, int]] = []
    open_since: dict[tuple[int, int], int] = {}
    for row, marked in enumerate(chain(_rows(bits, rows, cols), (np.zeros(cols, np.uint8),))):
        borders = np.flatnonzero(np.diff(marked.view(np.int8), prepend=0, append=0))
        # Runs of this row; each begins a rectangle or extends one.
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
