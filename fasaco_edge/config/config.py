"""The daemon's configuration: its sections, typed; ``config.loading`` reads and checks it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from msgspec import Meta

from fasaco_edge.config.reading import faults_of
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.config.ros import RosConfig
from fasaco_edge.config.security import BusConfig
from fasaco_edge.errors import BadConfiguration, DocumentError
from fasaco_edge.grid.geometry import FARTHEST_M
from fasaco_edge.host.addresses import Address, read_address
from fasaco_edge.host.documents import StrictDocument
from fasaco_edge.mission.config import BatteryPolicy, MissionPolicy
from fasaco_edge.mission.orders.mask import INLINE, mask_polygons
from fasaco_edge.mission.orders.order import place_faults
from fasaco_edge.planners.paper.colony import ColonyConfig, parse_velocities
from fasaco_edge.planners.registry import PLANNER_NAMES
from fasaco_edge.wire import schemas
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_GRID_CELLS, MAX_STRING_BYTES
from fasaco_edge.wire.messages.poses import PoseDecoder

if TYPE_CHECKING:
    PlannerName = str
else:
    PlannerName = Literal[PLANNER_NAMES]

Percent = Annotated[int, Meta(ge=0, le=100)]


class MapConfig(StrictDocument, frozen=True):
    """Thresholds of free and occupied [percent]; largest map and lattice (``daemon.memory``)."""

    free_at_most: Percent = 25
    occupied_at_least: Percent = 65
    max_pixels: Annotated[int, Meta(ge=1, le=MAX_GRID_CELLS)] = 25_000_000
    max_lattice_cells: Annotated[int, Meta(ge=1, le=100_000_000)] = 600_000

    def faults(self) -> Iterator[BadConfiguration]:
        low, high = self.free_at_most, self.occupied_at_least
        if low >= high:
            text = f"must be below map.occupied_at_least, got {low} and {high}"
            yield BadConfiguration(text, key="free_at_most", others=["occupied_at_least"])


class PoseConfig(StrictDocument, frozen=True):
    """The type of poses in samples that name no type, as under ROS 2."""

    schema: Literal[
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "nav_msgs/msg/Odometry",
    ] = schemas.POSE_STAMPED


class PlannerConfig(StrictDocument, frozen=True):
    """The colony, see ``planners.paper.colony.ColonyConfig``; and the time one plan may take [s].

    While the robot drives, ``spare_share`` of a processor core is used to improve the rest of its
    path; only colony-search can do that.

    colony-search shortens the driving time until the budget ends; ``ants``, ``visibility`` and
    ``threads`` apply to fasaco and aco, which may end earlier.

    ``velocities`` are those of the cohorts: ``8:1`` for 8, 7, ... 1; or ``1:8``, ``4``, ``8,4,1``.
    ``visibility`` is eta of the ants: ``neighbour`` as in the paper; with ``fewest-open`` they
    prefer cells that would soon be cut off, which saves revisits
    (``tests/benchmarks/RESULTS.md``).

    ``swept`` is the share of the reachable floor that a line has to sweep: the robot returns for
    what is missing once it has covered all else; null for the floor that is worth its time.

    ``align`` is the direction of the rows of cells if a line is driven: along the building's walls,
    once the map shows them clearly; along the map frame's axes; or at an angle to these [deg].
    """

    name: PlannerName = "colony-search"
    ants: Annotated[int, Meta(ge=1, le=1_000_000)] = 200
    velocities: str = "8:1"
    q0: Annotated[float, Meta(ge=0, le=1)] = 0.9
    alpha: Annotated[float, Meta(gt=0, le=1)] = 0.1
    tau0: Annotated[float, Meta(ge=1e-12, le=1e6)] = 0.1
    visibility: Literal["neighbour", "distance", "fewest-open"] = "fewest-open"
    beta: Annotated[float, Meta(ge=0, le=10)] = 2.0
    threads: Annotated[int, Meta(ge=1, le=64)] = 1
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    budget_s: Annotated[float, Meta(gt=0, le=3600)] = 0.1
    spare_share: Annotated[float, Meta(ge=0, le=1)] = 0.05
    line: Literal["cells", "quick", "thorough"] = "thorough"
    swept: Annotated[float, Meta(gt=0, le=1)] | None = None
    align: Literal["walls", "axes"] | Annotated[float, Meta(ge=-45, le=45)] = "walls"

    def faults(self) -> Iterator[BadConfiguration]:
        yield from faults_of(self.colony, others=["velocities"])

    def colony(self) -> ColonyConfig:
        """Return the configuration of the colony.

        Raises:
            BadConfiguration: the velocities cannot be read, or there are fewer ants
                than cohorts.
        """
        return ColonyConfig(
            ants=self.ants,
            velocities=parse_velocities(self.velocities),
            q0=self.q0,
            alpha=self.alpha,
            tau0=self.tau0,
            seed=self.seed,
            visibility=self.visibility,
            beta=self.beta,
        )


class MissionPolicyConfig(StrictDocument, MissionPolicy, frozen=True, kw_only=True):
    """The mission's policy, and the folder of its progress.

    If ``state_dir`` is "", it is the state folder of the service or, without a service, of the
    user.
    """

    state_dir: str = ""

    def faults(self) -> Iterator[DocumentError]:
        if "\0" in self.state_dir:
            yield BadConfiguration("must be a path, got one with a NUL", key="state_dir")
        yield from place_faults(self.zones, self.keep_out)
        mask = self.keep_out_mask
        if not mask.startswith(INLINE):
            if mask and self.keep_out_topic:
                text = f"must be left out beside mission.keep_out_topic, got {mask!r}"
                yield BadConfiguration(text, key="keep_out_mask", others=["keep_out_topic"])
            return
        yield from faults_of(lambda: mask_polygons(mask), key="keep_out_mask")

    def state_folder(self, environ: Mapping[str, str] = os.environ) -> Path:
        """Return the folder of the coverage ledger.

        By default systemd's $STATE_DIRECTORY, else fasaco-edge in an absolute $XDG_STATE_HOME,
        else in ~/.local/state; BadConfiguration if there is no such home.
        """
        if self.state_dir:
            return _home(Path(self.state_dir))
        if service := environ.get("STATE_DIRECTORY", "").partition(":")[0]:
            return Path(service)
        if (user := environ.get("XDG_STATE_HOME", "")).startswith("/"):
            return Path(user, "fasaco-edge")
        return _home(Path("~/.local/state/fasaco-edge"))


def _home(path: Path) -> Path:
    try:
        return path.expanduser()
    except RuntimeError as error:
        text, hint = f"{path}: there is no home folder", "give an absolute path"
        raise BadConfiguration(text, hint=hint, key="mission.state_dir") from error


class FleetConfig(StrictDocument, frozen=True):
    """A fleet: robots with the same ``bus.base``, name and map frame share the work in an area.

    Only names of frames are compared, so the frame must have the same origin for all. Robots with
    maps of their own set a common ``frame``, and the pose of their map's origin in it: ``x_m``,
    ``y_m`` [m], ``yaw_deg`` [deg]. The pose is valid for the map in ``map_frame``, by default for
    the first map received; on another map, as of another floor, the robot takes no part.
    """

    name: Annotated[str, Meta(min_length=1, max_length=64)]
    frame: Annotated[str, Meta(max_length=64)] = ""
    x_m: Annotated[float, Meta(ge=-FARTHEST_M, le=FARTHEST_M)] = 0.0
    y_m: Annotated[float, Meta(ge=-FARTHEST_M, le=FARTHEST_M)] = 0.0
    yaw_deg: Annotated[float, Meta(ge=-360, le=360)] = 0.0
    map_frame: Annotated[str, Meta(max_length=MAX_STRING_BYTES)] = ""

    def faults(self) -> Iterator[BadConfiguration]:
        if self.frame:
            return
        if self.x_m or self.y_m or self.yaw_deg:
            yield BadConfiguration(
                "expected the name of the frame that fleet.x_m, fleet.y_m and fleet.yaw_deg are "
                "given in",
                key="frame",
                others=["x_m", "y_m", "yaw_deg"],
            )
        if self.map_frame:
            yield BadConfiguration(
                "expected fleet.frame, too: the name of the fleet's frame, in which that map is "
                "placed",
                key="map_frame",
                others=["frame"],
            )


class BatteryConfig(StrictDocument, BatteryPolicy, frozen=True, kw_only=True):
    """When to charge; without the block ``battery`` the robot never charges by itself."""

    def faults(self) -> Iterator[BadConfiguration]:
        if self.enough < max(self.low, self.reserve) + 0.1:
            yield BadConfiguration(
                "must be at least 0.1 above battery.low and battery.reserve, got "
                f"{self.enough:g}, {self.low:g} and {self.reserve:g}",
                key="enough",
                others=["low", "reserve"],
            )


class ScanConfig(StrictDocument, frozen=True):
    """The robot's lidar: ``fasaco-edge follow`` stops before obstacles that only its scans show.

    It is mounted ``x_m`` ahead of the robot's centre, ``y_m`` to its left [m]; its angle 0 points
    ``yaw_deg`` to the left of straight ahead [deg]; ``upside_down`` reverses its angles. The robot
    stops after ``lost_s`` [s] without a scan. Without the block no scan is used.
    """

    x_m: Annotated[float, Meta(ge=-10, le=10)] = 0.0
    y_m: Annotated[float, Meta(ge=-10, le=10)] = 0.0
    yaw_deg: Annotated[float, Meta(ge=-360, le=360)] = 0.0
    upside_down: bool = False
    lost_s: Annotated[float, Meta(ge=0.2, le=10)] = 1.0


class RecordingConfig(StrictDocument, frozen=True):
    """Limits on the size and age of a file, and on the size of all files.

    The next file begins after ``part_mb`` [MB] or ``part_min`` [min], 0 for never. Above
    ``quota_mb`` [MB] of this robot's files the oldest are deleted; 0 for no limit. Recording pauses
    while the disk has less than ``least_free_mb`` [MB] free.
    """

    part_mb: Annotated[int, Meta(ge=1, le=100_000)] = 64
    part_min: Annotated[float, Meta(ge=0, le=10_000)] = 10.0
    quota_mb: Annotated[int, Meta(ge=0, le=100_000_000)] = 2000
    least_free_mb: Annotated[int, Meta(ge=0, le=100_000_000)] = 200

    def faults(self) -> Iterator[BadConfiguration]:
        if 0 < self.quota_mb < (least := 2 * self.part_mb):
            text = f"must be 0 or at least twice recording.part_mb, {least}, got {self.quota_mb}"
            yield BadConfiguration(text, key="quota_mb", others=["part_mb"])


class MetricsConfig(StrictDocument, frozen=True):
    """The address of metrics over HTTP, as ``127.0.0.1:9465``; "" for none.

    Other computers may read them only if ``open_to_everyone`` is set, as HTTP asks for no password.
    """

    listen: str = ""
    open_to_everyone: bool = False

    def faults(self) -> Iterator[BadConfiguration]:
        yield from faults_of(self.address, key="listen")

    def address(self) -> Address | None:
        """Return the address; None for none.

        Raises:
            BadConfiguration: ``listen`` is not an address with a port, or other computers can reach
                it and ``open_to_everyone`` is not set.
        """
        if not self.listen:
            return None
        address = read_address("metrics.listen", self.listen, example=9465)
        if not address.is_loopback and not self.open_to_everyone:
            raise BadConfiguration(
                f"{self.listen} lets other computers read the status",
                key="metrics.listen",
                others=["open_to_everyone"],
                hint="listen on 127.0.0.1, or set metrics.open_to_everyone",
            )
        return address


class DaemonConfig(StrictDocument, frozen=True):
    """The whole configuration.

    Without ``fleet`` the robot is alone, without ``scan`` it uses only the map, and without
    ``ros2`` it neither publishes nor subscribes under ROS.
    """

    robot: RobotConfig = RobotConfig()
    bus: BusConfig = BusConfig()
    map: MapConfig = MapConfig()
    pose: PoseConfig = PoseConfig()
    planner: PlannerConfig = PlannerConfig()
    mission: MissionPolicyConfig = MissionPolicyConfig()
    battery: BatteryConfig | msgspec.UnsetType = msgspec.UNSET
    scan: ScanConfig | msgspec.UnsetType = msgspec.UNSET
    recording: RecordingConfig = RecordingConfig()
    metrics: MetricsConfig = MetricsConfig()
    fleet: FleetConfig | msgspec.UnsetType = msgspec.UNSET
    ros2: RosConfig | msgspec.UnsetType = msgspec.UNSET

    def faults(self) -> Iterator[BadConfiguration]:
        yield from faults_of(lambda: Keys(robot=self.robot.name), key="robot.name")
        others = ("robot.tool_width_m", "robot.quarter_turn_s", "robot.turn_deg_s")
        for error in faults_of(self.robot.cost):
            if error.key == "cell_m":
                yield BadConfiguration(error.what, key="robot.tool_width_m")
            else:
                yield BadConfiguration(error.said, key="robot.speed_m_s", others=others)
        if self.bus.security.roles.ros and not self.ros2:
            text = "without a block ros2 there is no such role"
            yield BadConfiguration(text, key="bus.security.roles.ros", others=["ros2"])

    @property
    def cell_m(self) -> float:
        """Edge of a cell [m]: the tool's width, less ``robot.overlap`` if a line is driven."""
        robot = self.robot
        if self.planner.line == "cells":
            return robot.tool_width_m
        return robot.lane_m

    @property
    def lattice_deg(self) -> float | None:
        """The angle of the cells' rows to the x axis of the map frame [deg]; None: along the walls.

        Cells are aligned with the axes if walks lead through cell centres. In a fleet the axes
        take the place of the walls, as each robot would see other walls first.
        """
        if self.planner.line == "cells" or self.planner.align == "axes":
            return 0.0
        if self.planner.align == "walls":
            return 0.0 if self.fleet else None
        return float(self.planner.align)

    def keys(self) -> Keys:
        """Return the keys of this robot.

        Raises:
            BadConfiguration: a name does not fit into a key.
        """
        return Keys(robot=self.robot.name, base=self.bus.base)

    def poses(self) -> PoseDecoder:
        """Return the decoder of poses, from the native key or from ROS 2."""
        frames = None
        if self.ros2 and self.ros2.pose == "tf":
            frames = (self.ros2.frames.map, self.ros2.frames.robot)
        return PoseDecoder(self.pose.schema, frames)
