"""Standing places: zones, keep-out zones, home and dock of the configuration, on their map alone.

Their coordinates are valid only on the map that they were given for. It is the map in the frame
``map_frame`` of the configuration, or without one in the first frame used with these places, which
is kept with the ledger. They are not used on a map in another frame, or of another building in this
frame. With keep-out zones configured, the robot does not drive there, as the zones of that map are
not known. After a command ``reset`` they belong to the map in use at that time.

Places without effect are reported: keep-outs that touch no free ground of the map, home or dock
beside it. So are places given in another unit, with a wrong sign, or a mask with a wrong origin. A
zone of an order is refused there; these hold for maps to come, too, and a map may still grow.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import msgspec

from fasaco_edge.errors import OrderError, PlacesElsewhere
from fasaco_edge.grid.geometry import GridGeometry, Polygon, Window, polygon_bounds
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import Dock, MissionConfig, MissionPolicy, Place
from fasaco_edge.mission.orders.mask import mask_frame, mask_polygons
from fasaco_edge.mission.orders.order import Errand, MissionOrder, located
from fasaco_edge.mission.orders.order_state import NO_PLACES, OrderState, PlacesNote
from fasaco_edge.mission.orders.zones import near_polygons


class StandingPlaces:
    """Gives the places of the configuration out while the map is theirs.

    Attributes:
        note: which map they belong to; kept with the order.
    """

    def __init__(self, policy: MissionPolicy, given: MissionPolicy) -> None:
        """Begin before the first map.

        Args:
            policy: with the places in the frame of the lattice.
            given: the same, with the places as given.
        """
        self.note = NO_PLACES
        self._policy, self._given = policy, given
        self._names = [
            name for name in ("zones", "keep_out", "home", "dock") if getattr(given, name)
        ]
        # A mask that came as a message has a frame of its own, and another may come.
        mask = given.keep_out_mask
        self._mask_frame = mask_frame(mask)
        self._mask = f"{zlib.crc32(mask.encode()):08x}" if self._mask_frame else ""
        self._names += ["keep_out_mask"] if mask and not self._mask else []
        values = {name: getattr(given, name) for name in self._names}
        of = msgspec.json.encode((values, given.map_frame))
        self._of = f"{zlib.crc32(of):08x}"
        # The frame in use, "" before there is one; and the last report on it.
        self._here = self._said = ""

    def enter(self, frame: str) -> PlacesElsewhere | None:
        """Note the frame in use; return a fault if the places belong to another one now."""
        self._here = frame
        if self.note.of != self._of:
            self.note = replace(
                self.note, of=self._of, frame=self._given.map_frame or frame, is_left=False
            )
        before, self._said = self._said, self.why or self._why_no_mask
        return PlacesElsewhere(self._said) if self._said not in ("", before) else None

    def leave_building(self, frame: str) -> None:
        """Note that the map in a frame shows another building; ``enter`` returns the fault.

        Places that are new in the configuration are given for that one.
        """
        if self.note.of == self._of and self.note.frame == frame:
            self.note = replace(self.note, is_left=True)
        if self._mask_frame == frame:
            self.note = replace(self.note, left_mask=self._mask)

    def resume(self, note: PlacesNote) -> None:
        """Continue with the map noted before a restart."""
        self.note = note

    def begin_anew(self) -> None:
        """Take them for places of the next map in use."""
        self.note = NO_PLACES

    @property
    def why(self) -> str:
        """Why no place of the configuration is used; "" if they are, or if there are none."""
        note = self.note
        if not self._names or note.of != self._of or not self._here:
            return ""
        places = ", ".join(f"mission.{name}" for name in self._names)
        if note.frame != self._here:
            return (
                f"{places}: given for the map in frame {note.frame!r} (mission.map_frame), this "
                f"one is in {self._here!r}"
            )
        return f"{places}: given for another building than the map shows" if note.is_left else ""

    @property
    def why_no_keep_out(self) -> str:
        """Why the keep-out zones of this map are not known; "" if they are, or none are given."""
        is_given = "keep_out" in self._names or "keep_out_mask" in self._names
        why = self.why if is_given and self.why else self._why_no_mask
        return f"{why}: waits for its own, or for that map" if why else ""

    @property
    def _why_no_mask(self) -> str:
        is_left = bool(self._mask) and self.note.left_mask == self._mask
        return "keep_out_mask: given for another building than the map shows" if is_left else ""

    @property
    def why_no_dock(self) -> str:
        """Why the robot cannot charge here; "" if it can, or if no place is given."""
        return self.why if self._policy.place("charge") else ""

    @property
    def dock(self) -> Dock | None:
        """The dock; None without one on this map."""
        return None if self.why else self._policy.dock

    def place(self, errand: Errand) -> Place | None:
        """Return the destination of an errand; None without one on this map."""
        return None if self.why else self._policy.place(errand)

    @property
    def frame(self) -> str:
        """The frame of the map they belong to; "" while that is not known."""
        return self.note.frame if self.note.of == self._of else self._given.map_frame

    def located(self, order: MissionOrder) -> MissionOrder:
        """Return an order with its named zones replaced by those of the configuration.

        Raises:
            OrderError: there is no zone of that name, or it is on another map.
        """
        names = [zone.name for zone in order.zones if zone.polygon == ()]
        if names and self.why:
            raise OrderError(f"zone {names[0]!r}: {self.why}", hint=PlacesElsewhere.hint)
        return located(order, self._policy.zones)


# Least time between two looks [s]: a map that grows changes often.
PERIOD_S = 1.0
# Most pixels of a look, and as how many each polygon counts beside its own: some tens of
# milliseconds.
MOST_PIXELS, POLYGON_PIXELS = 1_000_000, 500
# Most places that are named.
MOST_NAMED = 5

_Named = tuple[str, tuple[Polygon, ...]]


class IdlePlaces:
    """Finds places that have no effect on a map; used from one thread.

    Args:
        config: of the mission, with the places in the map frame.
    """

    def __init__(self, config: MissionConfig) -> None:
        policy = config.policy
        self._footprint = config.footprint
        self._standing: list[_Named] = [
            (f"mission.keep_out[{index}]", (polygon,))
            for index, polygon in enumerate(policy.keep_out)
        ]
        self._points = [
            (f"mission.{name}", (place.x_m, place.y_m))
            for name, place in (("home", policy.home), ("dock", policy.dock))
            if place is not None
        ]
        self._blank = ""
        if mask := policy.keep_out_mask:
            polygons = mask_polygons(mask)
            self._standing += [("keep_out_mask", polygons)] if polygons else []
            # One that comes as a message may be blank for a while.
            if not polygons and not mask_frame(mask):
                self._blank = "no pixel of mission.keep_out_mask is occupied"
        # Keep-outs that have been found to have an effect, on maps of a frame.
        self._frame, self._used = "", set[_Named]()
        self._key: tuple[object, ...] = ()
        self._looked_at, self._said = float("-inf"), ""

    def look(
        self, grid: OccupancyGrid, revision: int, order: OrderState, now: float, *, is_theirs: bool
    ) -> str:
        """Return which places have no effect, and why; "" if all have.

        Args:
            grid: the newest map.
            revision: counter of its states.
            order: the order, with the operator's keep-outs.
            now: time [s].
            is_theirs: whether the places of the configuration belong to this map.
        """
        asked = order.order.as_given.keep_out if order.order else ()
        key = revision, asked, order.keep_out, is_theirs
        if key == self._key or now - self._looked_at < PERIOD_S:
            return self._said
        self._key, self._looked_at = key, now
        if grid.frame != self._frame:
            self._frame, self._used = grid.frame, set()
        areas = self._standing if is_theirs else []
        areas = areas + [(f"order.keep_out[{index}]", (each,)) for index, each in enumerate(asked)]
        areas += [(f"keep-out {each.name!r}", (each.polygon,)) for each in order.keep_out]
        self._said = "; ".join(self._texts(grid, areas, is_theirs=is_theirs))
        return self._said

    def _texts(self, grid: OccupancyGrid, areas: list[_Named], *, is_theirs: bool) -> Iterator[str]:
        idle, spent = [], 0
        for area in areas:
            if area in self._used:
                continue
            for polygon in area[1]:
                pixels = _Pixels.of(polygon, grid.geometry, self._footprint.robot_radius_m)
                spent += POLYGON_PIXELS + pixels.window.rows * pixels.window.cols
                # What is left is not looked at, and taken for used on this map.
                if spent > MOST_PIXELS or pixels.touch_free(grid, self._footprint.free_at_most):
                    self._used.add(area)
                    break
            else:
                idle.append(area[0])
        if idle:
            yield f"no free ground of the map so far lies in or beside {_listed(idle)}"
        x0, y0, x1, y1 = grid.geometry.bounds()
        outside = [name for name, (x, y) in self._points if not (x0 <= x <= x1 and y0 <= y <= y1)]
        if outside and is_theirs:
            yield f"outside of the map so far: {_listed(outside)}"
        if self._blank and is_theirs:
            yield self._blank


@dataclass(frozen=True, slots=True)
class _Pixels:
    """The pixels of a map in a polygon and near it.

    Attributes:
        corners: the polygon (col, row) [pixels].
        reach: how near [pixels].
        window: around them, on the map.
    """

    corners: Polygon
    reach: float
    window: Window

    @classmethod
    def of(cls, polygon: Polygon, geometry: GridGeometry, near_m: float) -> _Pixels:
        corners = tuple(geometry.to_pixels(x, y) for x, y in polygon)
        reach = 0.5 + near_m / geometry.resolution
        x0, y0, x1, y1 = polygon_bounds(corners)
        row0, row1 = _span(y0 - reach, y1 + reach, geometry.rows)
        col0, col1 = _span(x0 - reach, x1 + reach, geometry.cols)
        return cls(corners, reach, Window(row0, col0, row1, col1))

    def touch_free(self, grid: OccupancyGrid, free_at_most: int) -> bool:
        """Return whether one of them is free."""
        window = self.window
        values = grid.cells[window.row0 : window.row1, window.col0 : window.col1]
        free = (values >= 0) & (values <= free_at_most)
        return bool(
            free.any() and (free & near_polygons((self.corners,), window, 1.0, self.reach)).any()
        )


def _span(low: float, high: float, size: int) -> tuple[int, int]:
    first = int(min(max(low, 0.0), size))
    return first, max(first, int(min(max(high + 1.0, 0.0), size)))


def _listed(names: list[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
