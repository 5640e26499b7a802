"""Rooms of an occupancy grid: regions of free floor that doors, openings and mouths separate.

Free-standing furniture is ignored. Doors are narrow gaps between the ends of walls, and a mouth is
the end of a passage or corridor (``kernels.rooms.doors``). An opening is a wide gap in a longer
wall (``kernels.rooms.openings``). Each of them is cut, and each connected part is then a region. A
region too small for a room is joined to a neighbour through its least certain door or mouth. On an
incomplete map, a room is found once enough of its floor has been seen; less floor, seen through a
door, belongs to no room yet.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Point, Pose2D, Window
from fasaco_edge.grid.lattice import beside
from fasaco_edge.grid.occupancy import OccupancyGrid, highest
from fasaco_edge.grid.walls import THRESHOLDS
from fasaco_edge.kernels.lattice.areas import find_areas
from fasaco_edge.kernels.rooms.chords import RoomPixels
from fasaco_edge.kernels.rooms.clearance import clearances
from fasaco_edge.kernels.rooms.doors import LEAST_SURE, DoorLimits, find_doors
from fasaco_edge.kernels.rooms.islands import FurnitureLimits, furniture
from fasaco_edge.kernels.rooms.regions import beside_cuts, draw_cuts, grow

# Approximate edge to which finer pixels are joined [m].
PIXEL_M = 0.05
# Widest door; thickest wall with a door; distance beside a door in which floor has to widen [m].
DOOR_M, WALL_M, BESIDE_M = 1.3, 0.45, 0.5
# Widest opening in a wall, and widest corridor [m].
OPENING_M = 4.0
# Shortest passage whose mouth separates it from a room [m].
PASSAGE_M = 0.8
# Smallest room with a door, and smallest one with mouths of passages alone [m2].
ROOM_M2, WITHOUT_DOOR_M2 = 1.5, 4.0
# Furniture: longest edge; size below which everything is furniture; above it, the least thickness
# [m].
LONGEST_M, SMALL_M, THICK_M = 2.5, 0.6, 0.3
# Around the edge of the explored floor, unknown pixels up to this distance belong to an unseen part
# of the building [m].
OPEN_M = 0.5
# A region behind a door is half seen if the square of the length of its edge to unknown floor is at
# least this multiple of its area.
OPEN_RATIO = 4.0
# Largest ratio of unknown to wall pixels beside free pixels. Above it the map does not mark walls,
# and all pixels that are not free count as wall.
MOST_UNMARKED = 4
# Largest clearance that matters: before the mouth of a corridor [m].
CLEAR_M = 4.0
# Directions in which doors are searched for: to the integer points on half of a square's border, so
# that the unit vectors are equal on all machines.
_HALF = 6
_RING = [(row, _HALF) for row in range(1 - _HALF, _HALF + 1)] + [
    (_HALF, col) for col in range(_HALF - 1, -_HALF - 1, -1)
]
_DIRECTIONS = np.array(_RING) / np.sqrt((np.array(_RING) ** 2).sum(axis=1, keepdims=True))
# Certainty of a cut by hand, above that of any door.
_BY_HAND = 9.0
# Number of a region that belongs to no room yet.
_NOT_YET = -1
# Pixels processed at once in arrays of larger types.
BLOCK = 1 << 16
_NO_LINK = (0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class FoundRooms:
    """Rooms of a map, numbered by their first pixels outside doors, row by row.

    Attributes:
        geometry: geometry of the labels' pixels, a part of the map.
        labels: int32 (rows, cols), the room of each free pixel, from 1; 0 for none.
        count: number of rooms.
    """

    geometry: GridGeometry
    labels: NDArray[np.int32]
    count: int


def find_rooms(grid: OccupancyGrid, cuts: Sequence[tuple[Point, Point]] = ()) -> FoundRooms:
    """Return the rooms of a map.

    Args:
        grid: the map, any part of it unknown.
        cuts: segments between two points (x, y) [m] in the map frame that count as walls.
    """
    geometry, kinds = _kinds(grid)
    if not kinds.size:
        return FoundRooms(geometry, np.zeros(kinds.shape, np.int32), 0)
    free = kinds == _FREE
    solid, found = _solid_and_doors(kinds, geometry.resolution)
    doors = np.concatenate([_by_hand(cuts, geometry), found])
    open_floor = (~solid).astype(np.uint8)
    draw_cuts(open_floor, doors, 1.0)
    labels = find_areas(open_floor).labels
    del open_floor
    sizes = _counted(labels, free) * geometry.resolution**2
    edges = _counted(labels, free & beside(kinds == _UNKNOWN)) * geometry.resolution
    regions = _Regions(doors, beside_cuts(labels, doors), sizes, edges)
    regions.join_small()
    rooms, count = _numbered(regions.rooms())
    whole = Window(0, 0, *labels.shape)
    for strip in whole.strips(BLOCK):
        at = strip.slices_in(whole)
        room = rooms[labels[at]]
        # Rooms do not grow over floor of a room that will be found later.
        solid[at] |= room == _NOT_YET
        labels[at] = np.maximum(room, 0)
    grow(labels, ~solid)
    labels[~free] = 0
    return FoundRooms(geometry, labels, count)


def _solid_and_doors(
    kinds: NDArray[np.uint8], pixel_m: float
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return the pixels that are neither free nor furniture, and the doors between them."""
    free = kinds == _FREE
    things = furniture(
        ~free, FurnitureLimits(round(LONGEST_M / pixel_m), SMALL_M / pixel_m, THICK_M / pixel_m)
    )
    solid, unseen = ~free & ~things, _unseen(kinds, pixel_m)
    walls = (kinds == _WALL) & ~things
    reach, passage = round(BESIDE_M / pixel_m), round(PASSAGE_M / pixel_m)
    limits = DoorLimits(DOOR_M / pixel_m, OPENING_M / pixel_m, WALL_M / pixel_m, reach, passage)
    near = round(CLEAR_M / pixel_m)
    clearance = clearances(solid, near)
    doors = find_doors(RoomPixels(clearance, solid, walls, unseen), ~solid, _DIRECTIONS, limits)
    if not unseen.any():
        return solid, doors
    # What is seen through a door narrows beyond it: as if unseen floor were free, it widens.
    closed = solid & ~unseen
    wider = clearances(closed, near)
    pixels = RoomPixels(wider, closed, walls, unseen)
    more = find_doors(pixels, (clearance != wider) & ~solid, _DIRECTIONS, limits)
    return solid, np.concatenate([doors, more])


def _counted(labels: NDArray[np.int32], free: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the number of free pixels of each region, float64 (n,)."""
    counts = np.zeros(int(labels.max()) + 1)
    whole = Window(0, 0, *labels.shape)
    for strip in whole.strips(BLOCK):
        at = strip.slices_in(whole)
        counts += np.bincount(labels[at][free[at]], minlength=len(counts))
    return counts


def _numbered(rooms: NDArray[np.int32]) -> tuple[NDArray[np.int32], int]:
    """Return the room of each region, numbered in order of regions; and the number of rooms."""
    names = dict.fromkeys(room for room in rooms.tolist() if room > 0)
    numbers = np.zeros(len(rooms), np.int32)
    numbers[list(names)] = np.arange(1, len(names) + 1)
    return np.where(rooms > 0, numbers[rooms], rooms), len(names)


_UNKNOWN, _FREE, _WALL = 0, 1, 2


def _kinds(grid: OccupancyGrid) -> tuple[GridGeometry, NDArray[np.uint8]]:
    """Return the kinds of the known pixels, uint8 (rows, cols); fine ones joined to ``PIXEL_M``."""
    given, cells = grid.geometry, grid.cells
    known = Window.of(cells >= 0)
    if known is None:
        return replace(given, rows=0, cols=0), np.zeros((0, 0), np.uint8)
    joined = max(1, round(PIXEL_M / given.resolution))
    known = known.rounded_out(joined)
    kinds = np.zeros((known.rows, known.cols), np.uint8)
    inside = Window(0, 0, *cells.shape).intersection(known) or known
    seen, part = cells[inside.slices_in(Window(0, 0, *cells.shape))], inside.slices_in(known)
    kinds[part][(seen >= 0) & (seen <= THRESHOLDS.free)] = _FREE
    kinds[part][seen >= THRESHOLDS.occupied] = _WALL
    if joined > 1:
        kinds = highest(kinds, joined)
    if _beside_free(kinds, _UNKNOWN) > MOST_UNMARKED * _beside_free(kinds, _WALL):
        kinds[kinds == _UNKNOWN] = _WALL
    x, y = given.to_map(known.col0, known.row0)
    origin = Pose2D(x, y, given.origin.yaw)
    return GridGeometry(*kinds.shape, given.resolution * joined, origin), kinds


def _beside_free(kinds: NDArray[np.uint8], kind: int) -> int:
    """Return the number of edges that free pixels share with pixels of another kind."""
    is_free, is_kind = kinds == _FREE, kinds == kind
    return sum(
        int(np.count_nonzero(one & other))
        for a, b in ((is_free, is_kind), (is_kind, is_free))
        for one, other in ((a[1:], b[:-1]), (a[:, 1:], b[:, :-1]))
    )


def _unseen(kinds: NDArray[np.uint8], pixel_m: float) -> NDArray[np.bool_]:
    """Return unknown pixels of unseen parts of the building, bool (rows, cols).

    They border on free floor nearby; unknown pixels behind furniture border only on its outline.
    """
    unknown, free = kinds == _UNKNOWN, kinds == _FREE
    reach = round(OPEN_M / pixel_m)
    near: NDArray[np.bool_] = clearances(free & beside(unknown), reach) < reach * reach
    near &= unknown
    return near


def _by_hand(cuts: Sequence[tuple[Point, Point]], geometry: GridGeometry) -> NDArray[np.float64]:
    """Return cuts by hand as rows of ``find_doors``."""
    rows = []
    for start, end in cuts:
        (col, row), (last_col, last_row) = geometry.to_pixels(*start), geometry.to_pixels(*end)
        rows.append((row, col, last_row, last_col, _BY_HAND))
    return np.array(rows, np.float64).reshape(-1, 5)


class _Regions:
    """Regions of free floor and the doors between them; small regions are joined to others.

    Args:
        doors: float64 (m, 5), see ``find_doors``.
        beside: int32 (m, 2), the regions on both sides of each door.
        sizes: float64 (n,), free floor of each region [m2]; entry 0 has no meaning.
        edges: float64 (n,), length of each region's edge to unknown floor [m].
    """

    def __init__(
        self,
        doors: NDArray[np.float64],
        beside: NDArray[np.int32],
        sizes: NDArray[np.float64],
        edges: NDArray[np.float64],
    ) -> None:
        self._floor: list[float] = sizes.tolist()
        self._edge: list[float] = edges.tolist()
        # The region that each region was joined to; itself if to none.
        self._into = list(range(len(sizes)))
        # For each region, the most certain door to each other region.
        self._links: list[dict[int, tuple[float, float]]] = [{} for _ in sizes]
        downs, rights = doors[:, 2] - doors[:, 0], doors[:, 3] - doors[:, 1]
        squares = downs * downs + rights * rights
        certain = zip(beside.tolist(), doors[:, 4].tolist(), (-squares).tolist(), strict=True)
        for (one, other), kind, narrow in certain:
            if one and other and one != other:
                self._link(one, other, (kind, narrow))

    def _link(self, one: int, other: int, link: tuple[float, float]) -> None:
        best = max(self._links[one].get(other, _NO_LINK), link)
        self._links[one][other] = self._links[other][one] = best

    def _has(self, region: int, least: float) -> bool:
        """Return whether a region has a door or cut at least as certain as ``least``."""
        return any(kind >= least for kind, _ in self._links[region].values())

    def _is_half_seen(self, region: int) -> bool:
        """Return whether a region is a part, seen through a door, of a room."""
        edge = self._edge[region]
        return self._has(region, LEAST_SURE) and edge * edge >= OPEN_RATIO * self._floor[region]

    def _is_small(self, region: int) -> bool:
        least = ROOM_M2 if self._has(region, LEAST_SURE) else WITHOUT_DOOR_M2
        return self._floor[region] < least

    def join_small(self) -> None:
        """Join each small region through its least certain door, the smallest first."""
        floor, links = self._floor, self._links
        small = [(floor[one], one) for one, to in enumerate(links) if to and self._is_small(one)]
        heapq.heapify(small)
        while small:
            size, region = heapq.heappop(small)
            # Skip an outdated entry: the region was joined, has grown, or has no neighbours.
            if self._into[region] != region or size != floor[region] or not links[region]:
                continue
            (kind, _), _, other = min(
                (link, floor[there], there) for there, link in links[region].items()
            )
            if kind == _BY_HAND or (kind >= LEAST_SURE and self._is_half_seen(region)):
                continue
            self._join(region, other)
            if links[other] and self._is_small(other):
                heapq.heappush(small, (floor[other], other))

    def _join(self, region: int, other: int) -> None:
        self._into[region] = other
        self._floor[other] += self._floor[region]
        self._edge[other] += self._edge[region]
        for third, link in self._links[region].items():
            del self._links[third][region]
            if third != other:
                self._link(third, other, link)

    def rooms(self) -> NDArray[np.int32]:
        """Return the room of each region, int32 (n,): 0 for none, or ``_NOT_YET``."""
        rooms = np.zeros(len(self._floor), np.int32)
        for region in range(1, len(rooms)):
            room = region
            while self._into[room] != room:
                room = self._into[room]
            self._into[region] = room
            if self._floor[room] >= ROOM_M2 or (self._floor[room] and self._has(room, _BY_HAND)):
                rooms[region] = room
            elif self._floor[room] and self._is_half_seen(room):
                rooms[region] = _NOT_YET
        return rooms
