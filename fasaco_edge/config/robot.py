"""The robot's section of the configuration: outline, size, and cost of driving."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

import msgspec
from msgspec import Meta

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.documents import StrictDocument
from fasaco_edge.kernels.floor.turning import (
    Turning,
    limited_turning,
    proportional_turning,
    turn_seconds,
)
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.curve_config import CurveConfig
from fasaco_edge.planners.passes import lane_and_tool_m

Metres = Annotated[float, Meta(gt=0, le=10)]
DEFAULT_RADIUS_M = 0.18
Length = Annotated[float, Meta(gt=0, le=7)]
Coordinate = Annotated[float, Meta(ge=-7, le=7)]


class FootprintConfig(StrictDocument, frozen=True):
    """The robot's outline relative to its turning point [m]; x points ahead.

    Either ``width_m`` and ``length_m``, of which ``ahead_m`` lie ahead of that point (by default
    half), or the corners (x, y) of a ``polygon``. Plans use the disc around the outline, so that
    the robot can turn on the spot anywhere; passages narrower than the disc are left out. The tool
    is assumed at the turning point.
    """

    width_m: Length | None = None
    length_m: Length | None = None
    ahead_m: Annotated[float, Meta(ge=0, le=7)] | None = None
    polygon: tuple[tuple[Coordinate, Coordinate], ...] = ()

    def radius(self) -> float:
        """Return the radius of the disc around the outline [m]; 0 if underspecified."""
        corners = self.polygon
        if self.width_m is not None and self.length_m is not None:
            ahead = 0.5 * self.length_m if self.ahead_m is None else self.ahead_m
            corners = tuple((x, 0.5 * self.width_m) for x in (ahead, ahead - self.length_m))
        return max((math.hypot(x, y) for x, y in corners), default=0.0)

    def faults(self) -> Iterator[BadConfiguration]:
        lengths, corners = (self.width_m, self.length_m), self.polygon
        if corners and any(length is not None for length in (*lengths, self.ahead_m)):
            yield BadConfiguration("must be a polygon, or width_m and length_m, not both")
        elif not corners and None in lengths:
            yield BadConfiguration("must have width_m and length_m, or a polygon")
        elif corners and len(corners) < 3:
            yield BadConfiguration(f"must have 3 corners, got {len(corners)}", key="polygon")
        elif corners and not self.radius():
            yield BadConfiguration("must have corners apart from each other", key="polygon")
        elif self.length_m is not None and (self.ahead_m or 0.0) > self.length_m:
            text = f"must be at most length_m, {self.length_m:g}, got {self.ahead_m:g}"
            yield BadConfiguration(text, key="ahead_m", others=["length_m"])


class RobotConfig(StrictDocument, frozen=True):
    """The robot: its name on the bus, its size [m], and its driving.

    ``quarter_turn_s`` is the duration of a turn by 90 degrees on the spot, with braking and
    starting [s]; with 0, plans minimise steps alone. If ``turn_deg_s`` is given, turns take as long
    as the robot's limits allow: the rate of turning [deg/s], the angular acceleration [deg/s2], the
    acceleration of driving [m/s2], and the largest bend that is steered while driving [deg].
    ``overlap`` is the share of the tool's width by which cells overlap if a line is driven
    (``planner.line``); the line leaves out floor that is swept already. Passes of an order may set
    another overlap. ``footprint`` replaces ``radius_m`` by the radius of the disc around it.
    ``clearance_m`` is the distance that lines keep from walls and furniture in addition to the
    radius. A line keeps half of it, or none, where it would otherwise miss much floor.
    ``turn_radius_m`` is the radius of the tightest arc; 0 for a robot that turns on the spot. With
    a radius, lines become curves of lanes and of arcs a tenth wider; ``reverses`` is whether the
    robot may drive them backward, too. ``tool_ahead_m`` is the distance of the tool's centre ahead
    of the turning point, below 0 if behind. ``time_scale`` is the number of a simulated robot's
    seconds in a real second. Timeouts of the daemon are real seconds; reports of a recording have
    the robot's seconds.
    """

    name: str = "robot"
    radius_m: Metres = DEFAULT_RADIUS_M
    clearance_m: Annotated[float, Meta(ge=0, le=1)] = 0.0
    footprint: FootprintConfig | msgspec.UnsetType = msgspec.UNSET
    tool_width_m: Metres = 0.3
    speed_m_s: Annotated[float, Meta(gt=0, le=10)] = 0.25
    quarter_turn_s: Annotated[float, Meta(ge=0, le=600)] = 1.5
    turn_deg_s: Annotated[float, Meta(ge=1, le=1000)] | None = None
    turn_deg_s2: Annotated[float, Meta(ge=1, le=100_000)] = 180.0
    acceleration_m_s2: Annotated[float, Meta(ge=0.01, le=100)] = 0.5
    steered_deg: Annotated[float, Meta(ge=0, le=45)] = 1.0
    overlap: Annotated[float, Meta(ge=0, le=0.5)] = 0.08
    turn_radius_m: Annotated[float, Meta(ge=0, le=20)] = 0.0
    reverses: bool = True
    tool_ahead_m: Annotated[float, Meta(ge=-5, le=5)] = 0.0
    time_scale: Annotated[float, Meta(ge=0.01, le=1000)] = 1.0

    def __post_init__(self) -> None:
        """Set the radius to the radius of the disc around the footprint, if there is one."""
        if self.footprint and self.radius_m == DEFAULT_RADIUS_M:
            radius_m = self.footprint.radius() or DEFAULT_RADIUS_M
            msgspec.structs.force_setattr(self, "radius_m", radius_m)

    def __repr__(self) -> str:
        """Return the robot as Python, without members that are not set."""
        members = msgspec.structs.asdict(self).items()
        texts = (f"{name}={value!r}" for name, value in members if value is not msgspec.UNSET)
        return f"Robot({', '.join(texts)})"

    def faults(self) -> Iterator[BadConfiguration]:
        radius_m = self.footprint.radius() if self.footprint else self.radius_m
        if radius_m and abs(self.radius_m - radius_m) > 1e-6:
            yield BadConfiguration(
                f"must be left out beside robot.footprint, whose disc has {radius_m:.3g} m, "
                f"got {self.radius_m:g}",
                key="radius_m",
                others=["footprint"],
            )

    @property
    def assumed(self) -> str:
        """Assumptions on the robot's shape; "" if it is the configured disc."""
        if not self.footprint:
            return ""
        tool = (
            f"lines are planned as if its tool were {abs(self.tool_ahead_m):g} m further "
            f"{'back' if self.tool_ahead_m > 0.0 else 'ahead'}, at its turning point"
            if self.tool_ahead_m
            else "its tool is at its turning point"
        )
        turns = "have any heading" if self.turn_radius_m else "turn on the spot"
        return (
            f"the robot is planned with the disc around its footprint, of radius "
            f"{self.radius_m:.3g} m: it may {turns} anywhere, passages narrower than "
            f"{2.0 * self.radius_m:.3g} m are left out, and {tool}"
        )

    @property
    def lane_m(self) -> float:
        """Distance between neighbouring lanes of a line [m]: the tool's width less the overlap."""
        return self.tool_width_m * (1.0 - self.overlap)

    def with_overlap(self, overlap: float) -> RobotConfig:
        """Return the robot for a pass whose lanes overlap by ``overlap`` of the tool's width."""
        lane_m, tool_m = lane_and_tool_m(self.tool_width_m, self.lane_m, overlap)
        return msgspec.structs.replace(self, tool_width_m=tool_m, overlap=1.0 - lane_m / tool_m)

    def cost(self, cell_m: float | None = None) -> CoverageCost:
        """Return the costs of a turn and of a step over a cell, by default one as wide as the tool.

        Raises:
            BadConfiguration: a step would take less than a millisecond or more than an hour.
        """
        step_m = self.tool_width_m if cell_m is None else cell_m
        quarter_turn_s = turn_seconds(self.turning(), 0.5 * math.pi)
        return CoverageCost.for_robot(step_m, self.speed_m_s, quarter_turn_s)

    def turning_deg_s(self) -> float:
        """Return the rate of turning on the spot [deg/s].

        Without ``turn_deg_s`` it is the rate at which a quarter-turn takes ``quarter_turn_s`` less
        the times of braking before it and starting after it.
        """
        if self.turn_deg_s is not None:
            return self.turn_deg_s
        seconds = self.quarter_turn_s - self.speed_m_s / self.acceleration_m_s2
        # 90 = rate (seconds - rate / acceleration); if no rate is fast enough, the fastest possible
        # one.
        half = 0.5 * seconds * self.turn_deg_s2
        square = half * half - 90.0 * self.turn_deg_s2
        if seconds <= 0.0 or square <= 0.0:
            return math.sqrt(90.0 * self.turn_deg_s2)
        return half - math.sqrt(square)

    def curves(self, price_s_m2: float) -> CurveConfig | None:
        """Return the configuration of curves; None for a robot that turns on the spot.

        ``price_s_m2``: value of sweeping a square metre [s/m2].
        """
        if not self.turn_radius_m:
            return None
        arc_m_s, stop_s = self.speed_m_s, self.quarter_turn_s
        if self.turn_deg_s is not None:
            arc_m_s = min(arc_m_s, math.radians(self.turn_deg_s) * self.turn_radius_m)
            stop_s = self.speed_m_s / self.acceleration_m_s2
        return CurveConfig(
            self.turn_radius_m, self.reverses, self.speed_m_s, arc_m_s, stop_s, price_s_m2
        )

    def turning(self) -> Turning:
        """Return the durations of turns on the spot."""
        if self.turn_deg_s is None:
            return proportional_turning(self.quarter_turn_s)
        return limited_turning(
            self.turn_deg_s,
            self.turn_deg_s2,
            self.speed_m_s,
            self.acceleration_m_s2,
            self.steered_deg,
        )
