"""The reason why one spot of the floor was swept or not.

Reasons are checked in this order:

1. the spot is unknown to the map;
2. it is no floor;
3. it is in a keep-out zone;
4. another robot of the fleet swept it;
5. the robot cannot reach it;
6. it is not part of the order;
7. the robot may have swept it while poses were missing;
8. the robot or its path missed it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Polygon
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import FREE, OccupancyGrid
from fasaco_edge.grid.polygons import is_near
from fasaco_edge.judge.floor import JudgedFloor
from fasaco_edge.judge.pixels import Mask, Patches, within
from fasaco_edge.mission.events import BETTER
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.recording.read.timeline import DrawnLine, lines_in, read_drawings
from fasaco_edge.review.floor_and_rooms import nearest_points, swept_floor
from fasaco_edge.review.run_data import maps_of
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.reasons import plain

if TYPE_CHECKING:
    from fasaco_edge.review.review import Review

SWEPT_BY_OTHERS = "swept by others"
# A path leads over a spot if the spot lies at least this far inside the edge of the tool [m].
NEAR_M = 0.02
# The mission's reason for a path with the same walk and an improved line.
POLISHED = "line polished"
# Limits on the listed patches: their number, and their least area [m2].
MOST_PATCHES, LEAST_M2 = 8, 0.04


class Spot(msgspec.Struct):
    """A position (x, y) [m] in the map frame, and why it was not swept.

    Attributes:
        swept: whether the tool passed over it; None if unknown.
        why: the kind of reason: swept, swept by others, never seen, not floor, keep-out, too
            narrow, closed off, not ordered, poses missing, still to come, seen late, missed, not
            worth it, not known.
        words: the reason in full.
        missed_m: least distance from the tool's edge [m].
        nearest_s: time of that distance, since the recording began [s].
        seen_s: time from which on the map shows it free until the end of the recording [s].
        patch_m2: area of the connected patch of unswept floor around it [m2].
    """

    x: float
    y: float
    swept: bool | None
    why: str
    words: str
    missed_m: float | None = None
    nearest_s: float | None = None
    seen_s: float | None = None
    patch_m2: float | None = None


class LeftPatch(msgspec.Struct, frozen=True):
    """A connected patch of unswept reachable floor: its area, and an inner point [m]."""

    m2: float
    x: float
    y: float


def left_patches(floor: JudgedFloor) -> list[LeftPatch]:
    """Return the largest unswept patches, the largest first."""
    found, rest, pixel_m2 = [], floor.unswept, floor.geometry.resolution**2
    patches = Patches.of(rest)
    cols = rest.shape[1] + 1
    for patch in np.argsort(-patches.pixels, kind="stable")[:MOST_PATCHES].tolist():
        m2 = int(patches.pixels[patch]) * pixel_m2
        if m2 < LEAST_M2:
            break
        runs = patches.of_run == patch
        # The middle of its longest row lies inside the patch.
        starts, ends = patches.starts[runs], patches.ends[runs]
        longest = int(np.argmax(ends - starts))
        row, first = divmod(int(starts[longest]), cols)
        middle = first + 0.5 * int(ends[longest] - starts[longest])
        x, y = floor.geometry.to_map(middle, row + 0.5)
        found.append(LeftPatch(round(m2, 3), round(x, 3), round(y, 3)))
    return found


def spots_left(review: Review) -> list[Spot]:
    """Return a spot in each of ``left_patches``, with the reason why it was not swept."""
    patches = left_patches(review.floor) if review.floor else []
    return explain(review, [(patch.x, patch.y) for patch in patches])


def explain(review: Review, places: Sequence[tuple[float, float]]) -> list[Spot]:
    """Return a spot for each position (x, y) [m].

    Raises:
        UnreadableRecording: a file of the recording is gone.
    """
    judge = _Judge(review, np.array(places, np.float64).reshape(-1, 2))
    return [judge.spot(number) for number in range(len(places))]


class _Judge:
    """Finds the reasons for spots (n, 2) [m], one by one; reads the recording on demand."""

    def __init__(self, review: Review, places: NDArray[np.float64]) -> None:
        self._review, self._data, self._places = review, review.data, places
        known = known_settings(self._data.config).robot
        self._tool_m, self._radius_m = known.tool_width_m, known.radius_m
        self._number, self._x, self._y = 0, 0.0, 0.0

    @cached_property
    def _seen_s(self) -> NDArray[np.float64]:
        """Beginning of the last period in which each position is free on the map [s]; else NaN."""
        footprint = self._data.footprint
        free_at_most = footprint.free_at_most if footprint else -1
        since = np.full(len(self._places), np.nan)
        for at_s, grid in maps_of(self._review.record):
            free = (grid.cells >= FREE) & (grid.cells <= free_at_most)
            is_free = grid.geometry.values_at(free, self._places)
            since = np.where(is_free, np.fmin(since, at_s), np.nan)
        return since

    @cached_property
    def _paths(self) -> list[DrawnLine]:
        record = self._review.record
        places = record.drawn.get(entities.PATH, ())
        return [one for one in read_drawings(places, lines_in, record.anchor) if len(one.xy)]

    def _spot(self, why: str, words: str, *, swept: bool | None = False) -> Spot:
        return Spot(round(self._x, 3), round(self._y, 3), swept, why, words)

    def spot(self, number: int) -> Spot:
        self._number, (self._x, self._y) = number, self._places[number].tolist()
        grid, floor, footprint = self._data.grid, self._review.all_floor, self._data.footprint
        if grid is None or footprint is None:
            why = self._review.no_lattice or "there is no map"
            return self._spot("not known", why, swept=None)
        spot = self._off_the_floor(grid, footprint)
        if spot is not None:
            return spot
        if floor is None:
            words = "floor was swept before the recording began, or no pose lies on the map"
            return self._spot("not known", words, swept=None)
        others = self._review.by_others
        if others is not None and self._is_in(others, floor.geometry):
            return self._spot(SWEPT_BY_OTHERS, "swept by other robots of the fleet")
        if not self._is_in(floor.reachable, floor.geometry):
            return self._out_of_reach(grid, footprint)
        return self._within_reach(floor)

    def _is_in(self, mask: Mask, geometry: GridGeometry) -> bool:
        return bool(geometry.values_at(mask, np.array([(self._x, self._y)]))[0])

    def _off_the_floor(self, grid: OccupancyGrid, footprint: Footprint) -> Spot | None:
        """Return the spot if map or keep-out zones exclude it; None if they do not."""
        # Pixels outside the map are unknown, -1.
        (value,) = grid.geometry.values_at(grid.cells + 1, np.array([(self._x, self._y)])) - 1
        if value < FREE:
            return self._spot("never seen", "unknown to the map at the end")
        if value > footprint.free_at_most:
            what = "an obstacle" if value >= footprint.occupied_at_least else "not surely free"
            return self._spot("not floor", f"the map at the end shows {what} ({value} %)")
        ordered = self._data.ordered_keep_out
        if self._is_within(ordered):
            return self._spot("keep-out", "in a keep-out zone of the order")
        if self._is_within(self._data.keep_out):
            return self._spot("keep-out", "in a keep-out zone of the configuration or the operator")
        return None

    def _out_of_reach(self, grid: OccupancyGrid, footprint: Footprint) -> Spot:
        """Return the spot with the reason why the tool cannot reach it."""
        lattice = self._review.lattice
        if self._data.keep_out and lattice is not None:
            free = swept_floor(self._data, lattice, keep_out=())
            if free is not None and self._is_in(free.reachable, free.geometry):
                return self._spot("keep-out", "a keep-out zone is in the way, or too near")
        geometry = grid.geometry
        free_mask = (grid.cells >= FREE) & (grid.cells <= footprint.free_at_most)
        # As in ``judge_floor``: a disc fits if all pixels that it touches are free.
        radius_px, tool_px = (m / geometry.resolution for m in (self._radius_m, self._tool_m / 2))
        fits = ~within(~np.pad(free_mask, 1), radius_px + 0.5)[1:-1, 1:-1]
        if self._is_in(within(fits, tool_px), geometry):
            words = "the robot would fit, but no way leads there that it fits through"
            return self._spot("closed off", words)
        words = f"too narrow for the robot (radius {self._radius_m:g} m)"
        if fits.any():
            rows, cols = np.nonzero(fits)
            col, row = geometry.to_pixels(self._x, self._y)
            away_m = np.hypot(cols + 0.5 - col, rows + 0.5 - row).min() * geometry.resolution
            words += (
                f": the nearest place where it fits is {away_m:.2f} m away, "
                f"and its tool reaches {self._tool_m / 2:.2f} m"
            )
        return self._spot("too narrow", words)

    def _within_reach(self, floor: JudgedFloor) -> Spot:
        data = self._data
        away_m, at_s = _distances(data.track[:, :2], (self._x, self._y)), data.times
        if len(away_m) < len(at_s):  # a distance for each segment: take the time of its end
            away_m[~data.driven], at_s = math.inf, at_s[1:]
        first = int(np.argmin(away_m))
        if self._is_in(floor.swept, floor.geometry):
            passed = at_s[away_m <= self._tool_m / 2 + floor.geometry.resolution]
            words = "swept" + (f", first at {clock(float(passed[0]))}" if len(passed) else "")
            return self._spot("swept", words, swept=True)
        missed_m = max(float(away_m[first]) - self._tool_m / 2, 0.0)
        spot = self._missed(missed_m, float(at_s[first]))
        spot.missed_m, spot.nearest_s = round(missed_m, 3), round(float(at_s[first]), 3)
        patches = Patches.of(floor.unswept)
        here = patches.nearest_to(*floor.geometry.to_pixels(self._x, self._y))
        spot.patch_m2 = round(int(np.count_nonzero(here)) * floor.geometry.resolution**2, 3)
        return spot

    def _missed(self, missed_m: float, nearest_s: float) -> Spot:
        by = f"the tool's edge passed {100 * missed_m:.0f} cm from it at {clock(nearest_s)}"
        if self._data.zones and not self._is_within(self._data.zones):
            return self._spot("not ordered", f"in no zone of the last order; {by}")
        if (gap := self._gap()) is not None:
            words = (
                f"no pose came between {clock(gap[0])} and {clock(gap[1])}: the robot may have "
                "swept it meanwhile, and such floor does not count"
            )
            return self._spot("poses missing", f"{words}; {by}", swept=None)
        over = self._last_path_over()
        seen_s = float(self._seen_s[self._number])
        if over is not None and over is self._paths[-1] and not self._review.complete:
            words = f"the last path, {over.revision}, leads over it; the robot did not get there"
            why = "still to come"
        elif over is not None:
            why, words = self._left_by(over)
        elif seen_s > nearest_s:
            why = "seen late"
            words = f"the map showed it free from {clock(seen_s)} on, and then no path led there"
        elif before_m2 := self._data.swept_before_m2:
            words = (
                f"no path of the recording led over it; before the recording {before_m2:.1f} m2 "
                "were swept, perhaps this spot, too"
            )
            return self._spot("not known", f"{words}; {by}", swept=None)
        else:
            why = "not worth it"
            words = "no path led over it: a detour to it was not worth the time, or found no room"
        spot = self._spot(why, f"{words}; {by}")
        spot.seen_s = None if math.isnan(seen_s) else round(seen_s, 3)
        return spot

    def _gap(self) -> tuple[float, float] | None:
        """Return the first gap between poses [s] in which the robot may have swept the spot."""
        data = self._data
        away_m = np.hypot(*(data.track[:, :2] - (self._x, self._y)).T)
        via_m, way_m = away_m[:-1] + away_m[1:], data.lengths_m
        # The longest detour that is possible at full speed, but not longer than the way itself: a
        # robot that hardly moved was probably standing still.
        speed_m_s = known_settings(data.config).robot.speed_m_s
        detour_m = np.clip(speed_m_s * np.diff(data.times) - way_m, 0.0, way_m)
        gaps = np.flatnonzero(~data.driven & (via_m <= way_m + detour_m + self._tool_m))
        if not len(gaps):
            return None
        return data.pose_s[gaps[0]], data.pose_s[gaps[0] + 1]

    def _last_path_over(self) -> DrawnLine | None:
        """Return the last path that would have swept the spot; None for none."""
        reach_m, place = self._tool_m / 2 - NEAR_M, (self._x, self._y)
        paths = reversed(self._paths)
        return next((one for one in paths if _distances(one.xy, place).min() <= reach_m), None)

    def _left_by(self, over: DrawnLine) -> tuple[str, str]:
        """Return kind and text of the reason for a spot that a planned path led over."""
        led = f"path {over.revision} led over it"
        later = [p.about for p in self._data.paths if p.about.revision > over.revision]
        if not later:
            return "missed", f"{led}, and the robot did not get there"
        words = f"{led}, until path {later[0].revision} took its place ({plain(later[0].reason)})"
        # A polished or better path leaves floor that is not worth a detour.
        return "not worth it" if later[0].reason in (POLISHED, BETTER) else "missed", words

    def _is_within(self, polygons: Sequence[Polygon]) -> bool:
        return any(is_near(polygon, (self._x, self._y), 0.0) for polygon in polygons)


def _distances(line: NDArray[np.float64], place: tuple[float, float]) -> NDArray[np.float64]:
    """Return the distance of a place to each segment of a line (n, 2), or to its only point [m]."""
    points = nearest_points(line, place) if len(line) > 1 else line
    return np.asarray(np.hypot(*(points - place).T), np.float64)
