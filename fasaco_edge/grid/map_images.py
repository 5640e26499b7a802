"""Map images, decoded whole and processed in stripes of rows, and cell values of brightness levels.

Pillow's decoded image takes one byte per grey pixel, and four per colour pixel. It is processed in
stripes, which bounds the additional memory.

In trinary mode, ROS 2's map_saver writes black, grey 254 for free, and grey 205 for never seen,
which is 19.6 % occupied. Until 2025 it also wrote ``free_thresh: 0.25``, by which map_server takes
205 as free; since then it writes 0.196, as in ROS 1 (navigation2 PR 5278). This module takes 205 as
unknown if map_saver wrote it, as a robot must not drive over ground that was never seen.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import MapFileError
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN
from fasaco_edge.host.files import check_plain

if TYPE_CHECKING:
    from PIL import Image
    from PIL.ImageFile import ImageFile

MAX_PIXELS = 64_000_000

# The formats that nav2 recommends (Pillow calls PGM PPM), and JPEG, in which some maps are
# published. Artefacts of JPEG may turn unknown pixels beside walls into free ones.
FORMATS = ("PPM", "PNG", "BMP", "JPEG")
# Size of a stripe, rounded to 8 rows: pixels, and memory per pixel [bytes].
STRIPE_PIXELS = 500_000
STRIPE_BYTES = 16
# Decoded size of a pixel by Pillow's mode [bytes]; 4 for other modes.
_DECODED = {"1": 1, "L": 1, "P": 1, "I;16": 2, "I;16B": 2}
# Progressive JPEG also keeps the coefficients of all channels [bytes per channel].
_COEFFICIENTS = 2
# Limit on the pixels of rare formats that Pillow decodes in Python, at a microsecond per pixel, or
# ten on a slow computer.
SLOW_PIXELS = 1_000_000

_SIZE_HINT = "save the part of the map that is to be covered, or the map with larger pixels"

# map_saver's greys for free and never seen, of 255.
SEEN_FREE, NEVER_SEEN = 254, 205

RAW = (
    "in mode raw, {} pixels of greys from 101 to 254 are unknown, and black pixels are free: if "
    "black means wall, write mode: trinary"
)
NEGATED = (
    "negate: 1 turns white pixels into walls, and {} pixels of the grey 205 as well, by which "
    "map_saver means never seen: if white means floor, write negate: 0"
)
UNSEEN = (
    "{} pixels of the grey 205, which map_saver writes for never seen, are {} by the keys of the "
    "map file: they are taken for unknown; write mode: trinary and free_thresh: 0.196, or give "
    "floor another grey"
)


@dataclass(frozen=True, slots=True, eq=False)
class Stripe:
    """Rows of an image.

    Attributes:
        levels: uint8 or uint16 (rows, cols), lowest row first: brightness, 0 black to ``white``;
            the mean over the colour channels without alpha.
        transparent: bool (rows, cols); None for an image without alpha channel.
    """

    levels: NDArray[np.uint8] | NDArray[np.uint16]
    transparent: NDArray[np.bool_] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MapImage:
    """A decoded image.

    Attributes:
        rows, cols: its size [pixels].
        white: the maximum level.
    """

    rows: int
    cols: int
    white: int
    _decoded: Image.Image

    def stripes(self) -> Iterator[Stripe]:
        """Yield stripes from the lowest up; each but the last has a multiple of 8 rows."""
        height = stripe_rows(self.cols)
        for low in range(0, self.rows, height):
            bottom = self.rows - low
            stripe = self._decoded.crop((0, max(bottom - height, 0), self.cols, bottom))
            # Image rows run from the top down, map rows from the smallest y up.
            if self.white == 65535:
                yield Stripe(np.asarray(stripe)[::-1].astype(np.uint16))
            elif self.white == 255:
                yield Stripe(np.asarray(stripe.convert("L"))[::-1])
            else:
                pixels = np.asarray(stripe.convert("RGBA"))[::-1]
                levels = pixels[:, :, :3].sum(axis=2, dtype=np.uint16)
                yield Stripe(levels, pixels[:, :, 3] < 255)


def stripe_rows(cols: int) -> int:
    """Return the rows of a stripe, a multiple of 8."""
    return 8 * max(STRIPE_PIXELS // (8 * cols), 1)


def read_image(path: Path, most_bytes: int | None = None) -> MapImage:
    """Return the pixels of a PGM, PNG, BMP or JPEG file.

    Args:
        path: the file.
        most_bytes: memory limit for decoding and processing [bytes]; None for no limit. With a
            limit, images that Pillow decodes slowly have at most ``SLOW_PIXELS``.

    Raises:
        MapFileError: it is missing, of another format, damaged, empty or too large.
    """
    # Pillow is imported with the first image: a daemon without images does not load it.
    from PIL import Image, UnidentifiedImageError  # noqa: PLC0415

    try:
        check_plain(path)
        with warnings.catch_warnings():
            # check_size applies the lower limit of this project.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(path, formats=FORMATS)
        with image:
            check_size(path, *image.size)
            if most_bytes is not None:
                _check_affordable(path, image, most_bytes)
            return _decoded(path, image)
    except Image.DecompressionBombError as error:
        text = f"{path}: more than {MAX_PIXELS} pixels: {error}"
        raise MapFileError(text, hint=_SIZE_HINT) from error
    except UnidentifiedImageError as error:
        raise MapFileError(
            f"{path}: not an image (PGM, PNG, BMP or JPEG)", hint="save it as PGM or PNG"
        ) from error
    except (OSError, ValueError, SyntaxError) as error:
        # Only texts of OSError are clear to users: errors of the system, and files cut short.
        why = str(error) if isinstance(error, OSError) else "its content is damaged"
        raise MapFileError(
            f"{path}: not readable as an image: {why}",
            hint="see that the file is whole and may be read; save or copy it again",
        ) from error


def check_size(path: str | Path, cols: int, rows: int) -> None:
    """Raise MapFileError unless there is at least one pixel and at most MAX_PIXELS."""
    if not 0 < rows * cols <= MAX_PIXELS:
        text = f"{path}: expected 1 to {MAX_PIXELS} pixels, got {cols} x {rows}"
        raise MapFileError(text, hint=_SIZE_HINT)


def _check_affordable(path: Path, image: ImageFile, most_bytes: int) -> None:
    from PIL.Image import DECODERS  # noqa: PLC0415

    cols, rows = image.size
    pixel_bytes = _DECODED.get(image.mode, 4)
    if image.format == "JPEG":
        pixel_bytes += _COEFFICIENTS * len(image.getbands())
    needed = rows * cols * pixel_bytes + stripe_rows(cols) * cols * STRIPE_BYTES
    if needed > most_bytes:
        raise MapFileError(
            f"{path}: {cols} x {rows} pixels ({image.mode}) take {needed / 1e6:.1f} MB to read, "
            f"more than the {most_bytes / 1e6:.1f} MB available",
            hint="save it as 8-bit grey, or with larger pixels, or raise the memory limit",
        )
    is_slow = any(tile[0] in DECODERS for tile in image.tile)
    if is_slow and rows * cols > SLOW_PIXELS:
        raise MapFileError(
            f"{path}: {cols} x {rows} pixels in a format that is slow to read; the limit is "
            f"{SLOW_PIXELS} pixels",
            hint="save it as PNG",
        )


def _decoded(path: Path, image: Image.Image) -> MapImage:
    is_grey = image.mode in ("1", "L") and "transparency" not in image.info
    white = 65535 if image.mode.startswith("I") else 255 if is_grey else 3 * 255
    if white == 3 * 255 and image.mode not in ("1", "L", "LA", "P", "RGB", "RGBA"):
        raise MapFileError(
            f"{path}: expected grey, palette or RGB pixels, got {image.mode}",
            hint="save it as 8-bit grey",
        )
    image.load()
    cols, rows = image.size
    return MapImage(rows, cols, white, image)


def values_of(
    mode: str, thresholds: tuple[float, float], white: int, negate: bool
) -> NDArray[np.int8]:
    """Return the cell value, int8 (white + 1,), of each brightness level."""
    brightness = np.arange(white + 1) / white
    if mode == "raw":
        value = np.rint(brightness * 255)
        return np.where(value <= OCCUPIED, value, UNKNOWN).astype(np.int8)
    occupied = brightness if negate else 1 - brightness
    free_thresh, occupied_thresh = thresholds
    between = np.full(white + 1, float(UNKNOWN))
    if mode == "scale":
        between = np.rint((occupied - free_thresh) / (occupied_thresh - free_thresh) * 100)
    below, above = occupied < free_thresh, occupied > occupied_thresh
    return np.select([below, above], [FREE, OCCUPIED], between).astype(np.int8)


def settle(
    image: MapImage, values: NDArray[np.int8], mode: str, *, negate: bool, is_mask: bool
) -> str:
    """Set the value of map_saver's grey 205 to unknown; return a fault of the keys, "" for none.

    Args:
        image, mode, negate: content of the map file.
        values: int8 (white + 1,), the cell value of each level. Changed in place.
        is_mask: whether unknown counts as free.
    """
    never_seen = NEVER_SEEN * image.white // 255
    given = values[never_seen]
    if mode == "raw":
        # Raw images hold 0 .. 100, and 255 for unknown.
        lost = _counts(image)[OCCUPIED + 1 : 255].sum()
        return RAW.format(lost) if lost else ""
    if given == UNKNOWN:
        return ""
    counts = _counts(image)
    unseen = counts[NEVER_SEEN]
    if negate:
        is_savers = unseen and counts[SEEN_FREE] and given == OCCUPIED
        return NEGATED.format(unseen) if is_savers else ""
    # If more than half of the grey pixels have this grey, map_saver wrote it.
    is_grey = (values[:: image.white // 255] != OCCUPIED) & (np.arange(256) < SEEN_FREE)
    if is_mask or 2 * unseen <= counts[is_grey].sum():
        return ""
    values[never_seen] = UNKNOWN
    return UNSEEN.format(unseen, "free" if given == FREE else f"{given} % occupied")


def _counts(image: MapImage) -> NDArray[np.int64]:
    """Return the number of pixels of each level, scaled down to 0 .. 255, int64 (256,)."""
    counts = np.zeros(256, np.int64)
    for stripe in image.stripes():
        levels = stripe.levels // np.uint16(image.white // 255)
        counts += np.bincount(levels.ravel(), minlength=256)
    return counts


def yaw_in_degrees(yaw: float) -> str:
    """Return the fault of an origin's yaw of more than a full turn; "" for none."""
    if abs(yaw) <= 2.0 * math.pi:
        return ""
    radians = f"{math.radians(yaw):.4f}"
    return f"origin's yaw is in radians, got {yaw:g}: if these are degrees, write {radians}"
