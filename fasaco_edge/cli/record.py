"""What a recorder is told: by the options of its command, or by the daemon's configuration.

``fasaco-edge record``: write what is said on the bus into a recording.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.bus.session import BusSettings
from fasaco_edge.cli.console.arguments import add_command, add_robot_on_bus, client_settings
from fasaco_edge.config.config import load_config
from fasaco_edge.config.endpoints import from_here
from fasaco_edge.config.ros import RosConfig
from fasaco_edge.recording.write.settings import MEGABYTE, RecorderSettings, RosInput
from fasaco_edge.wire.pose_decoding import DEFAULT_FRAMES
from fasaco_edge.wire.poses import POSE_SCHEMAS
from fasaco_edge.wire.ros_keys import RosTopic
from fasaco_edge.wire.schemas import POSE_STAMPED

if TYPE_CHECKING:
    from fasaco_edge.cli.console.arguments import Subparsers
    from fasaco_edge.config.ros import RosConfig


def of_options(args: argparse.Namespace) -> RecorderSettings:
    """Return what the options of ``fasaco-edge record`` say."""
    return RecorderSettings(
        out=args.out,
        robot=args.robot,
        base=args.base,
        bus=client_settings(args),
        pose_schema=args.pose_schema,
        ros=_ros_inputs(args.ros2) if args.ros2 else (),
        frames=_frames(args.ros2),
        part_bytes=args.part_mb * MEGABYTE,
        part_s=60.0 * args.part_min,
        quota_bytes=args.quota_mb * MEGABYTE,
        least_free_bytes=args.least_free_mb * MEGABYTE,
        serve=args.serve,
    )


def of_daemon(args: argparse.Namespace) -> RecorderSettings:
    """Return what the daemon's configuration, ``args.config``, says.

    Raises:
        BadConfiguration: the file is wrong.
    """
    config = load_config(args.config)
    bus, room = config.bus, config.recording
    bus.security.warn_of_clock()
    endpoints = tuple(map(from_here, bus.listen or bus.connect))
    return RecorderSettings(
        out=args.out,
        robot=config.robot.name,
        base=bus.base,
        bus=BusSettings("client", endpoints, secured=bus.security.of_client()),
        pose_schema=config.pose.schema,
        ros=_ros_inputs(config.ros2) if config.ros2 else (),
        frames=_frames(config.ros2 or None),
        part_bytes=room.part_mb * MEGABYTE,
        part_s=60.0 * room.part_min,
        quota_bytes=room.quota_mb * MEGABYTE,
        least_free_bytes=room.least_free_mb * MEGABYTE,
        serve=args.serve,
    )


def _frames(config: RosConfig | None) -> tuple[str, str]:
    return (config.frames.map, config.frames.robot) if config else DEFAULT_FRAMES


def _ros_inputs(config: RosConfig) -> tuple[RosInput, ...]:
    def key(topic: RosTopic) -> str:
        is_bridge = config.kind == "bridge"
        return topic.bridge_key if is_bridge else topic.rmw_key(config.domain, any_hash=True)

    topics = {"map": config.map, "map_update": config.map_updates, **config.poses}
    return tuple(
        RosInput(name, key(topic), topic.schema, topic.latched, topic.depth)
        for name, topic in topics.items()
    )


DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 9876


def add_to(commands: Subparsers, common: argparse.ArgumentParser) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        common,
        "record",
        run,
        about="record a robot's mission into a Rerun recording (.rrd)",
        description="Record map, coverage, pheromone, path, pose, states and latencies of one "
        "robot, and byte for byte what its mission hears, until SIGTERM or SIGINT. Open the result "
        "with `rerun FILE.rrd`, play it again with `fasaco-edge replay FILE.rrd`.",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write to")
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="the daemon's YAML configuration: robot, bus, pose and recording, in place of the "
        "options for those",
    )
    parser.add_argument(
        "--pose-schema",
        choices=POSE_SCHEMAS,
        default=POSE_STAMPED,
        metavar="TYPE",
        help=f"type of poses that come without one: {', '.join(POSE_SCHEMAS)} "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--ros2",
        type=ros_config,
        metavar="JSON",
        help="the block ros2 of the daemon's configuration: hear these topics, too",
    )
    _add_room(parser)
    parser.add_argument(
        "--serve",
        type=address,
        nargs="?",
        const=(DEFAULT_HOST, DEFAULT_PORT),
        metavar="[HOST:]PORT",
        help="let viewers watch, too: `rerun rerun+http://HOST:PORT/proxy`; anybody who reaches "
        f"the port may (default: {DEFAULT_HOST}:{DEFAULT_PORT})",
    )
    add_robot_on_bus(parser)


def ros_config(text: str) -> RosConfig:
    """Read the block ``ros2`` of a configuration."""
    import msgspec

    from fasaco_edge.config.ros import RosConfig

    try:
        config = msgspec.json.decode(text, type=RosConfig)
    except msgspec.DecodeError as error:
        raise argparse.ArgumentTypeError(f"ros2: {error}") from error
    for fault in config.faults():
        raise argparse.ArgumentTypeError(f"ros2: {fault}")
    return config


def address(text: str) -> tuple[str, int]:
    """Read ``HOST:PORT`` or ``PORT``; an IPv6 host stands in brackets."""
    host, _, port = text.rpartition(":")
    if not (port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise argparse.ArgumentTypeError(f"must be [HOST:]PORT, got {text!r}")
    return host.strip("[]") or DEFAULT_HOST, int(port)


def _add_room(parser: argparse.ArgumentParser) -> None:
    room = parser.add_argument_group("room on the disk")
    room.add_argument(
        "--part-mb",
        type=int,
        default=64,
        metavar="MB",
        help="go on in the next file after so many megabytes (default: %(default)s)",
    )
    room.add_argument(
        "--part-min",
        type=float,
        default=10.0,
        metavar="MIN",
        help="or minutes; 0 for never (default: %(default)g)",
    )
    room.add_argument(
        "--quota-mb",
        type=int,
        default=0,
        metavar="MB",
        help="of more than this of the robot's recordings in DIR delete the oldest files, never "
        "the one being written; 0 for no limit (default: %(default)s)",
    )
    room.add_argument(
        "--least-free-mb",
        type=int,
        default=50,
        metavar="MB",
        help="write nothing while the disk has less room (default: %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Record."""
    from fasaco_edge.cli.record import of_daemon, of_options
    from fasaco_edge.recording.write.recorder import run_recorder

    return run_recorder(of_options(args) if args.config is None else of_daemon(args))
