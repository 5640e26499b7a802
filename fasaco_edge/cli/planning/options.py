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
from fasaco_edge.text import suggestion

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
  length_m         length of the walk
  cost_s           time to drive and turn along the cells of the walk [s]; turns take none if
                   turn_s is 0. The time of the line is seconds of floor
  lattice_deg      angle of the rows of cells to the x axis of the map frame; (row, col) of a
                   cell count along these rows
  gap              cost_s / lower_bound_cost_s - 1, for steps and turns together
  floor            (YAML maps) by the map's pixels, with a tool as wide as --cell:
                   reachable_m2, the floor that the tool touches from any position that the
                   robot can reach; swept_share, the share of it that the line sweeps; seconds
                   of the line, and seconds_per_m2 swept; gap, by which the seconds exceed the least
                   time to sweep as much; patches_over_4_dm2 not swept, and the largest;
                   illegal_share of the line, on which the robot would touch floor that is not
                   known to be free
  curve            (--turn-radius) length_m and seconds of the curve; backward_m, driven
                   backward; reversals between forward and backward; spot_turns, bends too
                   sharp for the arc, where the robot would turn on the spot
  rooms            (--rooms) area_m2 of free floor; reachable_m2 of it; the share of that
                   which the line sweeps; how often the line enters the room

Figures of several passes are sums; each pass has its own, too.

colony-search finds a complete walk within milliseconds, and improves it by local search and
perturbations; in every other perturbation ants rebuild a part of the walk. It ends when its
budget is used, the walk is proven optimal, or nothing has been gained for long.

A line over the floor is laid along this walk. The rest of the budget improves the line: each
stage of the search takes twice as long as the stage before. A larger budget never gives a worse
line, by its seconds and the price of the floor that it leaves.

--ants and --velocities apply to fasaco, --ants to aco, --velocities to colony-search; a planner
of your own gets the seed. The Python interface has more settings of the colony.
"""

ROBOT, SEARCH = RobotConfig(), Search()


def add_options(parser: argparse.ArgumentParser) -> None:
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
        help="a daemon's configuration: plan as that daemon would; options here take precedence",
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
        help="edge of a pixel [m], for a PNG, PGM, BMP or JPEG without a YAML file. Its lower left "
        "corner is 0,0; pixels brighter than 80.4 %% are free, those darker than 35 %% occupied, "
        "the others unknown, as in map_server",
    )
    group.add_argument("--unknown-free", action="store_true", help="treat unknown pixels as free")
    start = group.add_mutually_exclusive_group()
    start.add_argument(
        "--start", type=pair_of_ints, metavar="R,C", help="start cell; row 0 has the smallest y"
    )
    start.add_argument("--start-xy", type=pair_of_floats, metavar="X,Y", help="start position [m]")
    group.add_argument(
        "--cell",
        "--tool-width",
        type=float,
        metavar="M",
        help="width of the tool [m], and of a cell, which for a line over the floor is narrower "
        f"by the overlap (default: {ROBOT.tool_width_m:g})",
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
        help="distance that a line over the floor keeps from walls in addition to the radius "
        f"[m], except where less gains enough floor (default: {ROBOT.clearance_m:g})",
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
        f"plan several passes, each from the end of the pass before: their number, or {WORDS}. "
        "Each pass gets the whole --budget",
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
        help="radius of the robot's tightest arc [m]: a line over the floor becomes a curve of "
        f"lanes and arcs; 0: the robot turns on the spot (default: {ROBOT.turn_radius_m:g})",
    )
    group.add_argument(
        "--forward-only",
        action="store_true",
        help="never drive backward, as a robot with a turning radius otherwise may",
    )
    group.add_argument(
        "--turn-s",
        type=float,
        metavar="S",
        help="time of a quarter-turn on the spot [s]; 0 minimises steps, as the paper does "
        f"(default: 0; {ROBOT.quarter_turn_s:g} for a line over the floor). A configuration can "
        "give rates and accelerations instead",
    )


def _add_line(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--line",
        choices=(CELLS, "quick", THOROUGH),
        help="cells: through the centres of the cells, as in the paper; quick, thorough: a line "
        "over the floor, which leaves the centres where walls require it, and is optimised for "
        "the floor that it sweeps: a square metre is worth 60 or 180 s; needs a YAML map "
        "(default: thorough; cells for .npy grids, and for planners other than colony-search)",
    )
    group.add_argument(
        "--overlap",
        type=float,
        metavar="SHARE",
        help="overlap of neighbouring cells, as a share of the tool's width, for a line over the "
        f"floor (default: {ROBOT.overlap:g})",
    )
    group.add_argument(
        "--align",
        type=_alignment,
        metavar="walls|axes|DEG",
        help="direction of the rows of cells, for a line over the floor: along most of the "
        "building's walls, along the axes of the map frame, or at an angle to these axes "
        f"[degrees counter-clockwise] (default: {WALLS})",
    )


def _add_planner(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--planner",
        type=_planner,
        metavar="NAME",
        help="; ".join(f"{name}: {entry.about}" for name, entry in PLANNERS.items())
        + "; FILE.py:NAME or MODULE:NAME: a function or class of your own, in a file or an "
        + "installed module; it runs with your rights, see fasaco_edge/researcher.md "
        + f"(default: {SEARCH.planner})",
    )
    group.add_argument(
        "--ants", type=int, metavar="N", help=f"total number of ants (default: {SEARCH.ants})"
    )
    group.add_argument(
        "--velocities",
        metavar="V",
        help="velocities of the cohorts [cells/move]: 8:1 falling, 1:8 rising, 4 for all, or a "
        f"list such as 8,4,1 (default: {SEARCH.velocities})",
    )
    group.add_argument(
        "--seed",
        type=int,
        metavar="N",
        help=f"seed of random numbers: the same seed gives the same walk (default: {SEARCH.seed})",
    )
    group.add_argument(
        "--budget",
        type=float,
        metavar="S",
        help="time for the search of the walk and its line [s]; a first walk and line are always "
        f"finished, a planner of your own is stopped (default: planner.budget_s of --config, else "
        f"{BUDGET_S:g} for colony-search, {OWN_BUDGET_S:g} for a planner of your own, no limit for "
        "others)",
    )
    group.add_argument(
        "--swept",
        type=float,
        metavar="SHARE",
        help="share of the reachable floor that the line has to sweep, in the least time; needs "
        "more than the default --budget (default: planner.swept of --config, else all floor that "
        "is worth its time)",
    )


def _add_output(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--path-out",
        type=Path,
        metavar="FILE.csv",
        help="write the walk as CSV, with the header row,col",
    )
    group.add_argument(
        "--xy-out",
        type=Path,
        metavar="FILE",
        help="write the line as points in the map frame [m]: a FILE.geojson as GeoJSON, any other "
        "as CSV with the header x_m,y_m, or with --turn-radius x_m,y_m,yaw_rad, the robot's "
        "heading [rad], opposite to its motion where it drives backward; needs a YAML map, as a "
        ".npy grid has no frame",
    )
    group.add_argument("--png", type=Path, metavar="FILE", help="write a picture of the walk")
    group.add_argument(
        "--rooms",
        action="store_true",
        help="find the rooms of a YAML map, print what the line does in each, and draw them in "
        "the picture",
    )
    group.add_argument(
        "--pheromone-png",
        type=Path,
        metavar="FILE",
        help="write a picture of the pheromone trail: its direction in each cell, and how "
        "dominant that is (colony-search, fasaco and aco)",
    )
    group.add_argument(
        "--long", action="store_true", help="print all figures, not only the main ones"
    )
    add_json(group, "all figures")


def _planner(text: str) -> str:
    if text not in PLANNER_NAMES and not is_place(text):
        names = ", ".join(PLANNER_NAMES)
        meant = suggestion(text, PLANNER_NAMES)
        said = f"must be {names}, {SHAPE}, got {text!r}{meant and f'; {meant}'}"
        raise argparse.ArgumentTypeError(said)
    return text


def _end(text: str) -> str | tuple[int, int]:
    if text in (ANYWHERE, HOME):
        return text
    try:
        return pair_of_ints(text)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"must be {ANYWHERE}, {HOME} or row,column, got {text!r}"
        ) from None


def _alignment(text: str) -> str | float:
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
