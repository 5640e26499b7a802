"""``fasaco-edge record``: write what is said on the bus into a recording."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.cli.arguments import add_robot_on_bus, client_settings
from fasaco_edge.wire.poses import POSE_SCHEMAS
from fasaco_edge.wire.schemas import POSE_STAMPED

if TYPE_CHECKING:
    from fasaco_edge.cli.arguments import Subparsers


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
        "--pose-schema",
        choices=POSE_SCHEMAS,
        default=POSE_STAMPED,
        metavar="TYPE",
        help=f"type of poses that come without one: {', '.join(POSE_SCHEMAS)} "
        "(default: %(default)s)",
    )
    add_robot_on_bus(parser)
    parser.set_defaults(command=run)


def run(args: argparse.Namespace) -> int:
    """Record."""
    from fasaco_edge.recording.recorder import run_recorder
    from fasaco_edge.recording.settings import RecorderSettings

    settings = RecorderSettings(
        out=args.out,
        robot=args.robot,
        base=args.base,
        bus=client_settings(args),
        pose_schema=args.pose_schema,
    )
    return run_recorder(settings)
