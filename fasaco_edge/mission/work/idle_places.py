"""Places without effect: keep-outs that touch no free ground, home or dock off the map.

Causes are wrong units, signs or origins. Orders with such a zone are refused. Places of the
configuration are only reported: the map may grow, and later maps use them, too.
"""

from __future__ import annotations

from collections.abc import Iterator

from fasaco_edge.grid.geometry import GridGeometry, Polygon, Window, polygon_bounds
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.orders.mask import mask_frame, mask_polygons
from fasaco_edge.mission.orders.zones import near_polygons
from fasaco_edge.mission.work.order_state import OrderState

# Least time between two checks of the same places [s], as a growing map changes often.
PERIOD_S = 1.0
# A check covers up to MOST_PIXELS, some tens of milliseconds. Each polygon adds POLYGON_PIXELS.
MOST_PIXELS, POLYGON_PIXELS = 1_000_000, 500
# Limit on the places that are named.
MOST_NAMED = 5

_Named = tuple[str, tuple[Polygon, ...]]


class IdlePlaces:
    """Finds places that have no effect on a map; used from one thread.

    Args:
        config: configuration of the mission, with the places in the map frame.
    """

    def __init__(self, config: MissionConfig) -> None:
        policy = config.policy
        self._footprint = config.footprint
        self._configured: list[_Named] = [
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
            self._configured += [("keep_out_mask", polygons)] if polygons else []
            # A mask received as a message may be blank at first.
            if not polygons and not mask_frame(mask):
                self._blank = "no pixel of mission.keep_out_mask is occupied"
        # A frame, and the keep-outs that have had an effect on its maps.
        self._frame, self._used = "", set[_Named]()
        self._key: tuple[object, ...] = ()
        self._looked_at, self._said = float("-inf"), ""

    def find(
        self, grid: OccupancyGrid, revision: int, order: OrderState, now: float, *, is_theirs: bool
    ) -> str:
        """Return which places have no effect, and why; "" for none.

        Args:
            grid: the newest map.
            revision: revision of the map.
            order: the order, with the operator's keep-outs.
            now: time [s].
            is_theirs: whether the places of the configuration belong to this map.
        """
        asked = order.order.as_given.keep_out if order.order else ()
        key = asked, order.keep_out, is_theirs, revision
        is_late = now - self._looked_at >= PERIOD_S
        if key == self._key or (key[:-1] == self._key[:-1] and not is_late):
            return self._said
        self._key, self._looked_at = key, now
        if grid.frame != self._frame:
            self._frame, self._used = grid.frame, set()
        areas = self._configured if is_theirs else []
        areas = areas + [(f"order.keep_out[{index}]", (each,)) for index, each in enumerate(asked)]
        areas += [(f"keep-out {each.name!r}", (each.polygon,)) for each in order.keep_out]
        self._said = "; ".join(self._texts(grid, areas, is_theirs=is_theirs))
        return self._said

    def _texts(self, grid: OccupancyGrid, areas: list[_Named], *, is_theirs: bool) -> Iterator[str]:
        idle, spent = [], 0
        # Places up to this distance from free pixels have an effect [pixels].
        reach = 0.5 + self._footprint.robot_radius_m / grid.geometry.resolution
        for area in areas:
            if area in self._used:
                continue
            for polygon in area[1]:
                corners = tuple(grid.geometry.to_pixels(x, y) for x, y in polygon)
                window = _around(corners, reach, grid.geometry)
                spent += POLYGON_PIXELS + window.rows * window.cols
                # Beyond the limit, places are not checked and count as used.
                if spent > MOST_PIXELS or self._touches_free(corners, reach, window, grid):
                    self._used.add(area)
                    break
            else:
                idle.append(area[0])
        if idle:
            yield f"no known floor lies in or beside {_listed(idle)}"
        x0, y0, x1, y1 = grid.geometry.bounds()
        outside = [name for name, (x, y) in self._points if not (x0 <= x <= x1 and y0 <= y <= y1)]
        if outside and is_theirs:
            yield f"outside of the map so far: {_listed(outside)}"
        if self._blank and is_theirs:
            yield self._blank

    def _touches_free(
        self, corners: Polygon, reach: float, window: Window, grid: OccupancyGrid
    ) -> bool:
        values = grid.cells[window.row0 : window.row1, window.col0 : window.col1]
        free = (values >= 0) & (values <= self._footprint.free_at_most)
        return bool(free.any() and (free & near_polygons((corners,), window, 1.0, reach)).any())


def _around(corners: Polygon, reach: float, geometry: GridGeometry) -> Window:
    x0, y0, x1, y1 = polygon_bounds(corners)
    row0, row1 = _span(y0 - reach, y1 + reach, geometry.rows)
    col0, col1 = _span(x0 - reach, x1 + reach, geometry.cols)
    return Window(row0, col0, row1, col1)


def _span(low: float, high: float, size: int) -> tuple[int, int]:
    first = int(min(max(low, 0.0), size))
    return first, max(first, int(min(max(high + 1.0, 0.0), size)))


def _listed(names: list[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
