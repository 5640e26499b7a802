"""Request of ``fasaco-edge plan``: robot, search and line by the options; display of progress."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from fasaco_edge.cli.console import terminal
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.loading import load_config
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.offline.settings import CELLS, LIKE_OWN, Search, default_line, require
from fasaco_edge.planners.own.loading import UserCode, load
from fasaco_edge.planners.planner import SearchProgress

if TYPE_CHECKING:
    from fasaco_edge.offline.maps import Map


# A terminal shows no more pictures a second; drawing them costs the search time.
LEAST_INTERVAL_S = 0.05


@contextmanager
def watching(
    total: float | None, *, counted: bool = False
) -> Iterator[Callable[[SearchProgress], None]]:
    """Yield a display of the progress of a search.

    Args:
        total: budget of the search [s], or with ``counted`` its number of ants.
        counted: whether progress counts ants instead of time.
    """
    with terminal.progress(counted=counted) as bar:
        task = bar.add_task("ants", total=total)
        began = shown = time.perf_counter()

        def show(search: SearchProgress) -> None:
            nonlocal shown
            now = time.perf_counter()
            if not bar.disable and now - shown >= LEAST_INTERVAL_S:
                shown = now
                done = search.work.ants if counted else now - began
                bar.update(task, completed=done, description=_words(search))

        yield show


def _words(search: SearchProgress) -> str:
    words = f"{search.steps} steps"
    return words if search.gap is None else f"{words}, {search.gap:.2%} above the bound"


# For each limit: the option's metavar, the range that ``RobotConfig`` allows, its unit, and the
# help text.
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
    """Return the members of a robot's turning that the options change.

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


# Options, and the members of ``RobotConfig`` and ``Search`` that they set.
ROBOT_OPTIONS = {
    "cell": "tool_width_m",
    "robot_radius": "radius_m",
    "clearance": "clearance_m",
    "speed_m_s": "speed_m_s",
    "overlap": "overlap",
    "turn_radius": "turn_radius_m",
}
SEARCH_OPTIONS = {
    **{name: name for name in ("planner", "ants", "velocities", "q0", "visibility", "beta")},
    **{name: name for name in ("alpha", "tau0", "seed", "threads", "target_gap")},
    "budget": "budget_s",
    "swept": "swept",
}


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """What the options ask for.

    Attributes:
        robot: its size, and its driving times.
        search: how to search.
        line: which line is made.
        own: the user's planner in place of the search; None for none.
        sources: files that this was read from.
    """

    robot: RobotConfig
    search: Search
    line: str
    own: UserCode | None
    sources: tuple[Path, ...] = ()


def read_request(args: argparse.Namespace) -> PlanRequest:
    """Return the request of the options; other values are those of ``--config``, if given.

    Raises:
        BadConfiguration: a value is impossible; the error names it.
        PlannerFailed: the file of the user's planner raised.
    """
    config = None if args.config is None else load_config(args.config)
    given, own = _given(args, SEARCH_OPTIONS), None
    if ":" in given.get("planner", ""):
        own, given["planner"] = load(given["planner"]), LIKE_OWN
    search = replace(_search(config), **given)
    has_floor = not (args.robots or args.robots_xy) and Path(args.map).suffix != ".npy"
    line = args.line or default_line(search, has_floor=has_floor)
    if args.line is None and config is not None and line != CELLS:
        line = config.planner.line
    if search.swept is not None and line == CELLS:
        raise BadConfiguration(
            "--swept: a line through the centres of cells has no share to choose",
            hint="ask for a line over the floor, quick or thorough",
        )
    robot = config.robot if config else RobotConfig()
    if config is None and line == CELLS:
        robot = msgspec.structs.replace(robot, quarter_turn_s=0.0)  # as the paper counts
    for option in ("--cell", "--robot-radius", "--speed-m-s"):
        value, unit = getattr(args, option[2:].replace("-", "_")), option == "--speed-m-s"
        if value is not None:
            require(0.0 < value <= 10.0, option, f"be in (0, 10] m{'/s' * unit}", value)
    if args.clearance is not None:
        allowed = 0.0 <= args.clearance <= 1.0
        require(allowed, "--clearance", "be in [0, 1] m", args.clearance)
    if args.overlap is not None:
        allowed = 0.0 <= args.overlap <= 0.5
        require(allowed, "--overlap", "be in [0, 0.5], of the tool's width", args.overlap)
    if args.turn_radius is not None:
        allowed = 0.0 <= args.turn_radius <= 20.0
        require(allowed, "--turn-radius", "be in [0, 20] m", args.turn_radius)
    changes = _given(args, ROBOT_OPTIONS) | turning_of(args, robot)
    if args.forward_only:
        changes["reverses"] = False
    if line == CELLS and changes.get("turn_radius_m", robot.turn_radius_m):
        raise BadConfiguration(
            "--turn-radius: a line through the centres of cells has turns on the spot alone",
            hint="ask for a line over the floor, quick or thorough; for one robot",
        )
    named = args.config, Path(own.file) if own and own.file else None
    sources = tuple(file for file in named if file is not None)
    return PlanRequest(msgspec.structs.replace(robot, **changes), search, line, own, sources)


def say_written(args: argparse.Namespace) -> None:
    """Print where the files are that were asked for, or how to have a picture."""
    console = terminal.out()
    for name in ("path_out", "xy_out", "png", "pheromone_png"):
        if (file := getattr(args, name)) is not None:
            console.print(f"wrote {file}", soft_wrap=True)
    if not args.long:
        console.print("more: --long" + ("" if args.png else "; a picture: --png FILE"))


def require_frame(map: Map, xy_out: Path | None) -> None:
    """Check that a map has a frame if points in it are to be written.

    Raises:
        BadConfiguration: it is a coverage grid.
    """
    if xy_out is not None and map.grid is None:
        raise BadConfiguration(
            f"--xy-out: {map.file} is a coverage grid (.npy), which lies in no map frame",
            hint="plan on a map_server YAML file, or ask for --path-out",
        )


def _search(config: DaemonConfig | None) -> Search:
    """Return the search settings of a daemon's configuration; the defaults of ``plan`` for None."""
    if config is None:
        return Search()
    planner = msgspec.structs.asdict(config.planner)
    names = {field.name for field in fields(Search)} & planner.keys()
    return Search(planner=planner["name"], **{name: planner[name] for name in names})


def _given(args: argparse.Namespace, members: Mapping[str, str]) -> dict[str, Any]:
    """Return the values of the given options, with the member that each sets as key."""
    values = {member: getattr(args, option) for option, member in members.items()}
    return {member: value for member, value in values.items() if value is not None}
