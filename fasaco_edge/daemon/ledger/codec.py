"""A ledger as bytes: checksummed as a whole, versioned, the same on every machine.

The envelope is that of every version, so that a file of another version can be told from a
broken one. Little endian:

    magic      8 bytes
    version    uint32
    checksum   uint32    CRC-32 of version, length and body
    length     uint64    of the body; nothing follows it
    body                 version 1: compressed by zlib

    cell_m     float64   edge of a cell [m]
    total      uint64    visits in all
    counts     3 uint32  bytes of the frame, cells under the tool, tiles
    frame      UTF-8
    cells      int64 (row, col) of each cell under the tool
    places     int64 (row, col) of each tile
    tiles      uint16 (TILE, TILE) of each tile
    note       UTF-8, up to the end: JSON of the order, with a version of its own; may be empty
"""

from __future__ import annotations

import math
import struct
import zlib
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import LedgerFileError, LedgerMismatchError
from fasaco_edge.mission.coverage.ledger import MOST_TILES, TILE, LedgerSnapshot

MAGIC = b"FASACOLG"
VERSION = 1

_ENVELOPE = struct.Struct("<8sIIQ")
_CHECKED = struct.Struct("<IQ")
_HEAD = struct.Struct("<dQIII")
_CELL_BYTES, _TILE_BYTES = 16, 2 * TILE * TILE
# What a ledger holds beside its tiles is small: frame, cells under the tool, the order.
MOST_BYTES = MOST_TILES * (_TILE_BYTES + _CELL_BYTES) + 2_000_000
"""Of a body, and of a file, which is smaller; longer ones are not read."""
# Mostly zeros and ones: the fastest level takes a hundredth of the size.
_LEVEL = 1


def encode_ledger(snapshot: LedgerSnapshot) -> bytes:
    """Return a ledger as the bytes of a file."""
    frame = snapshot.frame.encode()
    places, under_tool = sorted(snapshot.tiles), sorted(snapshot.under_tool)
    counts = (len(frame), len(under_tool), len(places))
    plain = b"".join(
        (
            _HEAD.pack(snapshot.cell_m, snapshot.total, *counts),
            frame,
            np.array(under_tool, "<i8").tobytes(),
            np.array(places, "<i8").tobytes(),
            *(snapshot.tiles[place].astype("<u2").tobytes() for place in places),
            snapshot.note.encode(),
        )
    )
    body = zlib.compress(plain, _LEVEL)
    return _ENVELOPE.pack(MAGIC, VERSION, _checksum(VERSION, body), len(body)) + body


def decode_ledger(payload: bytes, cell_m: float | None) -> LedgerSnapshot:
    """Return the ledger in the bytes of a file; ``cell_m``: edge its cells have to have, or None.

    Raises:
        LedgerFileError: they are not what was once written.
        LedgerMismatchError: they are of another version, or the cells are not ``cell_m`` wide.
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
    if version != VERSION:
        raise LedgerMismatchError(
            f"the ledger is of version {version}, this release reads version {VERSION}",
            hint="to go on with it, install the release that wrote it, and give the file its "
            "name back",
        )
    try:
        snapshot = _decode_body(_inflated(body))
    except (zlib.error, struct.error, ValueError) as error:
        raise LedgerFileError(f"malformed: {error}") from error
    if cell_m is not None and snapshot.cell_m != cell_m:
        raise LedgerMismatchError(
            f"the ledger's cells are {snapshot.cell_m} m wide, the configuration's {cell_m} m",
            hint=f"to go on with it, set robot.tool_width_m to {snapshot.cell_m}, and give the "
            "file its name back",
        )
    return snapshot


def _inflated(body: bytes) -> bytes:
    inflater = zlib.decompressobj()
    plain = inflater.decompress(body, MOST_BYTES)
    if inflater.unconsumed_tail:
        raise ValueError(f"over {MOST_BYTES} bytes")
    if not inflater.eof or inflater.unused_data:
        raise ValueError("no whole stream")
    return plain


def _decode_body(plain: bytes) -> LedgerSnapshot:
    cell_m, total, frame_bytes, cell_count, tile_count = _HEAD.unpack_from(plain)
    if tile_count > MOST_TILES:
        raise ValueError(f"{tile_count} tiles, {MOST_TILES} are read at most")
    frame_end = _HEAD.size + frame_bytes
    cells_end = frame_end + _CELL_BYTES * cell_count
    places_end = cells_end + _CELL_BYTES * tile_count
    tiles_end = places_end + _TILE_BYTES * tile_count
    if len(plain) < tiles_end:
        raise ValueError(f"{len(plain)} bytes do not hold {tile_count} tiles")
    if not (math.isfinite(cell_m) and cell_m > 0):
        raise ValueError(f"cells of {cell_m} m")
    # A view of the bytes: read-only, and nothing is copied.
    tiles = np.frombuffer(plain, "<u2", tile_count * TILE * TILE, places_end)
    tiles = tiles.reshape(tile_count, TILE, TILE)
    places = _cells(plain[cells_end:places_end])
    return LedgerSnapshot(
        cell_m=cell_m,
        frame=plain[_HEAD.size : frame_end].decode(),
        total=total,
        tiles=MappingProxyType(dict(zip(places, tiles.astype(np.uint16, copy=False), strict=True))),
        under_tool=frozenset(_cells(plain[frame_end:cells_end])),
        note=plain[tiles_end:].decode(),
    )


def _cells(plain: bytes) -> list[tuple[int, int]]:
    pairs: NDArray[np.int64] = np.frombuffer(plain, "<i8").reshape(-1, 2)
    return [(row, col) for row, col in pairs.tolist()]


def _checksum(version: int, body: bytes) -> int:
    return zlib.crc32(body, zlib.crc32(_CHECKED.pack(version, len(body))))
