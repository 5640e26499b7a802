"""Configuration of a mission."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from msgspec import Meta

from fasaco_edge.grid.geometry import FARTHEST_M, MAX_LATTICE_CELLS, Polygon, Pose2D
from fasaco_edge.mission.orders.keep_outs import MOST_KEEP_OUT
from fasaco_edge.mission.orders.order import MOST_ZONES, ConfiguredZone, Errand, Minutes
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost
from fasaco_edge.planners.living_trail import PAPERS_RULES, TrailRules

if TYPE_CHECKING:
    # For types only: at run time, these imports would load numba.
    from fasaco_edge.grid.lattice import Footprint
    from fasaco_edge.planners.curve_config import CurveConfig
    from fasaco_edge.planners.line import LineConfig

LONGEST_FRAME = 255

ByRoom = Literal["never", "auto", "always"]
Period = Annotated[float, Meta(ge=0, le=86_400)]
Coordinate = Annotated[float, Meta(ge=-FARTHEST_M, le=FARTHEST_M)]


class Place(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A robot pose in the map frame: position [m] and heading [deg]."""

    x_m: Coordinate
    y_m: Coordinate
    yaw_deg: Annotated[float, Meta(ge=-360, le=360)] = 0.0

    @property
    def stand(self) -> Pose2D:
        """The pose that paths lead to."""
        return Pose2D(self.x_m, self.y_m, math.radians(self.yaw_deg))


class Dock(Place, frozen=True):
    """The robot's pose in its dock; paths end ``approach_m`` [m] in front of it."""

    approach_m: Annotated[float, Meta(ge=0, le=10)] = 0.5

    @property
    def stand(self) -> Pose2D:
        """The pose in front of the dock, from which the robot drives straight in."""
        yaw, back = math.radians(self.yaw_deg), self.approach_m
        return Pose2D(self.x_m - back * math.cos(yaw), self.y_m - back * math.sin(yaw), yaw)


class MissionPolicy(msgspec.Struct, frozen=True, kw_only=True):
    """Autostart, timeouts, retries, zones and places that apply to every order.

    Attributes:
        autostart: whether a mission without an order covers everything once.
        retries: number of times that cells blocked or left over are tried again at the end.
        retry_s: pause before each retry [s].
        lost_pose_s: the pose is lost after this time without a pose [s]; 0 for never.
        stale_map_s: the map is stale after this time without a map or an update [s]; 0 for never.
        until_min: time after which an order without a time limit of its own ends, with the robot at
            home [min]; 0 for no limit.
        zones: named zones that orders refer to.
        keep_out: polygons (x, y) [m] in the map frame that the robot never touches.
        keep_out_mask: file of a mask with further keep-out areas, see ``orders.mask``; "" for none.
        keep_out_topic: whether the mask comes as a message; no mission starts before it arrives.
        home: where the robot returns to; None for the dock or, without a dock, the order's start.
        dock: where it charges; None if it does not.
        map_frame: frame of the map to which zones, keep_out, a mask of a file, home and dock
            belong; "" for the first map used with them.
        by_room: whether a room is finished before the next is begun; "auto": if that costs little.
            With other robots, "always" has the effect of "auto".
    """

    autostart: bool = True
    retries: Annotated[int, Meta(ge=0, le=100)] = 2
    retry_s: Period = 30.0
    lost_pose_s: Period = 3.0
    stale_map_s: Period = 0.0
    until_min: Minutes = 0.0
    zones: Annotated[tuple[ConfiguredZone, ...], Meta(max_length=MOST_ZONES)] = ()
    keep_out: Annotated[tuple[Polygon, ...], Meta(max_length=MOST_KEEP_OUT)] = ()
    keep_out_mask: str = ""
    keep_out_topic: bool = False
    home: Place | None = None
    dock: Dock | None = None
    map_frame: Annotated[str, Meta(max_length=LONGEST_FRAME)] = ""
    by_room: ByRoom = "auto"

    @property
    def waits_for_mask(self) -> bool:
        """Whether the mask has not arrived yet."""
        return self.keep_out_topic and not self.keep_out_mask

    def place(self, errand: Errand) -> Place | None:
        """Return the destination of an errand; None for the place where the order began."""
        return self.dock or self.home if errand == "charge" else self.home or self.dock


class BatteryPolicy(msgspec.Struct, frozen=True, kw_only=True):
    """When a robot goes to charge and when it resumes; levels are shares of a full battery.

    Attributes:
        low: level at which it goes to charge; higher if the path back needs more, or if its path
            leads away from a dock that is near.
        reserve: least level on arrival at the dock.
        enough: level at which it resumes; lower if the rest of the order needs less.
        silent_s: timeout for battery messages, after which their absence is reported [s].
    """

    low: Annotated[float, Meta(ge=0.01, le=0.8)] = 0.2
    reserve: Annotated[float, Meta(ge=0, le=0.8)] = 0.1
    enough: Annotated[float, Meta(ge=0.1, le=1)] = 0.9
    silent_s: Annotated[float, Meta(ge=10, le=86_400)] = 45.0


NO_PATIENCE = MissionPolicy(retries=0, lost_pose_s=0.0)


@dataclass(frozen=True, slots=True)
class Sweeping:
    """How floor is swept, and the prices of sweeping.

    Attributes:
        tool_m: width of the tool [m]; cells may be narrower, so that lanes overlap.
        most_pixels: limit on the pixels of the fine raster.
        line: prices for polishing the line.
        ahead_m: distance of the tool's centre ahead of the robot's centre of rotation [m]: swept
            floor is computed with it, lines are planned as if it were 0.
        clearance_m: distance of lines from walls and furniture in addition to the radius [m].
        curves: rules for curves of a robot with a turning radius; None if it turns on the spot.
    """

    tool_m: float
    most_pixels: int
    line: LineConfig
    ahead_m: float = 0.0
    clearance_m: float = 0.0
    curves: CurveConfig | None = None


@dataclass(frozen=True, slots=True)
class MissionConfig:
    """Robot, cost, limits and policy of a mission; by default without retries.

    Attributes:
        footprint: footprint of robot and tool.
        max_lattice_cells: limit on the cells of the coverage lattice.
        cost: cost of paths.
        policy: retries and timeouts.
        spare_share: share of a processor core for improving a path that is still valid; 0 for
            none.
        sweeping: how floor is swept; None to drive through the centres of cells.
        trail: rules of the living trail.
        battery: when to charge; None for never.
        speed_m_s: speed of the robot; 0 if not known [m/s].
        lattice_deg: angle of the cells' rows to the x axis of the map frame [deg]; None to align
            them with the walls, once their direction is certain.
        given: the policy as configured, with its places in the map frame; None if ``policy`` is
            that policy.
    """

    footprint: Footprint
    max_lattice_cells: int = MAX_LATTICE_CELLS
    cost: CoverageCost = STEPS_ALONE
    policy: MissionPolicy = NO_PATIENCE
    spare_share: float = 0.0
    sweeping: Sweeping | None = None
    trail: TrailRules = PAPERS_RULES
    battery: BatteryPolicy | None = None
    lattice_deg: float | None = 0.0
    given: MissionPolicy | None = None
    speed_m_s: float = 0.0

    @property
    def tool_m(self) -> float:
        """Width of the tool [m]."""
        return self.sweeping.tool_m if self.sweeping else self.footprint.cell_m
