"""The daemon's configuration: typed, checked as a whole, nothing repaired."""

from __future__ import annotations

import re
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import msgspec
import yaml
from msgspec import Meta

from fasaco_edge.bus.session import DEFAULT_ENDPOINT, BusSettings
from fasaco_edge.daemon.credentials import with_credentials
from fasaco_edge.daemon.mission_settings import MissionSettings
from fasaco_edge.daemon.planner_config import PlannerConfig
from fasaco_edge.daemon.recording_config import RecordingConfig
from fasaco_edge.daemon.ros_config import RosConfig
from fasaco_edge.daemon.section import Section
from fasaco_edge.daemon.security_config import SecurityConfig, check_security
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.wire import schemas
from fasaco_edge.wire.keys import Keys

Metres = Annotated[float, Meta(gt=0, le=10)]
Percent = Annotated[int, Meta(ge=0, le=100)]


class RobotConfig(Section, frozen=True):
    """The robot: its name on the bus, its size [m], and what driving takes it.

    ``quarter_turn_s`` is a turn by 90 degrees on the spot [s], braking and starting
    included; 0 looks for the fewest steps whatever the turns.
    """

    name: str = "robot"
    radius_m: Metres = 0.18
    tool_width_m: Metres = 0.3
    speed_m_s: Annotated[float, Meta(gt=0, le=10)] = 0.25
    quarter_turn_s: Annotated[float, Meta(ge=0, le=600)] = 1.5

    def cost(self) -> CoverageCost:
        """Return what a step and a turn cost.

        Raises:
            BadConfiguration: a step would take less than a millisecond or more than an hour.
        """
        return CoverageCost.for_robot(self.tool_width_m, self.speed_m_s, self.quarter_turn_s)


class BusConfig(Section, frozen=True):
    """How to join the bus, and who else may.

    Beyond loopback nothing is listened on unless it stands here, and there nobody may speak
    without a name (``security``), unless ``open_to_everyone`` says so.
    """

    base: str = "fasaco"
    mode: Literal["peer", "client", "router"] = "peer"
    listen: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    connect: tuple[str, ...] = ()
    open_to_everyone: bool = False
    security: SecurityConfig = SecurityConfig()

    def settings(self, prefix: str, ros: RosConfig | None = None) -> BusSettings:
        """Return these as settings of the session of a robot; its keys begin with ``prefix``.

        ``ros`` has the keys it has besides.

        Raises:
            BadConfiguration: a file that shows who this is cannot be read.
        """
        part = self.security.of_daemon(prefix, ros.rights() if ros else None)
        if self.open_to_everyone:
            part |= self.security.thinned(prefix)
        return BusSettings(self.mode, self.connect, self.listen, part)


class MapConfig(Section, frozen=True):
    """What in an occupancy grid is free and occupied [percent], and the largest lattice."""

    free_at_most: Percent = 25
    occupied_at_least: Percent = 65
    max_lattice_cells: Annotated[int, Meta(ge=1, le=100_000_000)] = 500_000


class PoseConfig(Section, frozen=True):
    """The type of a pose whose sender names none, as ROS 2's do not."""

    schema: Literal[
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "nav_msgs/msg/Odometry",
    ] = schemas.POSE_STAMPED


class DaemonConfig(Section, frozen=True):
    """The whole configuration; without ``ros2`` the daemon has nothing to do with ROS."""

    robot: RobotConfig = RobotConfig()
    bus: BusConfig = BusConfig()
    map: MapConfig = MapConfig()
    pose: PoseConfig = PoseConfig()
    planner: PlannerConfig = PlannerConfig()
    mission: MissionSettings = MissionSettings()
    recording: RecordingConfig = RecordingConfig()
    ros2: RosConfig | msgspec.UnsetType = msgspec.UNSET

    def keys(self) -> Keys:
        """Return the keys of this robot.

        Raises:
            BadConfiguration: a name does not fit into a key.
        """
        return Keys(robot=self.robot.name, base=self.bus.base)


def load_config(path: Path | None) -> DaemonConfig:
    """Read a YAML file; without one return the defaults.

    Raises:
        BadConfiguration: the file is missing, is no YAML, has unknown keys or
            impossible values; the text names key, value and what is allowed.
    """
    if path is None:
        return DaemonConfig()
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadConfiguration(f"{path}: {error.strerror}") from error
    except RecursionError as error:
        raise BadConfiguration(f"{path}: not YAML: nested too deeply") from error
    except (yaml.YAMLError, ValueError) as error:  # ValueError: no UTF-8, no such date
        raise BadConfiguration(f"{path}: not YAML: {error}") from error
    try:
        read = with_credentials(document if document is not None else {})
        config = msgspec.convert(read, DaemonConfig)
        _check_together(config)
    except msgspec.ValidationError as error:
        raise BadConfiguration(f"{path}: {_explain(str(error), document)}") from error
    except BadConfiguration as error:
        raise type(error)(f"{path}: {error}", hint=error.hint) from error
    return config


def _check_together(config: DaemonConfig) -> None:
    """Check what no single value shows."""
    low, high = config.map.free_at_most, config.map.occupied_at_least
    if low >= high:
        raise BadConfiguration(
            f"map.free_at_most must be below map.occupied_at_least, got {low} and {high}"
        )
    if not (config.bus.listen or config.bus.connect):
        raise BadConfiguration("bus.listen and bus.connect must not both be empty")
    bus = config.bus
    check_security(bus.security, bus.listen, bus.connect, open_to_everyone=bus.open_to_everyone)
    if bus.security.roles.ros and not config.ros2:
        raise BadConfiguration("bus.security.roles.ros: without a block ros2 there is no such role")
    part_mb, quota_mb = config.recording.part_mb, config.recording.quota_mb
    if 0 < quota_mb < 2 * part_mb:
        raise BadConfiguration(
            f"recording.quota_mb must be 0 or at least twice recording.part_mb, {2 * part_mb}, "
            f"got {quota_mb}"
        )
    if "\0" in config.mission.state_dir:
        raise BadConfiguration("mission.state_dir must be a path, got one with a NUL")
    config.keys()
    if config.ros2:
        try:
            config.ros2.check()
        except BadConfiguration as error:
            raise BadConfiguration(f"ros2.{error}") from error
    try:
        config.robot.cost()
    except BadConfiguration as error:
        raise BadConfiguration(f"robot: {error}") from error
    try:
        config.planner.colony()
    except BadConfiguration as error:
        raise BadConfiguration(f"planner.{error}") from error


def _explain(message: str, document: object) -> str:
    """Turn ``Expected `int` >= 1 - at `$.planner.ants``` into key, expectation and value."""
    match = re.fullmatch(
        r"(?P<what>.*?)(?: - at (?P<as_key>`key` in )?`\$\.?(?P<key>[^`]*)`)?", message, re.DOTALL
    )
    assert match is not None
    what, key = match["what"].replace("`", ""), match["key"] or ""
    unknown = re.fullmatch(r"Object contains unknown field (?P<name>.*)", what)
    if unknown:
        return f"unknown key {'.'.join(filter(None, (key, unknown['name'])))}"
    value: Any = document
    for part in re.findall(r"[^.\[\]]+", key):
        value = value[int(part)] if isinstance(value, list) else value[part]
    expected = _choices(key) or what[0].lower() + what[1:].partition(", got")[0]
    if match["as_key"]:
        expected += " as key"
    elif expected == "expected str":
        expected += ", in quotes"  # YAML 1.1 takes 8:1 for a number
    return f"{key or 'the file'}: {expected}, got {value!r}"


def _choices(key: str) -> str:
    """Return what a key may be where that is one of a few names, else ""."""
    kind: Any = DaemonConfig
    for part in key.split("."):
        kind = get_type_hints(kind).get(part) if isinstance(kind, type) else None
        if get_origin(kind) is UnionType:  # of a section that may be left out
            kind = get_args(kind)[0]
    if get_origin(kind) is not Literal:
        return ""
    *others, last = get_args(kind)
    return "expected " + (f"{', '.join(others)} or {last}" if others else str(last))
