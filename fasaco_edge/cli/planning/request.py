"""Request of ``fasaco-edge plan``: robot, search and line that its options state."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from fasaco_edge.cli.planning.turning import turning_of
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.loading import load_config
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.offline.settings import CELLS, Search, default_line, require
from fasaco_edge.planners.own.loading import UserCode, load

if TYPE_CHECKING:
    from fasaco_edge.offline.maps import Map

# Members of ``RobotConfig`` and ``Search`` by the options for them.
ROBOT_OPTIONS = {
    "cell": "tool_width_m",
    "robot_radius": "radius_m",
    "clearance": "clearance_m",
    "speed_m_s": "speed_m_s",
    "overlap": "overlap",
}
SEARCH_OPTIONS = {
    **{name: name for name in ("planner", "ants", "velocities", "q0", "visibility", "beta")},
    **{name: name for name in ("alpha", "tau0", "seed", "threads", "target_gap")},
    "budget": "budget_s",
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
        own = load(given.pop("planner"))
    search = replace(_search(config), **given)
    if args.no_local_search or own:
        search = replace(search, local_search=False)
    has_floor = not (args.robots or args.robots_xy) and Path(args.map).suffix != ".npy"
    line = args.line or default_line(search, has_floor=has_floor)
    if args.line is None and config is not None and line != CELLS:
        line = config.planner.line
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
    changes = _given(args, ROBOT_OPTIONS) | turning_of(args, robot)
    named = args.config, Path(own.file) if own and own.file else None
    sources = tuple(file for file in named if file is not None)
    return PlanRequest(msgspec.structs.replace(robot, **changes), search, line, own, sources)


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
    """Return how the daemon of a configuration searches; how ``plan`` does, without one."""
    if config is None:
        return Search()
    planner = msgspec.structs.asdict(config.planner)
    names = {field.name for field in fields(Search)} & planner.keys()
    return Search(planner=planner["name"], **{name: planner[name] for name in names})


def _given(args: argparse.Namespace, members: Mapping[str, str]) -> dict[str, Any]:
    """Return the values of the options that are given, by the member each is for."""
    values = {member: getattr(args, option) for option, member in members.items()}
    return {member: value for member, value in values.items() if value is not None}
