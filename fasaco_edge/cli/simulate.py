"""``fasaco-edge simulate``: a simulated robot that maps a building and follows the path."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fasaco_edge.cli.console.arguments import (
    DEFAULT_RADIUS_M,
    Subcommand,
    add_robot_on_bus,
    check_outputs,
    pair_of_floats,
    robot_on_bus,
    writing,
)
from fasaco_edge.cli.console.checked_options import checked_members
from fasaco_edge.cli.console.terminal import ProgressLines, out, say
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.map_files import find_map, map_sources, read_map
from fasaco_edge.text import percent

if TYPE_CHECKING:
    from fasaco_edge.simulation.node import Progress
    from fasaco_edge.simulation.world import World

# Options, and the members of ``RobotConfig`` that they set.
ROBOT_OPTIONS = {
    "speed": "time_scale",
    "robot_radius": "radius_m",
    "turn_radius": "turn_radius_m",
}


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("map", metavar="MAP", help="map_server YAML, or a name from `maps`")
    parser.add_argument(
        "--speed",
        type=float,
        metavar="X",
        help="simulated seconds per second; the daemon's configuration needs the same "
        "robot.time_scale, so that reviews of a recording are correct (default: that of --config, "
        "else 1)",
    )
    parser.add_argument(
        "--driver",
        choices=("ideal", "follow"),
        default="ideal",
        help="ideal: the simulation moves the robot along its path; follow: `fasaco-edge follow`, "
        "started with the same --speed, drives it (default: %(default)s)",
    )
    parser.add_argument(
        "--start-xy", type=pair_of_floats, metavar="X,Y", help="start position of the robot [m]"
    )
    parser.add_argument(
        "--robot-radius",
        type=float,
        metavar="M",
        help=f"radius [m] (default: that of --config, else {DEFAULT_RADIUS_M:g})",
    )
    parser.add_argument(
        "--range", type=float, default=3.5, metavar="M", help="range of the scanner [m]"
    )
    parser.add_argument(
        "--map-hz", type=float, default=2.0, metavar="HZ", help="maps per simulated second, 1 to 5"
    )
    parser.add_argument(
        "--battery-min",
        type=float,
        default=0.0,
        metavar="MIN",
        help="battery life [simulated min]; the robot charges at its start; 0: unlimited "
        "(default: %(default)g)",
    )
    parser.add_argument(
        "--turn-radius",
        type=float,
        default=0.0,
        metavar="M",
        help="radius of the base's tightest arc [m], forward and backward; needs --driver follow; "
        "0: the base turns on the spot (default: %(default)g)",
    )
    parser.add_argument(
        "--meets-others",
        action="store_true",
        help="stop before other robots on the bus, which have the same size",
    )
    parser.add_argument(
        "--trail-out", type=Path, metavar="FILE.csv", help="write the driven positions, header x,y"
    )
    add_robot_on_bus(parser)


def run(args: argparse.Namespace) -> int:
    """Simulate until SIGTERM or SIGINT."""
    from fasaco_edge.config.robot import RobotConfig
    from fasaco_edge.planners.grids import start_point
    from fasaco_edge.simulation.node import run_simulation
    from fasaco_edge.simulation.robot import SimulationConfig
    from fasaco_edge.simulation.world import World

    path = find_map(args.map)
    check_outputs([args.trail_out], map_sources(path))
    here = robot_on_bus(args)
    robot = RobotConfig() if here.config is None else here.config.robot
    robot = msgspec.structs.replace(robot, **checked_members(RobotConfig, args, ROBOT_OPTIONS))
    if not 1.0 <= args.map_hz <= 5.0:
        raise BadConfiguration(f"--map-hz must be 1 to 5, got {args.map_hz:g}")
    if not 0.0 < args.range < math.inf:
        raise BadConfiguration(f"--range must be above 0 m, got {args.range:g}")
    if not 0.0 <= args.battery_min < math.inf:
        raise BadConfiguration(f"--battery-min must be at least 0, got {args.battery_min:g}")
    config = SimulationConfig(
        robot_radius_m=robot.radius_m,
        speed_m_s=robot.speed_m_s,
        range_m=args.range,
        map_hz=args.map_hz,
        battery_min=args.battery_min,
        turn_radius_m=args.turn_radius,
    )
    if args.turn_radius and args.driver == "ideal":
        raise BadConfiguration("--turn-radius needs --driver follow")
    truth = read_map(path)
    x, y = args.start_xy or start_point(path, truth, config.robot_radius_m)
    world = World(truth, Pose2D(x, y), config)
    with ProgressLines("{task.description}") as shown:
        task = shown.add_task("waits for a router")
        result = run_simulation(
            world,
            here.keys,
            here.bus,
            speed=robot.time_scale,
            driver=args.driver,
            meets_others=args.meets_others,
            waits=True,
            report=lambda progress: shown.update(task, description=_words(world, progress)),
        )
    if result is None:
        return 0
    if args.trail_out is not None:
        with writing(args.trail_out) as file:
            np.savetxt(file, world.track, "%.4f", ",", header="x,y", comments="")
    say(
        out(),
        f"drove {world.distance_m:.1f} m in {1e-9 * world.stamp_ns:.0f} simulated s, "
        f"{world.collisions} collisions, {world.stops} stops before a wall, "
        f"longest standstill {world.longest_stand_s:.1f} s",
    )
    if args.meets_others:
        print(f"touched other robots {world.touches} times, stopped {world.meetings} times")
    if world.battery is not None:
        battery = world.battery
        print(f"charged {battery.charges} times, never below {percent(battery.lowest)}")
    return 0


def _words(world: World, progress: Progress) -> str:
    """Return the robot's progress as one line of text."""
    sim_s, pose = 1e-9 * world.stamp_ns, world.pose
    return (
        f"{sim_s:8.1f} s  x {progress.speed:5.1f}  ({pose.x:7.2f}, {pose.y:7.2f}) m"
        f"  {world.distance_m:7.1f} m driven  {world.collisions} collisions"
    )


COMMAND = Subcommand(
    description="Simulate a differential-drive robot with a 360-degree scanner in a building that "
    "it does not know. It publishes its pose and the map scanned so far, and follows the newest "
    "path, until SIGTERM or SIGINT. It waits for a daemon or router.",
    run=run,
    add_options=_add_options,
)
