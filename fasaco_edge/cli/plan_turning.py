"""The options of ``fasaco-edge plan`` that say what turns on the spot take."""

from __future__ import annotations

import argparse

from fasaco_edge.config.config import RobotConfig
from fasaco_edge.errors import BadConfiguration

# By the name of a limit: its metavar, the least and most that ``RobotConfig`` allows, their unit,
# and what it is.
LIMITS = {
    "turn_deg_s": ("W", 1.0, 1e3, "deg/s", "rate of turning on the spot, in place of --turn-s; "
                   "each bend then costs braking and starting, too"),
    "turn_deg_s2": ("A", 1.0, 1e5, "deg/s2", "its acceleration"),
    "acceleration_m_s2": ("A", 0.01, 100.0, "m/s2", "acceleration of driving"),
    "steered_deg": ("DEG", 0.0, 45.0, "deg", "a bend up to this is steered while driving"),
}  # fmt: skip


def add_turning(group: argparse._ArgumentGroup, turn_s_help: str) -> None:
    """Add the options."""
    group.add_argument("--turn-s", type=float, metavar="S", help=turn_s_help)
    robot = RobotConfig()
    for name, (metavar, _, _, unit, what) in LIMITS.items():
        default = getattr(robot, name)
        told = "none" if default is None else f"{default:g}"
        help_text = f"{what} [{unit}] (default: {told})"
        group.add_argument(_option(name), type=float, metavar=metavar, help=help_text)


def settle_turning(args: argparse.Namespace, turn_s: float) -> None:
    """Fill in defaults; a quarter-turn takes ``turn_s`` where nothing is said [s].

    Raises:
        BadConfiguration: a limit is impossible, or of no use with the other options.
    """
    if args.turn_deg_s is None:
        for name in LIMITS:
            if getattr(args, name) is not None:
                raise BadConfiguration(
                    f"{_option(name)} counts only with --turn-deg-s, which is missing"
                )
        args.turn_s = turn_s if args.turn_s is None else args.turn_s
        return
    if args.turn_s is not None:
        raise BadConfiguration("--turn-s and --turn-deg-s cannot both be given")
    robot = RobotConfig()
    for name, (_, least, most, unit, _) in LIMITS.items():
        if getattr(args, name) is None:
            setattr(args, name, getattr(robot, name))
        value = getattr(args, name)
        if not least <= value <= most:
            allowed = f"[{least:g}, {most:g}] {unit}"
            raise BadConfiguration(f"{_option(name)} must be in {allowed}, got {value!r}")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"
