"""Map images: brightness and transparency of their pixels."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import MapFileError

if TYPE_CHECKING:
    from PIL import Image

MAX_PIXELS = 64_000_000

# nav2's three recommended formats; PPM is Pillow's name for the PGM family.
FORMATS = ("PPM", "PNG", "BMP")


@dataclass(frozen=True, slots=True, eq=False)
class MapImage:
    """An image as a map is read from it.

    Attributes:
        levels: uint8 or uint16 (rows, cols), top row first: brightness, 0 black to
            ``white``; the mean over the colour channels, alpha is none of them.
        white: the brightest level.
        transparent: bool (rows, cols), or None where the image has no alpha channel.
    """

    levels: NDArray[np.uint8] | NDArray[np.uint16]
    white: int
    transparent: NDArray[np.bool_] | None = None


def read_image(path: Path) -> MapImage:
    """Return the pixels of a PGM, PNG or BMP file.

    Raises:
        MapFileError: it is missing, no such image, damaged, empty or too large.
    """
    # Pillow is loaded with the first image: a daemon that never reads one does without.
    from PIL import Image, UnidentifiedImageError  # noqa: PLC0415

    try:
        with warnings.catch_warnings():
            # check_size has the smaller limit.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(path, formats=FORMATS)
        with image:
            check_size(path, *image.size)
            return _decoded(path, image)
    except Image.DecompressionBombError as error:
        raise MapFileError(f"{path}: more than {MAX_PIXELS} pixels: {error}") from error
    except UnidentifiedImageError as error:
        raise MapFileError(f"{path}: not an image (PGM, PNG or BMP)") from error
    except (OSError, ValueError, SyntaxError) as error:
        raise MapFileError(f"{path}: not readable as an image: {error}") from error


def check_size(path: str | Path, cols: int, rows: int) -> None:
    """Raise MapFileError unless there is at least one pixel and at most MAX_PIXELS."""
    if not 0 < rows * cols <= MAX_PIXELS:
        raise MapFileError(f"{path}: expected 1 to {MAX_PIXELS} pixels, got {cols} x {rows}")


def _decoded(path: Path, image: Image.Image) -> MapImage:
    if image.mode.startswith("I"):
        return MapImage(np.asarray(image).astype(np.uint16), 65535)
    if image.mode in ("1", "L") and "transparency" not in image.info:
        return MapImage(np.asarray(image.convert("L")), 255)
    if image.mode not in ("1", "L", "LA", "P", "RGB", "RGBA"):
        raise MapFileError(f"{path}: expected grey, palette or RGB pixels, got {image.mode}")
    pixels = np.asarray(image.convert("RGBA"))
    levels = pixels[:, :, :3].sum(axis=2, dtype=np.uint16)
    return MapImage(levels, 3 * 255, pixels[:, :, 3] < 255)
