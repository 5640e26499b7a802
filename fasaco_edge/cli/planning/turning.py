"""The options of ``fasaco-edge plan`` for the time of turns on the spot."""

from __future__ import annotations

import argparse

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.offline.settings import require

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


def turning_of(args: argparse.Namespace, robot: RobotConfig) -> dict[str, float | None]:
    """Return the changes of a robot's turning by the options.

    Raises:
        BadConfiguration: a limit is impossible, or of no use with the other options.
    """
    limits = {name: getattr(args, name) for name in LIMITS if getattr(args, name) is not None}
    has_rate = "turn_deg_s" in limits or (robot.turn_deg_s is not None and args.turn_s is None)
    if limits and not has_rate:
        name = next(iter(limits))
        raise BadConfiguration(f"{_option(name)} counts only with --turn-deg-s, which is missing")
    if limits and args.turn_s is not None:
        raise BadConfiguration("--turn-s and --turn-deg-s cannot both be given")
    for name, value in limits.items():
        _, least, most, unit, _ = LIMITS[name]
        if not least <= value <= most:
            allowed = f"[{least:g}, {most:g}] {unit}"
            raise BadConfiguration(f"{_option(name)} must be in {allowed}, got {value!r}")
    if args.turn_s is not None:
        require(0.0 <= args.turn_s <= 600.0, "--turn-s", "be in [0, 600] s", args.turn_s)
        return {"quarter_turn_s": args.turn_s, "turn_deg_s": None}
    return limits


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"
