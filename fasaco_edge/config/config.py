"""The daemon's configuration: typed, checked as a whole, never repaired."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from msgspec import Meta, structs

from fasaco_edge.bus import DEFAULT_ENDPOINT
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.metrics import MetricsConfig
from fasaco_edge.config.reading import (
    Fault,
    Section,
    read_text,
    section_faults,
    with_credentials,
)
from fasaco_edge.config.ros import RosConfig
from fasaco_edge.config.security import SecurityConfig, from_here, security_faults
from fasaco_edge.errors import BadConfiguration, OrderError
from fasaco_edge.kernels.floor.turning import (
    Turning,
    limited_turning,
    proportional_turning,
    turn_seconds,
)
from fasaco_edge.mission.config import BatteryPolicy, MissionPolicy
from fasaco_edge.mission.orders.mask import INLINE, inline_mask, mask_polygons
from fasaco_edge.mission.orders.order import OrderDocument, ZoneDocument, order_of
from fasaco_edge.planners.colony import ColonyConfig, parse_velocities
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.registry import PLANNER_NAMES
from fasaco_edge.wire import schemas
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_GRID_CELLS
from fasaco_edge.wire.messages.poses import PoseDecoder

if TYPE_CHECKING:
    PlannerName = str
else:
    PlannerName = Literal[PLANNER_NAMES]

Metres = Annotated[float, Meta(gt=0, le=10)]
Percent = Annotated[int, Meta(ge=0, le=100)]


class RobotConfig(Section, frozen=True):
    """The robot: its name on the bus, its size [m], and what driving takes it.

    ``quarter_turn_s`` is a turn by 90 degrees on the spot [s], braking and starting
    included; 0 minimises steps, whatever the turns. Where ``turn_deg_s`` is given, the
    robot's limits count in its place: the rate of turning [deg/s], its acceleration [deg/s2], that
    of driving [m/s2], and the largest bend that is steered while driving [deg]. ``overlap`` is by
    what share of the tool's width lanes overlap where a line is driven (``planner.line``).
    """

    name: str = "robot"
    radius_m: Metres = 0.18
    tool_width_m: Metres = 0.3
    speed_m_s: Annotated[float, Meta(gt=0, le=10)] = 0.25
    quarter_turn_s: Annotated[float, Meta(ge=0, le=600)] = 1.5
    turn_deg_s: Annotated[float, Meta(ge=1, le=1000)] | None = None
    turn_deg_s2: Annotated[float, Meta(ge=1, le=100_000)] = 180.0
    acceleration_m_s2: Annotated[float, Meta(ge=0.01, le=100)] = 0.5
    steered_deg: Annotated[float, Meta(ge=0, le=45)] = 1.0
    overlap: Annotated[float, Meta(ge=0, le=0.5)] = 0.08

    def cost(self, cell_m: float | None = None) -> CoverageCost:
        """Return what a step over a cell, by default one as wide as the tool, and a turn cost.

        Raises:
            BadConfiguration: a step would take less than a millisecond or more than an hour.
        """
        step_m = self.tool_width_m if cell_m is None else cell_m
        quarter_turn_s = turn_seconds(self.turning(), 0.5 * math.pi)
        return CoverageCost.for_robot(step_m, self.speed_m_s, quarter_turn_s)

    def turning_deg_s(self) -> float:
        """Return the rate of turning on the spot [deg/s].

        Without ``turn_deg_s`` that by which a quarter-turn takes ``quarter_turn_s``, braking before
        and starting after it left out.
        """
        if self.turn_deg_s is not None:
            return self.turn_deg_s
        seconds = self.quarter_turn_s - self.speed_m_s / self.acceleration_m_s2
        # 90 = rate (seconds - rate / acceleration); where that cannot be, as fast as it goes.
        half = 0.5 * seconds * self.turn_deg_s2
        square = half * half - 90.0 * self.turn_deg_s2
        if seconds <= 0.0 or square <= 0.0:
            return math.sqrt(90.0 * self.turn_deg_s2)
        return half - math.sqrt(square)

    def turning(self) -> Turning:
        """Return what turns on the spot take."""
        if self.turn_deg_s is None:
            return proportional_turning(self.quarter_turn_s)
        return limited_turning(
            self.turn_deg_s,
            self.turn_deg_s2,
            self.speed_m_s,
            self.acceleration_m_s2,
            self.steered_deg,
        )


class BusConfig(Section, frozen=True):
    """How to join the bus, and who else may.

    Remote access requires authentication (``security``), unless ``open_to_everyone`` is set.
    """

    base: str = "fasaco"
    mode: Literal["peer", "client", "router"] = "peer"
    listen: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    connect: tuple[str, ...] = ()
    open_to_everyone: bool = False
    security: SecurityConfig = SecurityConfig()

    def settings(self, prefix: str, ros: RosConfig | None = None) -> BusSettings:
        """Return the settings of the session of a robot whose keys begin with ``prefix``.

        ``ros`` are its keys under ROS 2.

        Raises:
            BadConfiguration: a file of ``security`` cannot be read.
        """
        rights = (ros.rights(), ros.driver_rights()) if ros else ()
        part = self.security.of_daemon(prefix, *rights)
        if self.open_to_everyone:
            part |= self.security.thinned(prefix)
        return BusSettings(self.mode, self.connect, self.listen, part)

    def of_client(self) -> BusSettings:
        """Return the settings of another program's session, on the same computer.

        Raises:
            BadConfiguration: a file of ``security`` cannot be read.
        """
        self.security.warn_of_clock()
        endpoints = tuple(map(from_here, self.listen or self.connect))
        return BusSettings("client", endpoints, secured=self.security.of_client())


class MapConfig(Section, frozen=True):
    """Thresholds of free and occupied [percent]; largest map and lattice (``daemon.memory``)."""

    free_at_most: Percent = 25
    occupied_at_least: Percent = 65
    max_pixels: Annotated[int, Meta(ge=1, le=MAX_GRID_CELLS)] = 25_000_000
    max_lattice_cells: Annotated[int, Meta(ge=1, le=100_000_000)] = 600_000


class PoseConfig(Section, frozen=True):
    """The type of poses that come without one, as under ROS 2."""

    schema: Literal[
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "nav_msgs/msg/Odometry",
    ] = schemas.POSE_STAMPED


class PlannerConfig(Section, frozen=True):
    """The colony, see ``planners.colony.ColonyConfig``; and the time one plan may take [s].

    While the robot drives, ``spare_share`` of a processor core goes into making the rest of its
    path better; fasaco with local search alone can do that.

    ``local_search`` is for planners that have it (``planners.registry``), which is fasaco alone;
    without it a plan may end before its budget.

    ``velocities`` is ``8:1`` for cohorts from 8 down to 1, ``1:8``, ``4`` or ``8,4,1``.
    The paper's ants see no further than their neighbours; a robot's see what will soon
    be cut off, which saves it revisits (``tests/benchmarks/RESULTS.md``).
    """

    name: PlannerName = "fasaco"
    local_search: bool = True
    ants: Annotated[int, Meta(ge=1, le=1_000_000)] = 200
    velocities: str = "8:1"
    q0: Annotated[float, Meta(ge=0, le=1)] = 0.98
    alpha: Annotated[float, Meta(gt=0, le=1)] = 0.1
    tau0: Annotated[float, Meta(ge=1e-12, le=1e6)] = 0.1
    visibility: Literal["neighbour", "distance", "fewest-open"] = "fewest-open"
    beta: Annotated[float, Meta(ge=0, le=10)] = 2.0
    threads: Annotated[int, Meta(ge=1, le=64)] = 1
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    budget_s: Annotated[float, Meta(gt=0, le=3600)] = 0.1
    spare_share: Annotated[float, Meta(ge=0, le=1)] = 0.05
    line: Literal["cells", "quick", "thorough"] = "thorough"

    def colony(self) -> ColonyConfig:
        """Return these as a colony.

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


class MissionSettings(Section, MissionPolicy, frozen=True, kw_only=True):
    """The mission's policy, and where progress is kept.

    ``state_dir`` "" is the folder a service manager or the user has for that.
    """

    state_dir: str = ""

    def check_zones(self) -> None:
        """Check the standing zones as those of an order.

        Raises:
            BadConfiguration: one is wrong, two have one name, or a mask that is inline is none.
        """
        if self.keep_out_mask.startswith(INLINE):
            mask_polygons(self.keep_out_mask)
        zones = [ZoneDocument(name=zone.name, polygon=zone.polygon) for zone in self.zones]
        keep_out = [list(polygon) for polygon in self.keep_out]
        try:
            order_of(OrderDocument(zones=zones, keep_out=keep_out))
        except OrderError as error:
            raise BadConfiguration(f"mission.{error}") from error

    def state_folder(self, environ: Mapping[str, str] = os.environ) -> Path:
        """Return the folder of the coverage ledger.

        By default systemd's $STATE_DIRECTORY, else fasaco-edge in an absolute $XDG_STATE_HOME,
        else in ~/.local/state; BadConfiguration where there is no such home.
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
        raise BadConfiguration(f"mission.state_dir: {path}: there is no home folder") from error


class FleetConfig(Section, frozen=True):
    """Robots under one ``bus.base`` with this name and one map frame share the work in an area."""

    name: Annotated[str, Meta(min_length=1, max_length=64)]


class BatteryConfig(Section, BatteryPolicy, frozen=True, kw_only=True):
    """When to charge; without the block ``battery`` the robot never does by itself."""


class RecordingConfig(Section, frozen=True):
    """How large and how old a file may become, and what all may take.

    The next file begins after ``part_mb`` [MB] or ``part_min`` [min], 0 for never. Above
    ``quota_mb`` [MB] of this robot's files the oldest are deleted; 0 for no limit. Recording pauses
    while the disk has less than ``least_free_mb`` [MB] free.
    """

    part_mb: Annotated[int, Meta(ge=1, le=100_000)] = 64
    part_min: Annotated[float, Meta(ge=0, le=10_000)] = 10.0
    quota_mb: Annotated[int, Meta(ge=0, le=100_000_000)] = 2000
    least_free_mb: Annotated[int, Meta(ge=0, le=100_000_000)] = 200


class DaemonConfig(Section, frozen=True):
    """The whole configuration; without ``fleet`` the robot is alone, without ``ros2`` nothing is
    published or subscribed under ROS."""

    robot: RobotConfig = RobotConfig()
    bus: BusConfig = BusConfig()
    map: MapConfig = MapConfig()
    pose: PoseConfig = PoseConfig()
    planner: PlannerConfig = PlannerConfig()
    mission: MissionSettings = MissionSettings()
    battery: BatteryConfig | msgspec.UnsetType = msgspec.UNSET
    recording: RecordingConfig = RecordingConfig()
    metrics: MetricsConfig = MetricsConfig()
    fleet: FleetConfig | msgspec.UnsetType = msgspec.UNSET
    ros2: RosConfig | msgspec.UnsetType = msgspec.UNSET

    @property
    def cell_m(self) -> float:
        """Edge of a cell [m]: lanes of a line overlap, those through centres lie side by side."""
        robot = self.robot
        if self.planner.line == "cells":
            return robot.tool_width_m
        return robot.tool_width_m * (1.0 - robot.overlap)

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


def load_config(path: Path | None) -> DaemonConfig:
    """Read a YAML file; without one return the defaults.

    Raises:
        BadConfiguration: the file is missing, is no YAML, has unknown keys or
            impossible values; the text names key, value and what is allowed.
    """
    config, faults = inspect_config(path)
    if config is not None:
        return config
    first, *more = faults
    where = f"{path}, line {first.line}" if first.line else str(path)
    hint = first.error.hint
    if more:
        others = f"the {len(more)} others" if len(more) > 1 else "another one"
        hint += f"; fasaco-edge check-config {path} shows {others}"
    raise type(first.error)(f"{where}: {first.error}", hint=hint) from first.error


def with_mask(config: DaemonConfig, file: Path | None) -> DaemonConfig:
    """Return a configuration that holds its keep-out mask itself.

    Args:
        config: with the name of a file, sought from the configuration's own folder.
        file: of the configuration.

    Raises:
        BadConfiguration: the mask cannot be read.
    """
    mission = config.mission
    if not mission.keep_out_mask or mission.keep_out_mask.startswith(INLINE):
        return config
    path = (file or Path()).parent / mission.keep_out_mask
    mask = inline_mask(path, config.map.occupied_at_least)
    return structs.replace(config, mission=structs.replace(mission, keep_out_mask=mask))


def decode_config(document: bytes) -> DaemonConfig:
    """Return a configuration from the JSON that another process of the package has encoded.

    Raises:
        BadConfiguration: it is none.
    """
    try:
        return msgspec.json.decode(document, type=DaemonConfig)
    except msgspec.DecodeError as error:
        raise BadConfiguration(f"configuration on standard input: {error}") from error


def inspect_config(path: Path | None) -> tuple[DaemonConfig | None, tuple[Fault, ...]]:
    """Read a YAML file; return the configuration, or None and all faults.

    Whether values fit together is checked once each is valid by itself.
    """
    if path is None:
        return DaemonConfig(), ()
    try:
        text = read_text(path)
    except BadConfiguration as error:
        return None, (Fault("", error),)
    faults = [*text.twice, *section_faults(DaemonConfig, text.document)]
    if not faults:
        config = msgspec.convert(with_credentials(text.document), DaemonConfig)
        faults = [Fault(_named_in(error), error) for error in _misfits(config)]
        if not faults:
            return config, ()
    return None, tuple(
        replace(fault, line=fault.line or text.line_of(fault.key)) for fault in faults
    )


def _named_in(error: BadConfiguration) -> str:
    """Return the key at the start of an error."""
    match = re.match(r"[\w.\[\]]*", str(error))
    return match[0] if match else ""


def _misfits(config: DaemonConfig) -> Iterator[BadConfiguration]:
    """Yield values that do not fit together."""
    low, high = config.map.free_at_most, config.map.occupied_at_least
    if low >= high:
        yield BadConfiguration(
            f"map.free_at_most must be below map.occupied_at_least, got {low} and {high}"
        )
    bus = config.bus
    if not (bus.listen or bus.connect):
        yield BadConfiguration("bus.listen and bus.connect must not both be empty")
    yield from security_faults(
        bus.security, bus.listen, bus.connect, open_to_everyone=bus.open_to_everyone
    )
    if bus.security.roles.ros and not config.ros2:
        yield BadConfiguration("bus.security.roles.ros: without a block ros2 there is no such role")
    part_mb, quota_mb = config.recording.part_mb, config.recording.quota_mb
    if 0 < quota_mb < 2 * part_mb:
        yield BadConfiguration(
            f"recording.quota_mb must be 0 or at least twice recording.part_mb, {2 * part_mb}, "
            f"got {quota_mb}"
        )
    yield from _refused("", config.metrics.address)
    if "\0" in config.mission.state_dir:
        yield BadConfiguration("mission.state_dir must be a path, got one with a NUL")
    if (battery := config.battery) and battery.enough < max(battery.low, battery.reserve) + 0.1:
        yield BadConfiguration(
            "battery.enough must be at least 0.1 above battery.low and battery.reserve, got "
            f"{battery.enough:g}, {battery.low:g} and {battery.reserve:g}"
        )
    if config.ros2:
        for error in config.ros2.faults():
            yield BadConfiguration(f"ros2.{error}")
    yield from _refused("bus.", lambda: Keys(base=config.bus.base))
    yield from _refused("robot.name: ", lambda: Keys(robot=config.robot.name))
    yield from _refused("robot: ", config.robot.cost)
    yield from _refused("planner.", config.planner.colony)
    yield from _refused("", config.mission.check_zones)


def _refused(before: str, make: Callable[[], object]) -> Iterator[BadConfiguration]:
    """Yield why ``make`` refuses a value, if it does."""
    try:
        make()
    except BadConfiguration as error:
        yield BadConfiguration(before + str(error), hint=error.hint)
