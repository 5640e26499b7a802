"""``fasaco-edge demo``: a mission of one or more simulated robots in an unknown building."""

from __future__ import annotations

import argparse
from datetime import datetime
from pathlib import Path

from fasaco_edge.cli.console.arguments import (
    DEFAULT_CELL_M,
    DEFAULT_RADIUS_M,
    Command,
    Exit,
    add_json,
    naming,
)
from fasaco_edge.cli.console.terminal import err
from fasaco_edge.cli.warmup import compile_kernels
from fasaco_edge.client.phrases import scale_words
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.map_files import find_map
from fasaco_edge.host.files import make_own_folder

EPILOG = """\
summary.json and --json hold:
  map, complete    the building; whether every reachable cell was covered
  reachable_cells, covered_cells
                   as the daemon counts them, of several the one with the most left
  reachable_m2, swept_m2
                   floor, by the true building and the true tracks of all robots
  swept_twice_m2   floor that two or more robots swept, driving through included, by the same
                   count; `review` of the fleet counts cells, and driving through separately
  driven_m         by all robots; robots: of each name, driven_m, drive_s (driving and
                   turning), swept_m2
  plans, paths, errors
                   of all daemons: plans, published paths, refused messages
  wall_s, makespan_s
                   seconds of this computer; of the robots, from the first robot's start of
                   work to the last one's end
  recording, fleet_recording, picture
                   the files
"""

RUNS = Path("runs")
MOST_IN_DEMO = 8
SPEED, FLEET_SPEED = 20.0, 5.0


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
        help=f"how many share the building as a fleet, 1 to {MOST_IN_DEMO}; they begin far from "
        "one another, and stop before one another (default: %(default)s)",
    )
    parser.add_argument(
        "--speed",
        type=float,
        metavar="X",
        help=f"simulated seconds per second (default: {SPEED:g}; {FLEET_SPEED:g} for several "
        "robots, whose messages to each other come once a real second)",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="the planner's seed")
    parser.add_argument(
        "--driver",
        choices=("ideal", "follow"),
        default="ideal",
        help="what drives the robot: a driver without delay, or `fasaco-edge follow`, a process of "
        "its own as on a real one (default: %(default)s)",
    )
    parser.add_argument(
        "--battery-min",
        type=float,
        default=0.0,
        metavar="MIN",
        help="battery life of the robot [simulated min]; it charges where it started; 0: unlimited "
        "(default: %(default)g)",
    )
    parser.add_argument("--cell", type=float, default=DEFAULT_CELL_M, metavar="M", help="[m]")
    parser.add_argument(
        "--robot-radius", type=float, default=DEFAULT_RADIUS_M, metavar="M", help="[m]"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: ./runs/<time>)"
    )
    add_json(parser, "the summary")
    parser.add_argument("--timeout", type=float, default=1800.0, metavar="S", help="time limit [s]")


def run(args: argparse.Namespace) -> int:
    """Run the mission; return 0 if every reachable cell was covered, or the user quits."""
    from fasaco_edge.cli.demo.mission import DemoMission
    from fasaco_edge.cli.demo.robots import demo_robots
    from fasaco_edge.cli.demo.summary import print_summary, summarise

    find_map(args.map)
    if args.speed is None:
        args.speed = SPEED if args.robots == 1 else FLEET_SPEED
    if not args.speed > 0:
        raise BadConfiguration(f"--speed must be above 0, got {args.speed}")
    out: Path = args.out or RUNS / f"{datetime.now():%Y-%m-%dT%H-%M-%S}"
    with naming(out):
        if args.out is None:
            # Another user may have created this folder: the name is not chosen by the user.
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
    if ending is None:
        return Exit.OK
    summary = summarise(args, out, robots, ending)
    print_summary(summary, as_json=args.json)
    return Exit.OK if summary.complete else Exit.ERROR


COMMAND = Command(
    description="Start daemon, recorder and a simulated robot (or several of each) as processes "
    "of their own that talk Zenoh over loopback; show the mission; exit when every reachable cell "
    "is covered. Writes a recording (.rrd), a picture and the figures to the output folder. In a "
    "terminal of at least 60 x 20 characters it shows the mission as `fasaco-edge watch` does: f "
    "toggles the pheromone trail, q quits.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
