"""``fasaco-edge demo``: a mission of one or more simulated robots in an unknown building."""

from __future__ import annotations

import argparse
from datetime import datetime
from pathlib import Path

from fasaco_edge.cli.console.arguments import (
    DEFAULT_CELL_M,
    DEFAULT_RADIUS_M,
    Exit,
    Subcommand,
    add_json,
    naming,
    seconds,
)
from fasaco_edge.cli.console.checked_options import checked_members
from fasaco_edge.cli.console.terminal import err
from fasaco_edge.cli.warmup import compile_kernels
from fasaco_edge.client.phrases import scale_words
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.map_files import find_map
from fasaco_edge.host.files import make_own_folder

EPILOG = """\
summary.json and --json hold:
  map, complete    the building; whether every reachable cell was covered
  reachable_cells  counted by the daemon; with several daemons, by the one with most cells left
  covered_cells    counted in the same way
  reachable_m2     reachable floor of the true building
  swept_m2         floor swept along the true tracks of all robots
  swept_twice_m2   floor that two or more robots swept or drove through, by the same count;
                   `review` of the fleet counts cells, and driving through separately
  driven_m         distance driven by all robots
  robots           name, driven_m, drive_s (driving and turning) and swept_m2 of each robot
  plans, paths     plans and published paths of all daemons
  errors           messages refused by all daemons
  wall_s           duration by this computer's clock
  makespan_s       the robots' time, from the first robot's start of work to the last robot's end
  recording, fleet_recording, picture  the files
"""

RUNS = Path("runs")
MOST_IN_DEMO = 8
SPEED, FLEET_SPEED = 20.0, 5.0
# Options, and the members of ``RobotConfig`` that they set.
ROBOT_OPTIONS = {"speed": "time_scale", "robot_radius": "radius_m", "cell": "tool_width_m"}


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--map", default="flat", metavar="MAP", help="YAML or a name from `maps` (default: flat)"
    )
    parser.add_argument(
        "--robots",
        type=int,
        choices=range(1, MOST_IN_DEMO + 1),
        default=1,
        metavar="N",
        help=f"number of robots that share the building as a fleet, 1 to {MOST_IN_DEMO}; they "
        "start far from each other, and stop before each other (default: %(default)s)",
    )
    parser.add_argument(
        "--speed",
        type=float,
        metavar="X",
        help=f"simulated seconds per second (default: {SPEED:g}; {FLEET_SPEED:g} for several "
        "robots, which send messages to each other once a real second)",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="the planner's seed")
    parser.add_argument(
        "--driver",
        choices=("ideal", "follow"),
        default="ideal",
        help="what drives the robot: an ideal driver without delay, or `fasaco-edge follow`, as on "
        "a real robot (default: %(default)s)",
    )
    parser.add_argument(
        "--battery-min",
        type=float,
        default=0.0,
        metavar="MIN",
        help="battery life of the robot [simulated min]; it charges at its start; 0: unlimited "
        "(default: %(default)g)",
    )
    parser.add_argument(
        "--cell",
        "--tool-width",
        type=float,
        default=DEFAULT_CELL_M,
        metavar="M",
        help="width of the tool [m]",
    )
    parser.add_argument(
        "--robot-radius", type=float, default=DEFAULT_RADIUS_M, metavar="M", help="radius [m]"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: ./runs/<time>)"
    )
    add_json(parser, "the summary")
    parser.add_argument(
        "--timeout", type=seconds(most=1e6), default=1800.0, metavar="S", help="time limit [s]"
    )


def run(args: argparse.Namespace) -> int:
    """Run the mission; return 0 if every reachable cell was covered or the user quit."""
    from fasaco_edge.cli.demo.mission import DemoMission
    from fasaco_edge.cli.demo.robots import demo_robots
    from fasaco_edge.cli.demo.summary import print_summary, summarise
    from fasaco_edge.config.config import PlannerConfig
    from fasaco_edge.config.robot import RobotConfig

    find_map(args.map)
    if args.speed is None:
        args.speed = SPEED if args.robots == 1 else FLEET_SPEED
    checked_members(RobotConfig, args, ROBOT_OPTIONS)
    checked_members(PlannerConfig, args, {"seed": "seed"})
    out: Path = args.out or RUNS / f"{datetime.now():%Y-%m-%dT%H-%M-%S}"
    with naming(out):
        if args.out is None:
            # The name is fixed: another user may have created this folder.
            make_own_folder(RUNS)
            make_own_folder(out)
        out.mkdir(parents=True, exist_ok=True)
    seconds = compile_kernels()
    simulated = scale_words(args.speed) or "simulated in real time"
    err().print(f"kernels ready ({seconds:.1f} s); results go to {out}; {simulated}")
    robots = demo_robots(args, out)
    for robot in robots:
        # Overwrite a configuration only if a demo wrote it.
        if robot.config.exists() and not (robot.folder / "daemon.log").exists():
            raise BadConfiguration(
                f"--out {out}: {robot.config} exists, and is not from a demo",
                hint="name another folder",
            )
    with DemoMission(args, robots) as mission:
        ending = mission.watch()
        if ending is not None:
            # A slow or busy computer needs a minute for that.
            err().print("the mission is over: recording and picture are being finished")
    if ending is None:
        return Exit.OK
    summary = summarise(args, out, robots, ending)
    print_summary(summary, as_json=args.json)
    return Exit.OK if summary.complete else Exit.ERROR


COMMAND = Subcommand(
    description="Start a daemon, a recorder and a simulated robot, or several of each, as "
    "processes that communicate by Zenoh over loopback; show the mission; exit when every "
    "reachable cell is covered. Write a recording (.rrd), a picture and the figures to the output "
    "folder. A terminal of at least 60 x 20 characters shows the mission as in `fasaco-edge "
    "watch`: q quits.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
