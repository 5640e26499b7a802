"""``fasaco-edge init``: a first configuration, made from answers and tested on the bus."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.bus import DEFAULT_ENDPOINT
from fasaco_edge.cli.console.arguments import (
    DEFAULT_CELL_M,
    DEFAULT_RADIUS_M,
    Exit,
    Subcommand,
    add_json,
    check_outputs,
    seconds,
    writing,
)
from fasaco_edge.cli.console.checked_options import given_members, naming_options
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import err, out, say
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.plain_yaml import dump
from fasaco_edge.text import shown

if TYPE_CHECKING:
    from fasaco_edge.config.config import DaemonConfig
    from fasaco_edge.doctor.finding import Finding

WAYS = {
    "zenoh": "plain Zenoh",
    "rmw_zenoh": "ROS 2 whose middleware is rmw_zenoh",
    "bridge": "ROS 2 behind zenoh-bridge-ros2dds",
}
# Options, and the members of the section ``robot`` that they set.
ROBOT = {
    "name": "name",
    "robot_radius": "radius_m",
    "robot_size": "footprint",
    "clearance": "clearance_m",
    "tool_width": "tool_width_m",
}
# Keys of the configuration, and the options that set them.
OPTIONS = {f"robot.{member}": option for option, member in ROBOT.items()} | {
    "bus.connect": "connect",
    "ros2.domain": "domain",
    "ros2.namespace": "namespace",
}
# Options that are asked for if missing, each with its question and default answer.
QUESTIONS = {
    "robot_radius": ("Radius of the disc around the robot [m]", f"{DEFAULT_RADIUS_M:g}"),
    "tool_width": ("Width of its tool [m]", f"{DEFAULT_CELL_M:g}"),
    "map_by": (
        f"Source of the map? {'; '.join(f'{way}: {what}' for way, what in WAYS.items())}",
        "zenoh",
    ),
    "connect": (
        f"Router to connect to, such as {DEFAULT_ENDPOINT}; none: the daemon listens there",
        "",
    ),
}
# Default clearance for a real robot, whose map and poses have errors of 1 to 2 cm [m]. The default
# of the configuration is for a simulation without errors.
CLEARANCE_M = 0.02
INDENT = " " * len("assumed:    ")
HEAD = "# Every key, with its default and what it means: deploy/fasaco-edge.yaml\n"
EPILOG = """\
On a terminal it asks for values that no option gives; elsewhere radius or size, tool width and
--map-by are required. The file contains size and tool, and what differs from the defaults; it is
checked as by `check-config`.

examples:
  fasaco-edge init
  fasaco-edge init robot.yaml --robot-radius 0.22 --tool-width 0.3 \\
      --map-by rmw_zenoh --connect tcp/127.0.0.1:7447

exit codes: 0 written, whether or not maps were received; 78 not written (EX_CONFIG)
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file",
        nargs="?",
        type=Path,
        default=Path("fasaco-edge.yaml"),
        metavar="FILE",
        help="where to write (default: %(default)s)",
    )
    parser.add_argument(
        "--robot-radius", type=_number, metavar="M", help="radius of the disc around the robot [m]"
    )
    parser.add_argument(
        "--robot-size",
        type=_size,
        metavar="WxL",
        help="width and length of a rectangular robot [m], such as 0.5x0.6, in place of a radius; "
        "plans use the disc around the rectangle",
    )
    parser.add_argument(
        "--tool-width", type=_number, metavar="M", help="width of the brush, mop or mower [m]"
    )
    parser.add_argument(
        "--clearance",
        type=_number,
        default=CLEARANCE_M,
        metavar="M",
        help="distance that lines keep from walls and furniture in addition to the radius [m], "
        "except where less gains enough floor; 0 for a map and poses without errors (default: "
        "%(default)g)",
    )
    parser.add_argument(
        "--map-by",
        choices=WAYS,
        help="source of the map: " + "; ".join(f"{way}: {what}" for way, what in WAYS.items()),
    )
    parser.add_argument(
        "--connect",
        metavar="ENDPOINT",
        help="router or bridge to connect to, such as tcp/127.0.0.1:7447; without one the daemon "
        "listens at that endpoint itself",
    )
    parser.add_argument(
        "--name", metavar="NAME", help="name of the robot on the bus (default: robot)"
    )
    parser.add_argument("--domain", type=int, metavar="N", help="ROS_DOMAIN_ID of rmw_zenoh")
    parser.add_argument(
        "--namespace", metavar="NS", help="namespace of all ROS topics, such as /robot1"
    )
    parser.add_argument(
        "--listen",
        type=seconds(),
        default=5.0,
        metavar="S",
        help="time to look for maps (default: %(default)g s)",
    )
    parser.add_argument("--no-try", action="store_true", help="do not look for maps on the bus")
    parser.add_argument("--force", action="store_true", help="replace an existing file")
    add_json(parser, "the configuration and what was received")


def _number(text: str) -> float:
    """Return a number with a decimal point or a decimal comma."""
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number such as 0.25, got {text!r}") from None


def _size(text: str) -> dict[str, float]:
    try:
        width_m, length_m = (_number(part) for part in text.split("x"))
    except (ValueError, argparse.ArgumentTypeError):
        raise argparse.ArgumentTypeError(f"must be like 0.5x0.6, got {text!r}") from None
    return {"width_m": width_m, "length_m": length_m}


def run(args: argparse.Namespace) -> int:
    """Ask for missing values, write the file, and report maps and poses on the bus."""
    file: Path = args.file
    if file.exists() and not args.force:
        raise BadConfiguration(
            f"{file} already exists", hint="name another file, or replace it with --force"
        )
    check_outputs([file])
    _ask(args)
    document = document_of(args)
    text = HEAD + (dump(document) if document else "")
    with naming_options(args, OPTIONS):
        config = _checked(document)
    with writing(file) as new:
        new.write_text(text, encoding="utf-8")
    found = None if args.no_try else _listen(config, args.listen)
    if args.json:
        print_json({"file": str(file), "config": document, "heard": found and asdict(found)})
    else:
        _print(file, text, config, found)
    return Exit.OK


def document_of(args: argparse.Namespace) -> dict[str, object]:
    """Return the robot's size and tool, and other settings that differ from the defaults."""
    from fasaco_edge.config.robot import RobotConfig

    usual = RobotConfig()
    ros = {"domain": args.domain, "namespace": args.namespace}
    parts: dict[str, dict[str, object]] = {
        "robot": {
            k: v
            for k, v in given_members(args, ROBOT).items()
            if k in ("radius_m", "tool_width_m") or v != getattr(usual, k)
        },
        "bus": {},
        "ros2": {},
    }
    if args.connect:
        parts["bus"] = {"mode": "client", "listen": [], "connect": [args.connect]}
    if args.map_by != "zenoh":
        unusual = {k: v for k, v in ros.items() if v not in (None, 0, "/")}
        parts["ros2"] = {"kind": args.map_by} | unusual
    elif args.domain is not None or args.namespace is not None:
        raise BadConfiguration("--domain and --namespace are for maps from ROS 2, see --map-by")
    return {name: part for name, part in parts.items() if part}


def _ask(args: argparse.Namespace) -> None:
    """Ask for missing values.

    Raises:
        BadConfiguration: there is no terminal, or no answer.
    """
    missing = [name for name in QUESTIONS if getattr(args, name) is None]
    if args.robot_size is not None and "robot_radius" in missing:
        missing.remove("robot_radius")
    if missing in ([], ["connect"]):
        return
    if not (sys.stdin.isatty() and err().is_terminal):
        names = [f"--{name.replace('_', '-')}" for name in missing if name != "connect"]
        raise BadConfiguration(
            f"{', '.join(names)} must be given: there is no terminal for questions"
        )
    with naming_options(args, OPTIONS):
        _checked({"robot": given_members(args, ROBOT)})
    for name in missing:
        setattr(args, name, _asked(name))


def _asked(name: str) -> object:
    """Ask for the value of an option until the answer is valid."""
    question, default = QUESTIONS[name]
    while True:
        # Questions go to standard error, as standard output may be JSON.
        err().print(f"{question} [{default or 'none'}]: ", end="", markup=False, soft_wrap=True)
        line = sys.stdin.readline()
        if not line:  # end of input, Ctrl-D
            raise BadConfiguration(f"no answer to: {question}", hint="give the options, see --help")
        try:
            return _read(name, line.strip() or default)
        except BadConfiguration as error:
            more = "" if error.hint == BadConfiguration.hint else f" ({error.hint})"
            say(err(), f"{error.what}{more}", "  ", "  ")


def _read(name: str, text: str) -> object:
    """Return the value in an answer, checked as in a configuration."""
    if name == "map_by":
        if text not in WAYS:
            raise BadConfiguration(f"must be {', '.join(WAYS)}, got {shown(text)}")
        return text
    if name == "connect":
        bus = {"mode": "client", "listen": [], "connect": [text]}
        if text:
            _checked({"bus": bus})
        return text
    try:
        value = _number(text)
    except argparse.ArgumentTypeError as error:
        raise BadConfiguration(str(error)) from None
    _checked({"robot": {ROBOT[name]: value}})
    return value


def _checked(document: dict[str, object]) -> DaemonConfig:
    """Return a configuration; raise its faults."""
    from fasaco_edge.config.config import DaemonConfig
    from fasaco_edge.host.documents import converted

    return converted(DaemonConfig, document, BadConfiguration)


def _listen(config: DaemonConfig, listen_s: float) -> Finding:
    from fasaco_edge.doctor.finding import CheckContext
    from fasaco_edge.doctor.session import peers

    return peers(CheckContext(config), listen_s)


def _print(file: Path, text: str, config: DaemonConfig, peers: Finding | None) -> None:
    from fasaco_edge.config.cautions import cautions

    console = out()
    console.print(f"{file}:", soft_wrap=True)
    for line in text.splitlines():
        console.print(f"  {line}", markup=False, highlight=False, soft_wrap=True)
    if assumed := config.robot.assumed:
        say(console, assumed, "assumed:    ", INDENT)
    for caution in cautions(config):
        say(console, caution, "caution:    ", INDENT)
    if peers is not None:
        say(console, peers.found, "on the bus: ", INDENT)
        for line in peers.details:
            say(console, line, "  ", "  ")
    console.print(f"start it:   fasaco-edge run --config {file}", soft_wrap=True)


COMMAND = Subcommand(
    description="Write a first configuration for a robot: its size, its tool, the source of its "
    "map. Look for the map on the bus, and print what was received.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
