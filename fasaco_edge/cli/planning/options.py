"""The options of ``fasaco-edge plan``."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from fasaco_edge.cli.console.arguments import add_json, pair_of_floats, pair_of_ints
from fasaco_edge.cli.console.pass_option import WORDS, add_passes
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.offline.settings import (
    ANYWHERE,
    AXES,
    BUDGET_S,
    CELLS,
    HOME,
    THOROUGH,
    WALLS,
    Search,
)
from fasaco_edge.planners.own.loading import SHAPE, is_place
from fasaco_edge.planners.own.time_limit import OWN_BUDGET_S
from fasaco_edge.planners.passes import MOST_ANGLE_DEG
from fasaco_edge.planners.registry import PLANNER_NAMES, PLANNERS

EPILOG = """\
your building and robot:
  fasaco-edge plan site.yaml --cell 0.35 --robot-radius 0.2 --start-xy 1.5,-2 --png line.png
  fasaco-edge plan site.yaml --config robot.yaml --xy-out line.csv
  fasaco-edge plan scan.png --resolution 0.05 --unknown-free --png line.png
  fasaco-edge plan site.yaml --line quick --align axes --xy-out line.csv
  fasaco-edge plan site.yaml --swept 0.995 --budget 10 --png line.png
  fasaco-edge plan site.yaml --rooms --png rooms.png
  fasaco-edge plan site.yaml --passes edge,auto,cross --png passes.png
  fasaco-edge plan lawn.yaml --cell 0.4 --turn-radius 0.5 --png curve.png
  fasaco-edge plan office --turn-s 2 --budget 0.1 --end 12,3
the paper's planners, and your own:
  fasaco-edge plan basement --planner fasaco --seed 7 --pheromone-png trail.png
  fasaco-edge plan grid.npy --start 8,8 --planner aco --end home --path-out path.csv
  fasaco-edge plan site.yaml --line cells --path-out path.csv
  fasaco-edge plan office --planner mine.py:depth_first --png mine.png

figures:
  revisits         steps + 1 - distinct cells
  recovered_cells  distinct cells visited twice or more
  n_r_paper        revisits including the way home, to compare with the paper's Table I
  length_m, cost_s length of the walk, and seconds the robot drives and turns along its cells;
                   turns take none if turn_s is 0; seconds of the line: see floor
  lattice_deg      angle of the cells' rows to the x axis of the map frame; cells
                   (row, col) of a line over the floor are counted along these rows
  gap              cost_s / lower_bound_cost_s - 1, steps and turns together
  floor            (YAML maps) measured on the map's pixels, with a tool as wide as --cell:
                   reachable_m2, all that the tool touches wherever the robot's disc can
                   be; the share of it that the line sweeps; seconds that the line takes,
                   seconds_per_m2 swept; gap, to the time of driving that area once at the
                   tool's width; patches larger than 4 dm2 not swept, the largest;
                   illegal_share, the part of the line where the robot would touch what is
                   not known to be free
  curve            (--turn-radius) length_m, seconds and backward_m of the curve;
                   reversals, from forward to backward or back; spot_turns, which do not
                   fit and stay on the spot, of all bends judged on the curve's points
  rooms            (--rooms) area_m2 of free floor, reachable_m2 of it, the share of that
                   which the line sweeps, and how often it enters the room

figures of several passes: sums, and for each pass its own

colony-search searches until its budget ends, the walk is proven optimal, or nothing is
gained for long: a complete walk within milliseconds, then better ones by local search.
Perturbations lead it on; in every other one ants rebuild a part of the walk.
A line over the floor is laid along each of two walks, if the budget allows. What is left of
the budget goes to the better line: each stage of its search takes twice as long as the one
before. A larger budget gives no worse line, by its seconds and the price of floor that it
leaves.
--ants and --velocities apply to fasaco, --ants to aco, --velocities to colony-search; a planner
of your own gets the seed. From Python the colony has more settings.
"""

ROBOT, SEARCH = RobotConfig(), Search()


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add all options."""
    parser.add_argument(
        "map",
        metavar="MAP",
        help="map_server YAML, a name from `maps`, an image with --resolution, or a coverage grid "
        ".npy (bool, True = free)",
    )
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="a daemon's configuration: plan for its robot, as it would; other options come first",
    )
    _add_problem(parser.add_argument_group("problem"))
    _add_line(parser.add_argument_group("line"))
    _add_planner(parser.add_argument_group("planner"))
    _add_output(parser.add_argument_group("output"))


def _add_problem(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--resolution",
        type=float,
        metavar="M",
        help="edge of a pixel [m] of a PNG, PGM, BMP or JPEG without a YAML file: its lower left "
        "corner is 0,0; as map_server has it, free is brighter than 80.4 %%, occupied darker "
        "than 35 %%, unknown between",
    )
    group.add_argument(
        "--unknown-free", action="store_true", help="take unknown pixels for free ones"
    )
    start = group.add_mutually_exclusive_group()
    start.add_argument(
        "--start", type=pair_of_ints, metavar="R,C", help="cell to start in; row 0 has smallest y"
    )
    start.add_argument(
        "--start-xy", type=pair_of_floats, metavar="X,Y", help="point to start at [m]"
    )
    group.add_argument(
        "--cell",
        type=float,
        metavar="M",
        help="width of the tool [m]; cells are as wide, less the overlap of a line over the "
        f"floor (default: {ROBOT.tool_width_m:g})",
    )
    group.add_argument(
        "--robot-radius",
        type=float,
        metavar="M",
        help=f"radius of the robot [m]; ignored with a .npy grid (default: {ROBOT.radius_m:g})",
    )
    group.add_argument(
        "--clearance",
        type=float,
        metavar="M",
        help="distance that a line over the floor keeps from walls in addition to the radius, "
        f"except where giving it up gains enough floor [m] (default: {ROBOT.clearance_m:g})",
    )
    group.add_argument(
        "--end",
        type=_end,
        default=ANYWHERE,
        metavar="anywhere|home|R,C",
        help="where the walk ends: anywhere, at its start, or in a cell (default: %(default)s)",
    )
    add_passes(
        group,
        f"several passes, each from where the one before ends: their number, or for each {WORDS}. "
        "The budget is for each pass",
    )
    group.add_argument(
        "--speed-m-s",
        type=float,
        metavar="V",
        help=f"speed of the robot [m/s] (default: {ROBOT.speed_m_s:g})",
    )
    group.add_argument(
        "--turn-radius",
        type=float,
        metavar="M",
        help="radius of the tightest arc that the robot drives: a line over the floor becomes a "
        "curve of lanes and arcs; 0 for turns on the spot [m] (default: "
        f"{ROBOT.turn_radius_m:g})",
    )
    group.add_argument(
        "--forward-only",
        action="store_true",
        help="a robot with a turning radius never drives backward (default: it may)",
    )
    group.add_argument(
        "--turn-s",
        type=float,
        metavar="S",
        help="time of a quarter-turn on the spot [s]; 0 minimises steps, as the paper does "
        f"(default: 0; {ROBOT.quarter_turn_s:g} for a line over the floor); --config may say "
        "more of how the robot turns and accelerates",
    )


def _add_line(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--line",
        choices=(CELLS, "quick", THOROUGH),
        help="cells: through the centres of the cells, as the paper's planners do; quick, "
        "thorough: off the centres where walls require it, and optimised for the floor that it "
        "sweeps, a square metre being worth 60 or 180 s; needs a YAML map (default: thorough; "
        "cells for .npy grids, and planners other than colony-search)",
    )
    group.add_argument(
        "--overlap",
        type=float,
        metavar="SHARE",
        help="overlap of neighbouring cells of a line over the floor, as a share of the tool's "
        "width "
        f"(default: {ROBOT.overlap:g})",
    )

    group.add_argument(
        "--align",
        type=_alignment,
        metavar="walls|axes|DEG",
        help="direction of the cells' rows of a line over the floor: along most of the "
        "building's walls, the axes of the map frame, or an angle to these [degrees "
        f"counter-clockwise] (default: {WALLS})",
    )


def _add_planner(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--planner",
        type=_planner,
        metavar="NAME",
        help="; ".join(f"{name}: {entry.about}" for name, entry in PLANNERS.items())
        + "; FILE.py:NAME or MODULE:NAME: a function or class of your own, in a file or an "
        + "installed module, which is run with your rights, see fasaco_edge/researcher.md "
        + f"(default: {SEARCH.planner})",
    )
    group.add_argument(
        "--ants", type=int, metavar="N", help=f"ants in all (default: {SEARCH.ants})"
    )
    group.add_argument(
        "--velocities",
        metavar="V",
        help="cohorts' velocities [cells/move]: 8:1 falling, 1:8 rising, 4 constant, 8,4,1 "
        f"(default: {SEARCH.velocities})",
    )
    group.add_argument(
        "--seed",
        type=int,
        metavar="N",
        help=f"seed of all draws: the same seed gives the same walk (default: {SEARCH.seed})",
    )
    group.add_argument(
        "--budget",
        type=float,
        metavar="S",
        help="time for the search of walks and of the line along one [s]; a first walk and line "
        f"are always finished, a planner of your own is ended (default: {BUDGET_S:g}; "
        f"{OWN_BUDGET_S:g} for a planner of your own; none by others than colony-search)",
    )
    group.add_argument(
        "--swept",
        type=float,
        metavar="SHARE",
        help="share of the reachable floor that the line is to sweep, in the least time; takes "
        "longer than the default --budget (default: as much as pays)",
    )


def _add_output(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--path-out",
        type=Path,
        metavar="FILE.csv",
        help="write the walk: header row,col",
    )
    group.add_argument(
        "--xy-out",
        type=Path,
        metavar="FILE",
        help="write the line to be driven as points in the map frame [m]: as GeoJSON if it is "
        "called so (.geojson), else as CSV with the header x_m,y_m "
        "(with --turn-radius: x_m,y_m,yaw_rad, the robot's heading [rad], which is opposite to its "
        "way where it drives backward); needs a YAML map, as a .npy grid has no frame",
    )
    group.add_argument("--png", type=Path, metavar="FILE", help="write a picture of the walk")
    group.add_argument(
        "--rooms",
        action="store_true",
        help="find the rooms of a YAML map: print them with what the line does in each, and draw "
        "them in the picture",
    )
    group.add_argument(
        "--pheromone-png",
        type=Path,
        metavar="FILE",
        help="write a picture of the trail that the colony leaves: where it points to from each "
        "cell, and how decided it is (colony-search, fasaco and aco)",
    )
    group.add_argument(
        "--long", action="store_true", help="print all figures, and not only those that matter"
    )
    add_json(group, "all figures")


def _planner(text: str) -> str:
    """Read the name of a planner, or the place of a user's own planner."""
    if text not in PLANNER_NAMES and not is_place(text):
        names = ", ".join(PLANNER_NAMES)
        raise argparse.ArgumentTypeError(f"must be {names}, {SHAPE}, got {text!r}")
    return text


def _end(text: str) -> str | tuple[int, int]:
    """Read the end of the walk."""
    if text in (ANYWHERE, HOME):
        return text
    try:
        return pair_of_ints(text)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"must be {ANYWHERE}, {HOME} or row,column, got {text!r}"
        ) from None


def _alignment(text: str) -> str | float:
    """Read the direction of the cells' rows."""
    if text in (WALLS, AXES):
        return text
    try:
        angle_deg = float(text)
    except ValueError:
        angle_deg = math.nan
    if not abs(angle_deg) <= MOST_ANGLE_DEG:
        raise argparse.ArgumentTypeError(
            f"must be {WALLS}, {AXES} or an angle up to {MOST_ANGLE_DEG:g} degrees, got {text!r}"
        )
    return angle_deg
