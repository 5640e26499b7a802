"""A ledger as bytes: checksummed as a whole, versioned, the same on every machine.

All versions share the envelope, to distinguish a file of another version from a broken one.
Little endian:

    magic      8 bytes
    version    uint32
    checksum   uint32    CRC-32 of version, length and body
    length     uint64    of the body; nothing follows it
    body                 compressed by zlib

    cell_m     float64   edge of a cell [m]
    total      uint64    visits in all
    counts     7 uint32  bytes of the frame, cells under the tool, tiles, tiles of floor, rows and
                         columns of the trail, bytes of the fleet
    angle      float64   of the cells' rows to the x axis of the map frame [deg]
    frame      UTF-8
    cells      int64 (row, col) of each cell under the tool
    places     int64 (row, col) of each tile
    tiles      uint16 (TILE, TILE) of each tile
    floor      int64 (row, col) of each tile of floor
    swept      uint8 (FLOOR_TILE, FLOOR_TILE / 8) of each: a bit for each pixel of 0.025 m, most
               significant bit first
    corner     int64 (row, col) where the trail begins
    trail      uint8 (2, rows, cols, 4): pheromone as float32, rounded to the upper 16 bits: all
               high bytes, then all low bytes
    fleet      cells swept by other robots, JSON (``fleet.mission.shared``)
    note       UTF-8, up to the end: JSON of the order, with a version of its own; may be empty

Versions 1 to 4 are read, too. Version 4 lacks ``angle``; it is written if the cells are aligned
with the axes of the map frame. Version 3 also lacks ``fleet`` and its count; it is written if there
is no fleet, either. Version 2 also lacks the trail: its counts, ``corner`` and ``trail``. Version 1
also lacks the floor: the fourth count, ``floor`` and ``swept``.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import LedgerFileError, LedgerMismatchError
from fasaco_edge.grid.geometry import MAX_LATTICE_CELLS, Window
from fasaco_edge.mission.coverage.floor_tiles import FLOOR_TILE, ROW_BYTES, FloorSnapshot
from fasaco_edge.mission.coverage.ledger import MOST_TILES, TILE, LedgerSnapshot
from fasaco_edge.mission.coverage.swept_floor import MOST_FLOOR_TILES
from fasaco_edge.planners.living_trail import NO_TRAIL, TrailSnapshot

MAGIC = b"FASACOLG"
VERSION = 5

_ENVELOPE = struct.Struct("<8sIIQ")
_CHECKED = struct.Struct("<IQ")
_COUNTS = {1: "3I", 2: "4I", 3: "6I", 4: "7I", 5: "7Id"}
_HEADS = {version: struct.Struct(f"<dQ{counts}") for version, counts in _COUNTS.items()}
_PLACE_BYTES, _TILE_BYTES, _FLOOR_BYTES = 16, 2 * TILE * TILE, FLOOR_TILE * ROW_BYTES
# Bytes of a cell: two for each direction.
_TRAIL_BYTES = 8
# Everything but the tiles is small: frame, cells under the tool, the order, the fleet.
MOST_BYTES = (
    MOST_TILES * (_TILE_BYTES + _PLACE_BYTES)
    + MOST_FLOOR_TILES * (_FLOOR_BYTES + _PLACE_BYTES)
    + MAX_LATTICE_CELLS * _TRAIL_BYTES
    + 16_000_000
)
"""Limit on the bytes of a body, and of a file; longer files are not read."""
# Largest angle of the cells, which are symmetric under a quarter-turn [deg].
MOST_LATTICE_DEG = 90.0
# Pheromone values rounded at a time.
_AT_ONCE = 1 << 18
# The fastest level of zlib packs the bytes, mostly zeros and ones, to a hundredth of their size.
_LEVEL = 1


def encode_ledger(snapshot: LedgerSnapshot) -> bytes:
    """Return a ledger encoded as a file."""
    # Encoded part by part, so that a large ledger is not copied as a whole.
    deflater = zlib.compressobj(_LEVEL)
    body = b"".join([*map(deflater.compress, _parts(snapshot)), deflater.flush()])
    version = _version_of(snapshot)
    return _ENVELOPE.pack(MAGIC, version, _checksum(version, body), len(body)) + body


def _version_of(snapshot: LedgerSnapshot) -> int:
    if snapshot.lattice_deg:
        return 5
    return 4 if snapshot.fleet else 3


def _parts(snapshot: LedgerSnapshot) -> Iterator[bytes]:
    frame, floor = snapshot.frame.encode(), snapshot.floor.tiles
    counts = (len(frame), len(snapshot.under_tool), len(snapshot.tiles), len(floor))
    # A larger trail would make the ledger unreadable.
    trail = snapshot.trail if snapshot.trail.tau.size <= 4 * MAX_LATTICE_CELLS else NO_TRAIL
    version = _version_of(snapshot)
    more = (*trail.tau.shape[:2], len(snapshot.fleet), snapshot.lattice_deg)[: version - 1]
    yield _HEADS[version].pack(snapshot.cell_m, snapshot.total, *counts, *more)
    yield frame
    yield np.array(sorted(snapshot.under_tool), "<i8").tobytes()
    yield np.array(sorted(snapshot.tiles), "<i8").tobytes()
    for place in sorted(snapshot.tiles):
        yield snapshot.tiles[place].astype("<u2").tobytes()
    yield np.array(sorted(floor), "<i8").tobytes()
    for place in sorted(floor):
        yield floor[place].tobytes()
    yield np.array((trail.window.row0, trail.window.col0), "<i8").tobytes()
    for plane in (24, 16):
        for bits in np.array_split(trail.tau.view(np.uint32), -(-trail.tau.size // _AT_ONCE) or 1):
            rounded = bits + 0x7FFF + ((bits >> 16) & 1)
            yield (rounded >> plane).astype(np.uint8).tobytes()
    yield snapshot.fleet
    yield snapshot.note.encode()


def decode_ledger(payload: bytes, cell_m: float | None) -> LedgerSnapshot:
    """Return the ledger in a file's bytes.

    Args:
        payload: the bytes.
        cell_m: configured edge of a cell [m]; a ledger with other cells is accepted if it has swept
            floor. None accepts any cells.

    Raises:
        LedgerFileError: the bytes are damaged.
        LedgerMismatchError: the ledger has another version, or other cells and no floor.
    """
    if len(payload) < _ENVELOPE.size:
        raise LedgerFileError(f"torn: {len(payload)} bytes")
    magic, version, checksum, length = _ENVELOPE.unpack_from(payload)
    body = payload[_ENVELOPE.size :]
    if magic != MAGIC:
        raise LedgerFileError("not a ledger")
    if length != len(body):
        raise LedgerFileError(f"torn: {len(body)} of {length} bytes")
    if checksum != _checksum(version, body):
        raise LedgerFileError("wrong checksum")
    if version not in _HEADS:
        raise LedgerMismatchError(
            f"the ledger is of version {version}, this release reads versions 1 to {VERSION}",
            hint="to continue with it, install the release that wrote it and rename the file back",
        )
    try:
        snapshot = _decode_body(_inflated(body), version)
    except (zlib.error, struct.error, ValueError) as error:
        raise LedgerFileError(f"malformed: {error}") from error
    is_bare = bool(snapshot.tiles) and not snapshot.floor.tiles
    if cell_m is not None and snapshot.cell_m != cell_m and is_bare:
        raise LedgerMismatchError(
            f"the ledger's cells are {snapshot.cell_m} m wide, the configuration's {cell_m} m",
            hint=f"to continue with it, set robot.tool_width_m to {snapshot.cell_m} (and "
            "robot.overlap, planner.line to what they were), and rename the file back",
        )
    return snapshot


def _inflated(body: bytes) -> bytes:
    inflater = zlib.decompressobj()
    plain = inflater.decompress(body, MOST_BYTES)
    if inflater.unconsumed_tail:
        raise ValueError(f"over {MOST_BYTES} bytes")
    if not inflater.eof or inflater.unused_data:
        raise ValueError("the compressed data is incomplete, or more follows it")
    return plain


def _decode_body(plain: bytes, version: int) -> LedgerSnapshot:
    head = _HEADS[version]
    cell_m, total, *counts = head.unpack_from(plain)
    frame_bytes, cell_count, tile_count, floor_count, rows, cols, fleet_bytes, lattice_deg = (
        *counts,
        *(0, 0, 0, 0, 0.0),
    )[:8]
    for count, most in ((tile_count, MOST_TILES), (floor_count, MOST_FLOOR_TILES)):
        if count > most:
            raise ValueError(f"{count} tiles, at most {most} are read")
    if rows * cols > MAX_LATTICE_CELLS:
        raise ValueError(f"trail of {rows} x {cols} cells, at most {MAX_LATTICE_CELLS} are read")
    frame_end = head.size + frame_bytes
    cells_end = frame_end + _PLACE_BYTES * cell_count
    tiles_end = cells_end + (_PLACE_BYTES + _TILE_BYTES) * tile_count
    floor_end = tiles_end + (_PLACE_BYTES + _FLOOR_BYTES) * floor_count
    trail_end = floor_end + (_PLACE_BYTES + _TRAIL_BYTES * rows * cols if version >= 3 else 0)
    fleet_end = trail_end + fleet_bytes
    if len(plain) < fleet_end:
        raise ValueError(
            f"{len(plain)} bytes do not hold {tile_count} + {floor_count} tiles and "
            f"{rows} x {cols} cells of trail"
        )
    if not (math.isfinite(cell_m) and cell_m > 0):
        raise ValueError(f"cells of {cell_m} m")
    # A negated comparison also catches NaN.
    if not abs(lattice_deg) <= MOST_LATTICE_DEG:
        raise ValueError(f"cells at {lattice_deg} degrees")
    tiles = _tiles(plain, cells_end, tile_count, np.dtype("<u2"), (TILE, TILE))
    swept = _tiles(plain, tiles_end, floor_count, np.dtype(np.uint8), (FLOOR_TILE, ROW_BYTES))
    return LedgerSnapshot(
        cell_m=cell_m,
        frame=plain[head.size : frame_end].decode(),
        total=total,
        tiles=MappingProxyType(
            {place: tile.astype(np.uint16, copy=False) for place, tile in tiles.items()}
        ),
        under_tool=frozenset(_places(plain[frame_end:cells_end])),
        floor=FloorSnapshot(MappingProxyType(swept)),
        note=plain[fleet_end:].decode(),
        fleet=plain[trail_end:fleet_end],
        trail=_trail(plain[floor_end:trail_end], rows, cols) if version >= 3 else NO_TRAIL,
        lattice_deg=lattice_deg,
    )


def _trail(plain: bytes, rows: int, cols: int) -> TrailSnapshot:
    row0, col0 = np.frombuffer(plain, "<i8", 2).tolist()
    shape = 2, rows, cols, 4
    high, low = np.frombuffer(plain, np.uint8, offset=_PLACE_BYTES).reshape(shape)
    tau = ((high.astype(np.uint32) << 24) | (low.astype(np.uint32) << 16)).view(np.float32)
    if not (np.isfinite(tau).all() and (tau >= 0).all()):
        raise ValueError("pheromone below 0, or not finite")
    return TrailSnapshot(Window(row0, col0, row0 + rows, col0 + cols), tau)


def _tiles(
    plain: bytes, start: int, count: int, kind: np.dtype[Any], shape: tuple[int, int]
) -> dict[tuple[int, int], NDArray[Any]]:
    """Return tiles by place: views of the bytes, read-only, so that nothing is copied."""
    begin = start + _PLACE_BYTES * count
    tiles = np.frombuffer(plain, kind, count * math.prod(shape), begin).reshape(count, *shape)
    return dict(zip(_places(plain[start:begin]), tiles, strict=True))


def _places(plain: bytes) -> list[tuple[int, int]]:
    pairs: NDArray[np.int64] = np.frombuffer(plain, "<i8").reshape(-1, 2)
    return [(row, col) for row, col in pairs.tolist()]


def _checksum(version: int, body: bytes) -> int:
    return zlib.crc32(body, zlib.crc32(_CHECKED.pack(version, len(body))))
