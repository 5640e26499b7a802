"""``fasaco-edge run``: the daemon."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from fasaco_edge.cli.console.arguments import Exit, Subcommand

EPILOG = """\
Without --config the daemon listens at tcp/127.0.0.1:7447 (or joins the router that already
listens there) and uses the keys fasaco/@v1/robot/...:
  in    map, map_update, pose      ROS messages in CDR
  out   path, coverage, pheromone  ROS messages in CDR
        status                     JSON, on change and once a second
        command                    JSON, each accepted command
        alive                      liveliness token
  ask   @rpc/path, @rpc/status, @rpc/coverage, @rpc/mission

It covers everything that the robot can reach, unless it gets an order (`fasaco-edge mission`) or
has to wait for one (mission.autostart: false). Order and coverage are kept on disk: after a restart
the mission continues where it stopped.

As a service (deploy/) it notifies systemd when it is ready, and feeds the watchdog. Then
`systemctl reload` (SIGHUP) reloads its configuration: it applies settings that can change at run
time (planner, map, the robot's speeds, the mission's timeouts and zones) and lists the others; it
rejects a faulty file as a whole. Started by hand it has no reload: SIGHUP, as from a closed
terminal, ends it. Start it again with the new file.
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", type=Path, metavar="FILE", help="YAML configuration")
    parser.add_argument(
        "--record", type=Path, metavar="DIR", help="start a recorder that writes to DIR"
    )
    parser.add_argument(
        "--state",
        type=Path,
        metavar="DIR",
        help="folder for the progress (default: mission.state_dir of the configuration, "
        "else $STATE_DIRECTORY, else fasaco-edge in $XDG_STATE_HOME or ~/.local/state)",
    )
    parser.add_argument(
        "--fresh",
        action="store_true",
        help="cover everything again: existing progress is moved to a file of its own; keep-outs "
        "that were added stay",
    )


def run(args: argparse.Namespace) -> int:
    """Run the daemon until SIGTERM or SIGINT."""
    from fasaco_edge.daemon.reload import read_config
    from fasaco_edge.daemon.service import run_daemon

    read = partial(read_config, args.config)
    run_daemon(read(), args.record, args.state, fresh=args.fresh, read=read)
    return Exit.OK


COMMAND = Subcommand(
    description="Run the daemon until SIGTERM or SIGINT.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
