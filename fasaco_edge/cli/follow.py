"""``fasaco-edge follow``: the driver of a robot's base along its path.

Reading the configuration takes more memory than driving. So the process reads it, and then replaces
itself by a small process, which gets its settings through a pipe.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from typing import TYPE_CHECKING, NoReturn

from fasaco_edge.cli.console.arguments import (
    Exit,
    Subcommand,
    add_robot_on_bus,
    robot_on_bus,
    seconds,
)
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.processes import python_program, stop_event

if TYPE_CHECKING:
    from collections.abc import Callable

    from fasaco_edge.bus.session import Bus
    from fasaco_edge.config.config import DaemonConfig
    from fasaco_edge.config.robot import RobotConfig
    from fasaco_edge.config.ros import RosConfig
    from fasaco_edge.follow.estimate import BaseLimits
    from fasaco_edge.follow.node import Node
    from fasaco_edge.follow.settings import FollowSettings, PoseSource

# Descriptor of standard input; sys.stdin is None if it is closed.
STDIN = 0
# Default of ros2.nav2.near_m, as a share of the tool's width: less than the distance of two lanes,
# and more than a robot's distance from its lane.
NEAR_SHARE = 0.75
MOST_PACE = 100.0
EPILOG = """\
Speeds and accelerations are those of the configuration: robot.speed_m_s, acceleration_m_s2,
turn_deg_s, turn_deg_s2, steered_deg and turn_radius_m. If the configuration has a block ros2, poses
come from its topics and velocities go to ros2.topics.cmd_vel; else the keys are `pose` and
`cmd_vel`.
The robot rounds corners up to 135 degrees in motion, within 2 cm; at sharper corners it turns on
the spot. With robot.turn_radius_m it steers along curves instead, and never turns on the spot. It
drives backward where the heading of the path is opposite to its direction, and comes to rest only
where it changes between forward and backward.

It stops the robot within 0.2 s, and keeps it standing, while
  the newest pose is older than --pose-age, missing, malformed, or has jumped; with poses from tf,
    while odometry is older than --pose-age, or the localiser's transform is older than 2 s (or than
    --pose-age, if longer)
  the configuration has a block scan, and no usable scan has arrived for scan.lost_s
  the scan shows something ahead that the map does not show: the robot slows down before it, and
    drives on once it is gone
  the path is empty (mission pause, cancel; done), missing, malformed, or driven to its end
  the robot is further than 0.3 m off the path, or does not move as commanded (three tries in one
    place and direction, 2 and 4 s apart)
  no daemon plans for it, or the daemon that plans has sent no status for 2.5 s
  another follower drives this robot: this follower then sends nothing, and takes over once the
    other is gone
  access rules hide this follower from other followers
and when this program ends. The robot drives on by itself once the reason is gone. After the third
try it drives on once the pose has moved by 0.1 m, or the path leads elsewhere (by 45 degrees or
more). A pose with the stamp of the previous pose does not count as new.
Zeros are sent for a second after a stop, then nothing. A base has to stop by itself if nothing
arrives for 0.5 s: nothing else can stop it if this program or its computer dies.

With `ros2.follow: nav2` this program sends no velocities: Nav2's controller gets the path, piece by
piece, as goals of /follow_path (nav2_msgs/FollowPath). They are cancelled for the same reasons, and
their results are reported here. If this program or its computer dies, Nav2 drives to the end of the
present goal, at most 20 m.

examples:
  fasaco-edge follow --config /etc/fasaco-edge/config.yaml --dry-run
  fasaco-edge follow --config /etc/fasaco-edge/config.yaml --stamped

exit codes: 0 ended by a signal; 78 wrong configuration
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--dry-run", action="store_true", help="print what would be sent, and send nothing"
    )
    parser.add_argument(
        "--stamped",
        action="store_true",
        help="send geometry_msgs/TwistStamped in place of geometry_msgs/Twist",
    )
    parser.add_argument(
        "--pose-age",
        type=seconds(0.05, 10.0),
        default=0.5,
        metavar="S",
        help="largest age of the newest pose, by its arrival [s]; the robot stops if it is older "
        "(default: %(default)g)",
    )
    parser.add_argument(
        "--speed",
        type=float,
        metavar="X",
        help="simulated seconds per second, for a simulated robot (default: 1; required if "
        "robot.time_scale of --config is not 1)",
    )
    add_robot_on_bus(parser)
    parser.add_argument("--given", action="store_true", help=argparse.SUPPRESS)


def run(args: argparse.Namespace) -> int:
    """Drive until SIGTERM or SIGINT."""
    return _drive() if args.given else _become_small(args)


def _become_small(args: argparse.Namespace) -> NoReturn:
    """Read the settings, and replace the process by a small one that drives."""
    document = settings_of(args).encode()
    # The settings may hold a password, and other users can read a command line: use a pipe.
    reading, writing = os.pipe()
    os.write(writing, document)
    os.close(writing)
    os.dup2(reading, STDIN)
    # If standard input was closed, the pipe may have its number, and would close at the exec.
    os.set_inheritable(STDIN, True)
    words = ["follow", "--given", "--log-level", args.log_level]
    if args.with_parent is not None:
        words += ["--with-parent", str(args.with_parent)]
    program = python_program("fasaco_edge", *words)
    os.execv(program[0], program)


def _drive() -> int:
    """Drive until SIGTERM or SIGINT, in the small process."""
    from fasaco_edge.follow.node import FollowerNode, run_follower
    from fasaco_edge.follow.settings import FollowSettings

    settings = FollowSettings.decode(sys.stdin.buffer.read())
    node_of: Callable[[Bus, FollowSettings, Callable[[str], None]], Node] = FollowerNode
    if settings.nav2:
        from fasaco_edge.follow.nav2_node import Nav2Node

        node_of = Nav2Node
    with stop_event() as stop:
        run_follower(settings, stop, node_of, lambda line: print(line, flush=True))
    return Exit.OK


def settings_of(args: argparse.Namespace) -> FollowSettings:
    """Return the settings by options, configuration and environment.

    Raises:
        BadConfiguration: an option or the configuration is invalid.
    """
    from fasaco_edge.config.config import DaemonConfig
    from fasaco_edge.follow.settings import FollowSettings, PoseSource
    from fasaco_edge.wire import schemas, topics

    here = robot_on_bus(args)
    config = here.config or DaemonConfig()
    robot, ros = config.robot, config.ros2 or None
    schema = schemas.TWIST_STAMPED if args.stamped else schemas.TWIST
    poses = (PoseSource(here.keys.of(topics.POSE)),)
    return FollowSettings(
        robot=here.keys.robot,
        base=here.keys.base,
        connect=here.bus.connect,
        secured=here.bus.secured,
        limits=limits_of(robot),
        pose_schema=config.pose.schema,
        pose_age_s=args.pose_age,
        poses=_ros_poses(ros) if ros else poses,
        frames=(ros.frames.map, ros.frames.robot) if ros and ros.pose == "tf" else None,
        schema=schema,
        frame=ros.frames.robot if ros else "base_link",
        cmd_key=ros.output_key(ros.topic("cmd_vel", schema))
        if ros
        else here.keys.of(topics.CMD_VEL),
        ros=_ros_node(ros, schema) if ros else {},
        nav2=_nav2(config) if ros and ros.follow == "nav2" else {},
        scan=_scan(config) if config.scan and not (ros and ros.follow == "nav2") else {},
        radius_m=robot.radius_m,
        pace=_pace(args, robot),
        dry_run=args.dry_run,
    )


def _pace(args: argparse.Namespace, robot: RobotConfig) -> float:
    """Return the simulated seconds per second.

    A time scale left over from a simulation would give a real robot a wrong clock.
    """
    pace, where = (
        (robot.time_scale, "robot.time_scale") if args.speed is None else (args.speed, "--speed")
    )
    if not 0.0 < pace <= MOST_PACE:
        raise BadConfiguration(f"{where} must be above 0 and at most {MOST_PACE:g}, got {pace:g}")
    if args.speed is None and pace != 1.0:
        raise BadConfiguration(
            f"robot.time_scale is {pace:g}: that of a simulated robot",
            hint=f"add --speed {pace:g} if the robot is simulated; else remove robot.time_scale",
        )
    return pace


def limits_of(robot: RobotConfig) -> BaseLimits:
    """Return the limits of a base on speeds and accelerations."""
    from fasaco_edge.follow.estimate import BaseLimits

    return BaseLimits(
        robot.speed_m_s,
        robot.acceleration_m_s2,
        math.radians(robot.turning_deg_s()),
        math.radians(robot.turn_deg_s2),
        math.radians(robot.steered_deg),
        robot.turn_radius_m,
    )


def _ros_poses(ros: RosConfig) -> tuple[PoseSource, ...]:
    from fasaco_edge.follow.settings import PoseSource
    from fasaco_edge.wire.topics import TF_STATIC

    return tuple(
        PoseSource(
            ros.input_key(topic), topic.schema, topic.latched, topic.depth, name == TF_STATIC
        )
        for name, topic in ros.inputs.items()
        if name in ("pose", TF_STATIC)
    )


def _scan(config: DaemonConfig) -> dict[str, object]:
    scan, ros = config.scan, config.ros2
    assert scan
    sources = {"scan": ros.topic("scan"), **ros.inputs} if ros else {}
    return {
        "mount": {
            "x": scan.x_m,
            "y": scan.y_m,
            "yaw": math.radians(scan.yaw_deg),
            "upside_down": scan.upside_down,
        },
        "lost_s": scan.lost_s,
        "free_at_most": config.map.free_at_most,
        "most_pixels": config.map.max_pixels,
        "topics": [
            (name, ros.input_key(topic), topic.latched, topic.depth)
            for name, topic in sources.items()
            if ros and name in ("scan", "map", "map_update")
        ],
    }


def _ros_node(ros: RosConfig, schema: str) -> dict[str, object]:
    return {
        "kind": ros.kind,
        "domain": ros.domain,
        "namespace": ros.namespace,
        "node": f"{ros.node}_follow",
        "topic": ros.topic("cmd_vel", schema).name,
    }


def _nav2(config: DaemonConfig) -> dict[str, object]:
    assert config.ros2
    ros, nav2 = config.ros2, config.ros2.nav2
    names = (nav2.controller, nav2.goal_checker, nav2.progress_checker, nav2.path_handler)
    near_m = nav2.near_m if nav2.near_m is not None else NEAR_SHARE * config.robot.tool_width_m
    return {
        "action": ros.full_name(nav2.action),
        "release": nav2.release,
        "plugins": names,
        "near_m": near_m,
    }


COMMAND = Subcommand(
    description="Drive a robot's base along the path of its daemon: subscribe to path and pose, "
    "publish velocities (geometry_msgs/Twist) 20 times a second, until SIGTERM or SIGINT. For "
    "robots whose base takes velocities, and that have no other program to follow a path.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
