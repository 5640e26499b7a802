"""What a mission is ordered to do: zones, passes, where never to go, whether to drive home."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.geometry import FARTHEST_M
from fasaco_edge.mission.polygons import Polygon, flaw

# What an order may hold at most: it is kept with the ledger, written once a second.
MOST_ZONES = 100
MOST_KEEP_OUT = 100
MOST_POINTS = 1_000
MOST_POINTS_IN_ALL = 5_000
MOST_PASSES = 100
LONGEST_NAME = 64


class OrderError(FasacoError):
    """An order that cannot be carried out as it is written."""

    code = "bad_order"
    hint = "correct the named member; see protocol/schema/mission.json"


@dataclass(frozen=True, slots=True)
class Zone:
    """An area to cover.

    Attributes:
        name: tells it from others.
        polygon: its corners (x, y) [m] in the map frame, the last joined to the first; None for
            everything the robot can come to.
        passes: how often.
    """

    name: str
    polygon: Polygon | None
    passes: int = 1


EVERYTHING = "everything"


@dataclass(frozen=True, slots=True)
class MissionOrder:
    """What to cover.

    Attributes:
        zones: one after the other, in this order; at least one.
        keep_out: polygons (x, y) [m] in the map frame that the robot must not touch.
        return_home: whether to drive back in the end to where the mission began.
        keep_covered: whether what is covered already counts in the first pass.
    """

    zones: tuple[Zone, ...] = (Zone(EVERYTHING, None),)
    keep_out: tuple[Polygon, ...] = ()
    return_home: bool = False
    keep_covered: bool = False

    def check(self) -> None:
        """Check all that can be checked without a map.

        Raises:
            OrderError: naming the member, what is wrong with it, and what is allowed.
        """
        _check_count("zones", len(self.zones), 1, MOST_ZONES)
        _check_count("keep_out", len(self.keep_out), 0, MOST_KEEP_OUT)
        names = [zone.name for zone in self.zones]
        for index, zone in enumerate(self.zones):
            where = f"zones[{index}]"
            _check_name(f"{where}.name", zone.name)
            if zone.name in names[:index]:
                raise OrderError(f"{where}.name: there is a zone {zone.name!r} already")
            if not 1 <= zone.passes <= MOST_PASSES:
                raise OrderError(f"{where}.passes must be in 1..{MOST_PASSES}, got {zone.passes}")
        polygons = {
            f"zones[{index}].polygon": zone.polygon
            for index, zone in enumerate(self.zones)
            if zone.polygon is not None
        } | {f"keep_out[{index}]": polygon for index, polygon in enumerate(self.keep_out)}
        points = sum(map(len, polygons.values()))
        if points > MOST_POINTS_IN_ALL:
            raise OrderError(
                f"polygons must have at most {MOST_POINTS_IN_ALL} points, got {points}"
            )
        for where, polygon in polygons.items():
            _check_polygon(where, polygon)


EVERYTHING_ONCE = MissionOrder()


def _check_count(where: str, count: int, least: int, most: int) -> None:
    if not least <= count <= most:
        raise OrderError(f"{where} must be {least}..{most}, got {count}")


def _check_name(where: str, name: str) -> None:
    if not (1 <= len(name) <= LONGEST_NAME and name.isprintable() and name.strip() == name):
        raise OrderError(
            f"{where} must be 1..{LONGEST_NAME} printable characters, got {name!r:.80}"
        )


def _check_polygon(where: str, polygon: Polygon) -> None:
    if len(polygon) > MOST_POINTS:
        raise OrderError(f"{where} must have at most {MOST_POINTS} points, got {len(polygon)}")
    for index, (x, y) in enumerate(polygon):
        # A negated comparison, so that NaN is caught too.
        if not math.hypot(x, y) <= FARTHEST_M:
            raise OrderError(
                f"{where}[{index}] must be finite and within {FARTHEST_M:g} m of 0, got ({x}, {y})"
            )
    if why := flaw(polygon):
        raise OrderError(f"{where} {why}")
