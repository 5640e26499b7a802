"""The request of ``fasaco-edge plan`` (robot, search, line) and the display of its progress."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.checked_options import checked_members, given_members
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.loading import load_config
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.offline.settings import CELLS, LIKE_OWN, Search, default_line
from fasaco_edge.planners.own.loading import UserCode, load
from fasaco_edge.planners.planner import SearchProgress
from fasaco_edge.text import percent

if TYPE_CHECKING:
    from fasaco_edge.offline.maps import Map


# Least time between two updates of the display [s]: drawing takes time from the search.
LEAST_INTERVAL_S = 0.05


@contextmanager
def watching(
    total: float | None, *, counted: bool = False
) -> Iterator[Callable[[SearchProgress], None]]:
    """Yield a display of the progress of a search.

    Args:
        total: budget of the search [s], or its number of ants if ``counted``.
        counted: whether progress is counted in ants instead of time.
    """
    with terminal.progress(counted=counted) as bar:
        task = bar.add_task("ants", total=total)
        began = shown = time.perf_counter()

        def show(search: SearchProgress) -> None:
            nonlocal shown
            now = time.perf_counter()
            if now - shown >= LEAST_INTERVAL_S:
                shown = now
                done = search.work.ants if counted else now - began
                bar.update(task, completed=done, description=_words(search))

        yield show


def _words(search: SearchProgress) -> str:
    words = f"{search.steps} steps"
    return words if search.gap is None else f"{words}, {percent(search.gap, 2)} above the bound"


# Options, and the members of ``RobotConfig`` and ``Search`` that they set.
ROBOT_OPTIONS = {
    "cell": "tool_width_m",
    "robot_radius": "radius_m",
    "clearance": "clearance_m",
    "speed_m_s": "speed_m_s",
    "overlap": "overlap",
    "turn_s": "quarter_turn_s",
    "turn_radius": "turn_radius_m",
}
SEARCH_OPTIONS = {
    **{name: name for name in ("planner", "ants", "velocities", "seed", "swept")},
    "budget": "budget_s",
}


@dataclass(frozen=True, slots=True)
class RequestedPlan:
    """The plan that the options request.

    Attributes:
        robot: size, speeds and turning times of the robot.
        search: settings of the search.
        line: kind of the line.
        own: the user's own planner; None for none.
        sources: files from which the request was read.
    """

    robot: RobotConfig
    search: Search
    line: str
    own: UserCode | None
    sources: tuple[Path, ...] = ()


def read_request(args: argparse.Namespace) -> RequestedPlan:
    """Return the request of the options; missing values come from ``--config``, else defaults.

    Raises:
        BadConfiguration: a value is invalid; the error names it.
        PlannerFailed: the file of the user's planner raised an exception.
    """
    config = None if args.config is None else load_config(args.config)
    given, own = given_members(args, SEARCH_OPTIONS), None
    if ":" in given.get("planner", ""):
        own, given["planner"] = load(given["planner"]), LIKE_OWN
    search = replace(_search(config), **given)
    line = args.line or default_line(search, has_floor=Path(args.map).suffix != ".npy")
    if args.line is None and config is not None and line != CELLS:
        line = config.planner.line
    if args.swept is not None and line == CELLS:
        raise BadConfiguration(
            "--swept: a line through the centres of cells has no share to choose",
            hint="ask for a line over the floor, quick or thorough",
        )
    if line == CELLS:
        search = replace(search, swept=None)
    robot = config.robot if config else RobotConfig()
    if config is None and line == CELLS:
        robot = msgspec.structs.replace(robot, quarter_turn_s=0.0)  # as in the paper
    changes = checked_members(RobotConfig, args, ROBOT_OPTIONS)
    if args.turn_s is not None:
        changes["turn_deg_s"] = None
    if args.forward_only:
        changes["reverses"] = False
    if line == CELLS and changes.get("turn_radius_m", robot.turn_radius_m):
        raise BadConfiguration(
            "--turn-radius: a line through the centres of cells only has turns on the spot",
            hint="ask for a line over the floor, quick or thorough",
        )
    named = args.config, Path(own.file) if own and own.file else None
    sources = tuple(file for file in named if file is not None)
    return RequestedPlan(msgspec.structs.replace(robot, **changes), search, line, own, sources)


def require_frame(map: Map, xy_out: Path | None) -> None:
    """Check that a map has a frame, which ``xy_out`` requires.

    Raises:
        BadConfiguration: the map is a coverage grid.
    """
    if xy_out is not None and map.grid is None:
        raise BadConfiguration(
            f"--xy-out: {map.file} is a coverage grid (.npy), which lies in no map frame",
            hint="plan on a map_server YAML file, or ask for --path-out",
        )


def _search(config: DaemonConfig | None) -> Search:
    """Return the search settings of a configuration; the defaults of ``plan`` for None."""
    if config is None:
        return Search()
    planner = msgspec.structs.asdict(config.planner)
    names = {field.name for field in fields(Search)} & planner.keys()
    return Search(planner=planner["name"], **{name: planner[name] for name in names})
