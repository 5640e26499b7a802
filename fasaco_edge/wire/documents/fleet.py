"""Fleet documents: messages between robots that share an area.

The sender is named by the key, never by the message: access rules hold for keys. A reader refuses
values beyond a limit, because the sender is a foreign computer.
"""

from __future__ import annotations

from typing import Annotated, Final

import msgspec
from msgspec import Meta

from fasaco_edge.errors import FleetError, MalformedMessage
from fasaco_edge.wire.documents.json_text import OF_JSON, Angle, Coordinate, Document, Text
from fasaco_edge.wire.limits import (
    MAX_FLEET_INDEX,
    MAX_FLEET_PARTS,
    MAX_FLEET_POINTS,
    MAX_FLEET_TILES,
    MAX_JSON_BYTES,
    MAX_RESOLUTION_M,
    MIN_RESOLUTION_M,
)

FLEET_VERSION: Final = 1
# Edge of a tile [cells], and its bytes: a bit a cell.
TILE: Final = 64
TILE_BYTES: Final = TILE * TILE // 8
MOST_TILE_INDEX: Final = MAX_FLEET_INDEX // TILE

Point = tuple[Coordinate, Coordinate]
Named = Annotated[str, Meta(min_length=1, max_length=256)]
Whole = Annotated[int, Meta(ge=0, le=2**31 - 1)]
Pace = Annotated[float, Meta(ge=1e-3, le=3600)]
CellEdge = Annotated[float, Meta(ge=MIN_RESOLUTION_M, le=MAX_RESOLUTION_M)]
CellIndex = Annotated[int, Meta(ge=-MAX_FLEET_INDEX, le=MAX_FLEET_INDEX)]
TileIndex = Annotated[int, Meta(ge=-MOST_TILE_INDEX, le=MOST_TILE_INDEX)]


class CellTile(msgspec.Struct, frozen=True, array_like=True):
    """Some cells of a tile of 64 x 64: swept ones, or reachable ones.

    Attributes:
        row, col: place of the tile; its first cell is at 64 times these numbers.
        cells: 512 bytes in base64: a bit for each cell, row by row, most significant bit first.
    """

    row: TileIndex
    col: TileIndex
    cells: Annotated[bytes, Meta(min_length=TILE_BYTES, max_length=TILE_BYTES)]


class FleetPart(msgspec.Struct, frozen=True, array_like=True):
    """What a division gives to a robot: the cells to which it has the least travel time.

    Attributes:
        robot: its name.
        row, col: the cell that travel times are counted from.
        handicap_s: added to the travel times [s].
        step_s: its time to sweep one cell [s].
    """

    robot: Text
    row: CellIndex
    col: CellIndex
    handicap_s: Annotated[float, Meta(ge=-1e9, le=1e9)]
    step_s: Pace


class FleetMember(Document, frozen=True):
    """A robot of a fleet, described by itself.

    Attributes:
        version: version of the message.
        fleet: name of the fleet.
        cell_m: edge of a cell [m].
        frame: frame of the map.
        state: state of the mission, as in the status.
        x, y: position of the robot [m] in the frame of the map.
        step_s: time it takes to sweep a cell [s].
        epoch: changes whenever the robot drops some of its swept cells.
        division: number of the newest division of the remaining cells that it knows.
        open_cells: number of cells known to it that are still to sweep.
        swept: its swept tiles: changed ones first, then all in turn.
        kept: tiles of the cells that it swept before this epoch, without empty tiles; null if
            unknown.
        lattice_deg: the angle of its cells' rows to the x axis of the map frame [deg].
        ground: tiles of cells that it can reach: changed ones first, then all in turn.
        by: name of the robot that made the newest division.
        parts: the part of each robot in the newest division; none without a division.
        radius_m: radius of the robot's disc [m].
        ahead: points x, y of the path's next metres [m], in the frame of the map.
        origin: where the origin of its map frame lies in the fleet's frame: x, y [m], the angle
            [deg]; 0 if the robots share one map frame.
        waits_for: name of the robot that it waits for or makes way for; a robot without a part
            names the robot with the largest part left; "" for none.
    """

    version: Annotated[int, Meta(ge=1)]
    fleet: Text
    cell_m: CellEdge
    frame: Text
    state: Named
    x: Coordinate
    y: Coordinate
    step_s: Pace
    epoch: Annotated[int, Meta(ge=1, le=2**62)]
    division: Whole
    open_cells: Whole
    swept: Annotated[tuple[CellTile, ...], Meta(max_length=MAX_FLEET_TILES)]
    lattice_deg: Annotated[float, Meta(ge=-90, le=90)] = 0.0
    ground: Annotated[tuple[CellTile, ...], Meta(max_length=MAX_FLEET_TILES)] = ()
    by: Text = ""
    parts: Annotated[tuple[FleetPart, ...], Meta(max_length=MAX_FLEET_PARTS)] = ()
    radius_m: Annotated[float, Meta(ge=0, le=100)] = 0.0
    ahead: Annotated[tuple[Point, ...], Meta(max_length=MAX_FLEET_POINTS)] = ()
    waits_for: Text = ""
    origin: tuple[Coordinate, Coordinate, Angle] = (0.0, 0.0, 0.0)
    kept: Annotated[tuple[CellTile, ...], Meta(max_length=MAX_FLEET_TILES)] | None = None


class _Head(msgspec.Struct, frozen=True):
    version: Whole
    fleet: Text


def fleet_of(payload: bytes) -> str | None:
    """Return the name of the fleet that a message is for; None if it cannot be read."""
    try:
        return msgspec.json.decode(payload, type=_Head).fleet
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None


def decode_member(payload: bytes, fleet: str) -> FleetMember | None:
    """Return a robot's message; None from another fleet.

    Raises:
        FleetError: it is of another version.
        MalformedMessage: it is malformed.
    """
    if len(payload) > MAX_JSON_BYTES:
        raise MalformedMessage(f"fleet: must have at most {MAX_JSON_BYTES} bytes", hint=OF_JSON)
    try:
        head = msgspec.json.decode(payload, type=_Head)
        if head.fleet != fleet:
            return None
        if head.version != FLEET_VERSION:
            raise FleetError(
                f"its messages are of version {head.version}, not {FLEET_VERSION}",
                hint="install the same release on all robots of the fleet",
            )
        return msgspec.json.decode(payload, type=FleetMember)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise MalformedMessage(f"fleet: {error}", hint=OF_JSON) from error
