"""Map files: map_server's YAML and image, coverage grids, and built-in maps.

A map file is interpreted as by nav2_map_server (map_io.cpp). Its releases differ on transparent
pixels in trinary mode: older ones average the alpha channel into the brightness, so that opaque
black is 75 % occupied (navigation2 issue 4233); in newer ones a transparent pixel is unknown, as it
always was in scale mode. Here, alpha is never a brightness, and a transparent pixel is unknown.
Keys that contradict the image, or make never-seen ground free, are logged (``map_images``).
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from numbers import Real
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from fasaco_edge.errors import MapFileError
from fasaco_edge.grid.geometry import (
    FARTHEST_M,
    MAX_RESOLUTION_M,
    MIN_RESOLUTION_M,
    GridGeometry,
    Pose2D,
)
from fasaco_edge.grid.map_images import (
    MapImage,
    check_size,
    read_image,
    settle,
    values_of,
    yaw_in_degrees,
)
from fasaco_edge.grid.occupancy import UNKNOWN, OccupancyGrid
from fasaco_edge.host.documents import StrictDocument, inspected
from fasaco_edge.host.files import check_plain
from fasaco_edge.host.plain_yaml import read_written
from fasaco_edge.host.resources import folder
from fasaco_edge.text import nearest, shown, suggestion

LOG = logging.getLogger(__name__)

IMAGE_SUFFIXES = (".pgm", ".png", ".bmp", ".jpg", ".jpeg")
MAP_SUFFIXES = (".yaml", ".yml", ".npy", *IMAGE_SUFFIXES)
# Number of maps in a folder that an error lists.
MOST_LISTED = 5
# Thresholds of ROS 1's map_saver, by which its grey for unknown, 205, is not free.
FREE_THRESH, OCCUPIED_THRESH = 0.196, 0.65

Mode = Literal["trinary", "scale", "raw"]
_Coordinate = Annotated[float, Meta(ge=-FARTHEST_M, le=FARTHEST_M)]

# What to do about a fault inside a file.
GRID_HINT = "give a bool array (rows, cols), True = coverable, as free.astype(bool)"
_YAML_HINT = "correct it: a map file that is not .npy is read as a map_server YAML file"
_MISSING_HINT = "name a file that exists and may be read"
_KEY_HINTS = {
    "image": "image is a path from this file's folder, from / or from ~",
    "resolution": "resolution is the edge of a pixel in metres, as 0.05",
    "origin": "origin is [x, y, yaw] of the lower left corner: metres, metres, radians",
    "negate": "negate is 0, or 1 for an image whose free floor is black",
    "mode": "mode is trinary for maps of map_saver",
    "free_thresh": "map_saver writes free_thresh: 0.196 or 0.25",
    "occupied_thresh": "map_saver writes occupied_thresh: 0.65",
}


def read_map(path: str | Path) -> OccupancyGrid:
    """Return the map described by a map_server YAML file.

    Args:
        path: the YAML file; its ``image`` is relative to the YAML's folder, ``~`` is a home folder.
            Missing thresholds are ``FREE_THRESH`` and ``OCCUPIED_THRESH``.

    Raises:
        MapFileError: a file is missing, of another format or too large; a key is missing or its
            value impossible.
    """
    return _grid(*read_map_rows(path))


def read_map_rows(
    path: str | Path, most_bytes: int | None = None, *, is_mask: bool = False
) -> tuple[GridGeometry, Iterator[NDArray[np.int8]]]:
    """Return a map's geometry, and its rows from the smallest y up, as ``read_map`` reads them.

    Args:
        path: the YAML file.
        most_bytes: memory limit for reading the image [bytes]; None for no limit.
        is_mask: whether only occupied pixels count, and unknown ones are free.

    Returns:
        The geometry, and stripes of the map, int8 (some, cols): each but the last has a multiple
        of 8 rows.

    Raises:
        MapFileError: as ``read_map``, or the image exceeds the limit.
    """
    path = Path(path)
    if path.suffix.lower() in IMAGE_SUFFIXES:
        raise MapFileError(
            f"{path}: an image alone has no resolution",
            hint="give --resolution (metres a pixel), or the map_server YAML file beside it",
        )
    keys, file = _read_keys(path)
    image = read_image(file, most_bytes)
    mode, origin, negate = keys.mode, Pose2D(*keys.origin), bool(keys.negate)
    thresholds = keys.free_thresh, keys.occupied_thresh
    geometry = GridGeometry(image.rows, image.cols, keys.resolution, origin)
    values = values_of(mode, thresholds, image.white, negate)
    conflict = settle(image, values, mode, negate=negate, is_mask=is_mask)
    for text in filter(None, (yaw_in_degrees(origin.yaw), conflict)):
        LOG.warning("%s: %s", path, text, extra={"event": "map_file"})
    return geometry, _cells(image, values, mode)


def read_bare_image(path: str | Path, resolution_m: float) -> OccupancyGrid:
    """Return the map in an image without a YAML file.

    Its lower left corner is the origin of the map frame; thresholds are map_server's defaults:
    trinary, black is occupied.

    Args:
        path: PGM, PNG, BMP or JPEG.
        resolution_m: edge of a pixel [m].

    Raises:
        MapFileError: the file is missing, no image, damaged or too large, or has a resolution of
            its own; or ``resolution_m`` is impossible.
    """
    path = Path(path)
    if path.suffix.lower() in (".yaml", ".yml", ".npy"):
        kind = "a coverage grid" if path.suffix.lower() == ".npy" else "a map_server YAML file"
        own = "has cells of --cell" if kind == "a coverage grid" else "has a resolution of its own"
        raise MapFileError(
            f"{path}: {kind} {own}; --resolution is for an image alone",
            hint="leave --resolution out, or give the image",
        )
    is_number = isinstance(resolution_m, Real)
    if not (is_number and MIN_RESOLUTION_M <= resolution_m <= MAX_RESOLUTION_M):
        raise MapFileError(
            f"{path}: resolution must be from {MIN_RESOLUTION_M:g} to {MAX_RESOLUTION_M:g} "
            f"[m/pixel], got {shown(resolution_m)}",
            hint="give the edge of a pixel in metres, as 0.05",
        )
    image = read_image(path)
    geometry = GridGeometry(image.rows, image.cols, resolution_m, Pose2D(0, 0, 0))
    values = values_of("trinary", (FREE_THRESH, OCCUPIED_THRESH), image.white, negate=False)
    return _grid(geometry, _cells(image, values, "trinary"))


def _cells(image: MapImage, values: NDArray[np.int8], mode: str) -> Iterator[NDArray[np.int8]]:
    """Yield the rows of a map, int8 (some, cols), from the smallest y up.

    ``values``: int8 (white + 1,), the cell value of each level.
    """
    for stripe in image.stripes():
        cells = values[stripe.levels]
        if stripe.transparent is not None and mode != "raw":
            cells[stripe.transparent] = UNKNOWN
        yield cells


def _grid(geometry: GridGeometry, stripes: Iterator[NDArray[np.int8]]) -> OccupancyGrid:
    cells = np.empty((geometry.rows, geometry.cols), np.int8)
    row = 0
    for stripe in stripes:
        cells[row : row + len(stripe)] = stripe
        row += len(stripe)
    return OccupancyGrid(geometry, cells)


def map_sources(path: Path) -> list[Path]:
    """Return the files of a map: itself, and the image that a YAML file names.

    Raises:
        MapFileError: it is not a YAML file, or names no image.
    """
    if path.suffix.lower() in (*IMAGE_SUFFIXES, ".npy"):
        return [path]
    return [path, _read_keys(path)[1]]


def read_coverage_grid(path: str | Path) -> NDArray[np.bool_]:
    """Return the coverage grid, bool (rows, cols), True = coverable, of a .npy file.

    Raises:
        MapFileError: the file is missing, not a .npy file, of another type or
            dimension, empty or too large.
    """
    try:
        check_plain(path)
        # Memory-mapped first, so that a header that claims a huge array costs nothing.
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError, OverflowError, TypeError) as error:
        raise MapFileError(
            f"{path}: not readable as a .npy file: {error}",
            hint="write it with numpy.save(file, free), and see that it may be read",
        ) from error
    if not isinstance(array, np.ndarray):
        array.close()
        raise MapFileError(
            f"{path}: expected one array (.npy), got an archive of arrays",
            hint="write one array with numpy.save, not with numpy.savez",
        )
    if array.ndim != 2 or array.dtype != np.bool_:
        raise MapFileError(
            f"{path}: expected a bool array of two dimensions, got {array.dtype} {array.shape}",
            hint=GRID_HINT,
        )
    check_size(path, array.shape[1], array.shape[0])
    # Other programs may write any byte except 0 for True; kernels read only the lowest bit.
    cells: NDArray[np.bool_] = np.ascontiguousarray(array).view(np.uint8) != 0
    return cells


def find_map(name_or_path: str | Path) -> Path:
    """Return the path of an existing file, or of a built-in map by its name.

    Raises:
        MapFileError: it is neither.
    """
    # Unlike Path's methods these do not raise on names that no file system allows.
    path = Path(os.path.expanduser(name_or_path))
    if os.path.isfile(path):
        return path
    names = [name for name, _ in builtin_maps()]
    if str(name_or_path) in names:
        return _maps() / f"{name_or_path}.yaml"
    if str(name_or_path) and os.path.isdir(path):
        inside = [path / name for name in _map_names(path) if name.endswith((".yaml", ".yml"))]
        listed = ", ".join(map(str, inside[:MOST_LISTED])) + ", ..." * (len(inside) > MOST_LISTED)
        hint = f"give one of its maps: {listed}" if inside else "it has no .yaml of a map"
        raise MapFileError(f"{str(name_or_path)!r} is a folder", hint=hint)
    raise MapFileError(
        f"no map {str(name_or_path)!r}: neither a file nor a built-in map ({', '.join(names)})",
        hint=suggestion(str(name_or_path), names) or _beside(path) or None,
    )


def _beside(path: Path) -> str:
    """Return a question for the map file that a missing file's name resembles; "" for none."""
    near = nearest(path.name, _map_names(path.parent))
    return "".join(f"did you mean {path.with_name(name)}?" for name in near)


def _map_names(folder: Path) -> list[str]:
    """Return the names of the map files in a folder, sorted; [] if it cannot be read."""
    try:
        return sorted(each.name for each in folder.iterdir() if each.suffix in MAP_SUFFIXES)
    except (OSError, ValueError):
        return []


def builtin_maps() -> list[tuple[str, str]]:
    """Return name and purpose, one line, of each built-in map.

    Raises:
        MapFileError: this installation has no maps.
    """
    return [(name, entry.why) for name, entry in _index().items()]


def suggested_start(path: Path) -> tuple[float, float] | None:
    """Return the start (x, y) [m] of a built-in map; None for any other file.

    Raises:
        MapFileError: this installation has no maps.
    """
    entry = _index().get(path.stem)
    if entry is None or path.resolve() != (_maps() / f"{path.stem}.yaml").resolve():
        return None
    return entry.start


class _BuiltIn(msgspec.Struct):
    why: str
    start: tuple[float, float]


def _maps() -> Path:
    try:
        return folder("maps")
    except FileNotFoundError as error:
        hint = "install the package again, or name a map file of your own"
        raise MapFileError(str(error), hint=hint) from error


def _index() -> dict[str, _BuiltIn]:
    text = read_written(_maps() / "index.yaml", MapFileError, missing=_MISSING_HINT)
    return msgspec.convert(text.values, dict[str, _BuiltIn])


# Keys whose numbers may be texts: in quotes, or like -.5, which is no number in YAML 1.1.
NUMBERS = ("resolution", "origin", "occupied_thresh", "free_thresh")


class MapKeys(StrictDocument, frozen=True):
    """The keys of a map_server YAML file, which may have further keys of other programs."""

    is_open: ClassVar[bool] = True

    image: Annotated[str, Meta(min_length=1)]
    resolution: Annotated[float, Meta(ge=MIN_RESOLUTION_M, le=MAX_RESOLUTION_M)]
    origin: tuple[_Coordinate, _Coordinate, _Coordinate]
    negate: Literal[0, 1] | bool
    mode: Mode = "trinary"
    free_thresh: Annotated[float, Meta(ge=0, le=1)] = FREE_THRESH
    occupied_thresh: Annotated[float, Meta(ge=0, le=1)] = OCCUPIED_THRESH

    def faults(self) -> Iterator[MapFileError]:
        free, occupied = self.free_thresh, self.occupied_thresh
        if free >= occupied:
            text = f"must be less than occupied_thresh, {occupied:g}, got {free:g}"
            yield MapFileError(text, key="free_thresh", others=["occupied_thresh"])


def _unquoted(value: object) -> object:
    """Return the numbers that texts contain, as map_server reads them; other values as they are."""
    if isinstance(value, list):
        return [_unquoted(each) for each in value]
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _read_keys(path: Path) -> tuple[MapKeys, Path]:
    """Return the keys of a YAML file, and the image that it names."""
    text = read_written(path, MapFileError, missing=_MISSING_HINT, broken=_YAML_HINT)
    values = {} if text.values is None else text.values
    if isinstance(values, dict):
        values = values | {key: _unquoted(values[key]) for key in NUMBERS if key in values}
    keys, faults = inspected(MapKeys, values, MapFileError)
    image = path
    if keys and keys.image:
        image = path.parent / os.path.expanduser(keys.image)
        if not os.path.isfile(image):
            faults.append(MapFileError(f"no file {shown(str(image))}", key="image"))
    for fault in (*text.twice, *faults):
        fault.advise(_KEY_HINTS.get(fault.key.partition("[")[0], _YAML_HINT))
    text.check(faults)
    return keys, image
