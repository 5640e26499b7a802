"""``fasaco-edge record``: write what is said on the bus into a recording."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.cli.arguments import add_robot_on_bus
from fasaco_edge.wire.poses import POSE_SCHEMAS
from fasaco_edge.wire.schemas import POSE_STAMPED

if TYPE_CHECKING:
    from fasaco_edge.cli.arguments import Subparsers
    from fasaco_edge.daemon.ros_config import RosConfig

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 9876


def add_to(commands: Subparsers, common: argparse.ArgumentParser) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "record",
        parents=[common],
        help="record a robot's mission into a Rerun recording (.rrd)",
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
    parser.set_defaults(command=run)


def ros_config(text: str) -> RosConfig:
    """Read the block ``ros2`` of a configuration."""
    import msgspec

    from fasaco_edge.daemon.ros_config import RosConfig

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
    from fasaco_edge.cli.recorder_settings import of_daemon, of_options
    from fasaco_edge.recording.recorder import run_recorder

    return run_recorder(of_options(args) if args.config is None else of_daemon(args))
