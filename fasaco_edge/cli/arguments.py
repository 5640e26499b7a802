"""Arguments that several commands share, and how their texts are read."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fasaco_edge.bus.session import DEFAULT_ENDPOINT, BusSettings

if TYPE_CHECKING:
    Subparsers = argparse._SubParsersAction[argparse.ArgumentParser]

DEFAULT_CELL_M = 0.3
DEFAULT_RADIUS_M = 0.18


def pair_of_ints(text: str) -> tuple[int, int]:
    """Read ``R,C``."""
    row, col = text.split(",")
    return int(row), int(col)


def pair_of_floats(text: str) -> tuple[float, float]:
    """Read ``X,Y``."""
    x, y = text.split(",")
    return float(x), float(y)


def add_robot_on_bus(parser: argparse.ArgumentParser) -> None:
    """Add what names a robot on the bus and how to get there."""
    parser.add_argument("--robot", default="robot", metavar="NAME", help="name of the robot")
    parser.add_argument("--base", default="fasaco", metavar="KEY", help="what all keys begin with")
    parser.add_argument(
        "--connect",
        action="append",
        metavar="ENDPOINT",
        help=f"Zenoh endpoint to connect to; may be repeated (default: {DEFAULT_ENDPOINT})",
    )


def client_settings(args: argparse.Namespace) -> BusSettings:
    """Return the session settings of a process that joins a daemon or router."""
    return BusSettings("client", tuple(args.connect or (DEFAULT_ENDPOINT,)))
