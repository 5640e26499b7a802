"""``fasaco-edge watch``: a live view of the mission of a robot or fleet in a terminal."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from fasaco_edge.cli.ask import nobody_answers
from fasaco_edge.cli.console.arguments import (
    Exit,
    Subcommand,
    add_robot_on_bus,
    fleet_name,
    robot_on_bus,
    seconds,
)
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import can_draw, out
from fasaco_edge.client.phrases import steady_now
from fasaco_edge.errors import BusUnavailable, FasacoError
from fasaco_edge.watch import live
from fasaco_edge.watch.live import Watched
from fasaco_edge.wire.keys import Keys

if TYPE_CHECKING:
    from fasaco_edge.bus.settings import BusSettings

EPILOG = """\
examples:
  fasaco-edge watch                                    a daemon on this machine
  fasaco-edge watch --connect tcp/192.168.1.20:7447 --robot hall2
  fasaco-edge watch --connect tcp/192.168.1.20:7447 --fleet building_7
  fasaco-edge watch --once                             one page of the current state
  fasaco-edge watch | tee mission.log                  lines of text, without a terminal
  fasaco-edge watch --json | jq .coverage.fraction

q or Ctrl-C quits. The picture shows the map with y upwards. If the native key `map` has no map, as
under ROS 2, only the coverage is drawn. NO_COLOR=1 and TERM=dumb are honoured.

--fleet shows a table of all robots of a fleet, also of robots that join later: what each does, how
much it has swept, and how much of its part is left. With --json it prints a line a second, if
something has changed. To see all robots on one map, record the fleet:
fasaco-edge record --fleet NAME --out DIR.

exit codes: 0 quit by the user; 1 no answer with --once, or the terminal has closed
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--once", action="store_true", help="print one page and exit")
    parser.add_argument("--json", action="store_true", help="print each status as a line of JSON")
    parser.add_argument(
        "--timeout",
        type=seconds(),
        default=5.0,
        metavar="S",
        help="timeout for the daemon with --once [s] (default: %(default)s)",
    )
    parser.add_argument(
        "--fleet",
        type=fleet_name,
        metavar="NAME",
        help="show all robots of this fleet (`fleet: {name: NAME}`) in place of one robot",
    )
    add_robot_on_bus(parser)


def run(args: argparse.Namespace) -> int:
    """Watch until the user quits, or SIGTERM or SIGINT."""
    keys, bus, _ = robot_on_bus(args)
    try:
        if args.fleet is None:
            _watch_robot(args, keys, bus)
        else:
            from fasaco_edge.cli.fleet_wing import fleet_on_bus

            with fleet_on_bus(args.fleet, keys, bus, out()) as (watched, no_answer):
                _watch(args, watched, no_answer)
        sys.stdout.flush()
    except OSError:
        # The terminal is gone, or the reader of a pipe has closed it.
        return Exit.ERROR
    return Exit.OK


def _watch_robot(args: argparse.Namespace, keys: Keys, bus: BusSettings) -> None:
    from fasaco_edge.client.feed import Feed
    from fasaco_edge.watch.page import RobotWatch
    from fasaco_edge.watch.picture import RobotView

    view = RobotView(keys.robot)
    with Feed(bus, keys) as feed:
        _watch(
            args, RobotWatch(feed, view, out()), lambda: nobody_answers(keys.prefix, view.robots)
        )


def _watch(
    args: argparse.Namespace, watched: Watched, no_answer: Callable[[], FasacoError]
) -> None:
    """Watch in the requested form; ``no_answer``: returns the error if no robot answers."""
    if args.once:
        _once(args, watched, no_answer)
    elif args.json:
        live.watch_as_json(watched)
    elif can_draw(out()):
        live.watch_on_screen(watched, sys.stdout)
    else:
        live.watch_in_lines(watched)


def _once(args: argparse.Namespace, watched: Watched, no_answer: Callable[[], FasacoError]) -> None:
    if not live.look_once(watched, args.timeout):
        trouble = watched.view.trouble
        raise BusUnavailable(trouble) if trouble else no_answer()
    if args.json:
        print_json(watched.document())
        return
    console = out()
    # One line of the screen is left for the prompt.
    for line in watched.page(steady_now(), console.width, console.height - 1):
        # Not printed by the console, to keep the colours; its texts are already sanitized.
        console.file.write(f"{line.rstrip()}\n")


COMMAND = Subcommand(
    description="Show map, coverage, robot and the path ahead live, with state, figures and the "
    "latest events, on the robot or on any other machine. With --fleet show what each robot of a "
    "fleet does.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
