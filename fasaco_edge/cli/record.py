"""``fasaco-edge record``: the recorder of one robot or of a whole fleet."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from fasaco_edge.cli.console.arguments import Subcommand, add_robot_on_bus, fleet_name, robot_on_bus
from fasaco_edge.cli.console.checked_options import checked_members
from fasaco_edge.cli.console.terminal import err
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.documents import converted

if TYPE_CHECKING:
    from fasaco_edge.bus.settings import BusSettings
    from fasaco_edge.config.config import DaemonConfig
    from fasaco_edge.config.ros import RosConfig


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write to")
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="the daemon's YAML configuration, for robot, bus, pose and recording, in place of "
        "these options; - reads JSON from standard input",
    )
    parser.add_argument(
        "--fleet",
        type=fleet_name,
        metavar="NAME",
        help="record all robots of this fleet (`fleet: {name: NAME}`) into one file, also robots "
        "that join later. Maps and poses come from the native keys, not from ROS 2",
    )
    parser.add_argument(
        "--ros2",
        type=ros_config,
        metavar="JSON",
        help="also record the topics of this block ros2 of a daemon's configuration; not with "
        "--fleet",
    )
    parser.add_argument(
        "--quota-mb",
        type=int,
        default=0,
        metavar="MB",
        help="limit on the size of the robot's recordings in DIR [MB]: above it the oldest files "
        "are deleted, but not the file being written; 0 for no limit (default: %(default)s)",
    )
    add_robot_on_bus(parser, config=False)


def ros_config(text: str) -> RosConfig:
    """Read the block ``ros2`` of a configuration."""
    from fasaco_edge.config.ros import RosConfig

    try:
        return converted(RosConfig, msgspec.json.decode(text), BadConfiguration)
    except (msgspec.DecodeError, BadConfiguration) as error:
        raise argparse.ArgumentTypeError(f"ros2: {error}") from error


def run(args: argparse.Namespace) -> int:
    """Record until SIGTERM or SIGINT.

    Raises:
        BadConfiguration: options contradict each other, or the configuration is invalid.
    """
    if args.fleet is not None and args.ros2 is not None:
        raise BadConfiguration(
            "--ros2: a fleet's recording has only native keys",
            hint="leave --ros2 out, or record each robot",
        )
    earlier = set(args.out.glob("*.rrd"))
    is_watched = sys.stderr.isatty()
    if is_watched:
        err().print(f"records into {args.out}; Ctrl-C ends it")
    code = _record(args)
    if is_watched:
        for file in sorted(set(args.out.glob("*.rrd")) - earlier):
            err().print(str(file), soft_wrap=True)
    return code


def _record(args: argparse.Namespace) -> int:
    from fasaco_edge.recording.write.quota import budget_of
    from fasaco_edge.recording.write.recorder import run_recorder

    if args.config is None:
        config, bus = config_of_options(args)
    else:
        config, bus = read_config(args.config)
    if args.fleet is not None:
        from fasaco_edge.cli.fleet_wing import file_name, run_fleet_recorder

        budget = budget_of(config, args.out, file_name(args.fleet))
        return run_fleet_recorder(config, bus, args.fleet, budget)
    return run_recorder(config, bus, budget_of(config, args.out))


def config_of_options(args: argparse.Namespace) -> tuple[DaemonConfig, BusSettings]:
    """Return the configuration and bus settings by the options."""
    from fasaco_edge.config.config import DaemonConfig, RecordingConfig
    from fasaco_edge.config.robot import RobotConfig
    from fasaco_edge.config.security import BusConfig

    keys, bus, _ = robot_on_bus(args)
    limits = checked_members(RecordingConfig, args, {"quota_mb": "quota_mb"})
    config = DaemonConfig(
        robot=RobotConfig(name=keys.robot),
        bus=BusConfig(base=keys.base),
        recording=RecordingConfig(**limits),
        ros2=args.ros2 or msgspec.UNSET,
    )
    return config, bus


def read_config(file: Path) -> tuple[DaemonConfig, BusSettings]:
    """Return the daemon's configuration, and the bus settings of its client on this computer.

    Raises:
        BadConfiguration: the file, or the document on standard input, is invalid.
    """
    from fasaco_edge.config.loading import decode_config, load_config

    on_input = str(file) == "-"
    config = decode_config(sys.stdin.buffer.read()) if on_input else load_config(file)
    return config, config.bus.of_client()


COMMAND = Subcommand(
    description="Record map, swept floor, pheromone, path, pose, states and latencies of one "
    "robot, and all messages to its mission, byte for byte; or record all robots of a fleet on one "
    "map. It ends at SIGTERM or SIGINT. Open the result with `rerun FILE.rrd`; run its mission "
    "again with `fasaco-edge replay FILE.rrd`.",
    run=run,
    add_options=_add_options,
)
