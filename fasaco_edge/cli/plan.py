"""``fasaco-edge plan``: plan offline, for a map or a coverage grid in a file."""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fasaco_edge.cli.arguments import (
    DEFAULT_CELL_M,
    DEFAULT_RADIUS_M,
    pair_of_floats,
    pair_of_ints,
)
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.colony import VISIBILITIES
from fasaco_edge.planners.names import PLANNER_NAMES

if TYPE_CHECKING:
    from fasaco_edge.cli.arguments import Subparsers
    from fasaco_edge.grid.lattice import Cell, CoverageLattice
    from fasaco_edge.grid.occupancy import OccupancyGrid
    from fasaco_edge.planners.colony import ColonyConfig
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem

EPILOG = """\
examples:
  fasaco-edge plan basement --png basement.png
  fasaco-edge plan site.yaml --cell 0.35 --robot-radius 0.2 --start-xy 1.5,-2 --json
  fasaco-edge plan grid.npy --start 8,8 --planner aco --return-home --path-out path.csv

figures:
  revisits         steps + 1 - distinct cells
  recovered_cells  distinct cells visited twice or more
  n_r_paper        revisits with the way home, to compare with the paper's Table I
The colony's options are for fasaco; aco takes all but the velocities, the others none.
"""


def add_to(commands: Subparsers, common: argparse.ArgumentParser) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "plan",
        parents=[common],
        help="plan a coverage path offline",
        description="Plan a walk over all cells the robot can reach, and say how good it is.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "map",
        metavar="MAP",
        help="map_server YAML, a name from `maps`, or a coverage grid .npy (bool, True = free)",
    )
    _add_problem(parser.add_argument_group("problem"))
    _add_planner(parser.add_argument_group("planner"))
    _add_output(parser.add_argument_group("output"))
    parser.set_defaults(command=run)


def _add_problem(group: argparse._ArgumentGroup) -> None:
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
        default=DEFAULT_CELL_M,
        metavar="M",
        help="edge of a cell, the width of the tool [m] (default: %(default)s)",
    )
    group.add_argument(
        "--robot-radius",
        type=float,
        default=DEFAULT_RADIUS_M,
        metavar="M",
        help="radius of the robot [m]; no part in a .npy grid (default: %(default)s)",
    )
    group.add_argument("--return-home", action="store_true", help="end the walk at the start")


def _add_planner(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--planner",
        choices=PLANNER_NAMES,
        default="fasaco",
        help="fasaco; aco is fasaco at velocity 1; stc is spanning-tree coverage; spiral-stc and "
        "zigzag are the paper's baselines (default: %(default)s)",
    )
    group.add_argument("--ants", type=int, default=1000, metavar="N", help="(default: %(default)s)")
    group.add_argument(
        "--velocities",
        default="8:1",
        metavar="V",
        help="cohorts' velocities [cells/step]: 8:1 falling, 1:8 rising, 4 constant, 8,4,1 "
        "(default: %(default)s)",
    )
    group.add_argument(
        "--q0", type=float, default=0.7, help="equation (4)'s threshold (default: %(default)s)"
    )
    group.add_argument(
        "--visibility",
        choices=VISIBILITIES,
        default="neighbour",
        help="what eta of equation (5) is 1 over: the distance to the neighbour, 1, as in the "
        "paper; the distance an ant will go; the neighbour's open neighbours "
        "(default: %(default)s)",
    )
    group.add_argument(
        "--beta", type=float, default=2.0, help="weight of visibility (default: %(default)s)"
    )
    group.add_argument("--seed", type=int, default=0, metavar="N", help="(default: %(default)s)")
    group.add_argument(
        "--threads",
        type=int,
        default=1,
        metavar="N",
        help="ants walk on so many; the path is the same for any number (default: %(default)s)",
    )
    group.add_argument(
        "--no-local-search", action="store_true", help="the colony alone (it is alone as yet)"
    )


def _add_output(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--path-out", type=Path, metavar="FILE.csv", help="write the walk: header row,col"
    )
    group.add_argument("--png", type=Path, metavar="FILE", help="draw the walk")
    group.add_argument("--json", action="store_true", help="print the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Plan, print the figures, write what was asked for."""
    from fasaco_edge.cli.outputs import check_output, writing
    from fasaco_edge.cli.warmup import compile_kernels
    from fasaco_edge.grid.map_files import find_map
    from fasaco_edge.planners.colony import ColonyConfig, parse_velocities
    from fasaco_edge.planners.problem import CoverageProblem

    if not 1 <= args.threads <= 64:
        raise BadConfiguration(f"--threads must be in 1..64, got {args.threads}")
    colony = ColonyConfig(
        ants=args.ants,
        velocities=parse_velocities(args.velocities),
        q0=args.q0,
        seed=args.seed,
        visibility=args.visibility,
        beta=args.beta,
    )
    find_map(args.map)
    check_output(args.path_out)
    check_output(args.png)
    compile_kernels()
    lattice, grid, file = _read(args)
    start = _start(args, lattice, file)
    problem = CoverageProblem.of(lattice, start, return_home=args.return_home)
    path, wall_s, cpu_s = _plan(args, colony, problem)
    figures = _figures(args, problem, path, wall_s, cpu_s)
    if args.path_out is not None:
        with writing(args.path_out):
            np.savetxt(args.path_out, path.cells, "%d", ",", header="row,col", comments="")
    if args.png is not None:
        with writing(args.png):
            _draw(args.png, lattice, grid, path, figures)
    _print(args, figures)
    return 0


def _read(args: argparse.Namespace) -> tuple[CoverageLattice, OccupancyGrid | None, Path]:
    from fasaco_edge.grid.lattice import CoverageLattice, Footprint
    from fasaco_edge.grid.map_files import find_map, read_coverage_grid, read_map

    for option, value in (("--cell", args.cell), ("--robot-radius", args.robot_radius)):
        if not 0.0 < value <= 10.0:
            raise BadConfiguration(f"{option} must be in (0, 10] m, got {value}")
    file = find_map(args.map)
    if file.suffix == ".npy":
        return CoverageLattice.from_free(read_coverage_grid(file), args.cell), None, file
    grid = read_map(file)
    return CoverageLattice.from_map(grid, Footprint(args.cell, args.robot_radius)), grid, file


def _start(args: argparse.Namespace, lattice: CoverageLattice, file: Path) -> Cell:
    from fasaco_edge.planners.start import start_cell

    if args.start is not None:
        cell: Cell = args.start
        return cell
    if args.start_xy is not None:
        return lattice.cell_at(*args.start_xy)
    return start_cell(lattice, file)


def _plan(
    args: argparse.Namespace, colony: ColonyConfig, problem: CoverageProblem
) -> tuple[CoveragePath, float, float]:
    """Plan with a progress bar; return the path, wall and processor seconds."""
    from fasaco_edge.cli.terminal import progress
    from fasaco_edge.planners.planner import ignore
    from fasaco_edge.planners.table import PLANNERS

    with progress() as bar:
        task = bar.add_task("ants", total=colony.ants)

        def watch(ants: int) -> bool:
            bar.update(task, completed=ants)
            return False

        wall, cpu = time.perf_counter(), time.process_time()
        path = PLANNERS[args.planner](colony, args.threads).plan(problem, watch, ignore)
        return path, time.perf_counter() - wall, time.process_time() - cpu


def _figures(
    args: argparse.Namespace,
    problem: CoverageProblem,
    path: CoveragePath,
    wall_s: float,
    cpu_s: float,
) -> dict[str, Any]:
    from fasaco_edge.planners.path import walk_figures

    walk = asdict(walk_figures(problem.lattice, path.cells))
    return {
        "planner": path.planner,
        "seed": path.seed,
        "ants": path.ants,
        "velocities": {"fasaco": args.velocities, "aco": "1"}.get(path.planner),
        "map": str(args.map),
        "cell_m": args.cell,
        "start": list(problem.start),
        "end": path.cells[-1].tolist(),
        **walk,
        # What there is to cover; the walk may pass over no other cells.
        "cells": problem.cells,
        "length_m": round(path.steps * args.cell, 3),
        "unreachable_cells": int(np.count_nonzero(problem.unreachable)),
        "wall_s": round(wall_s, 6),
        "cpu_s": round(cpu_s, 6),
    }


def _draw(
    file: Path,
    lattice: CoverageLattice,
    grid: OccupancyGrid | None,
    path: CoveragePath,
    figures: dict[str, Any],
) -> None:
    from fasaco_edge.drawing import draw_walk

    colony = f" {figures['velocities']}, {path.ants} ants, seed {path.seed}" if path.ants else ""
    title = path.planner + colony
    lines = [
        f"{Path(figures['map']).name}: {figures['cells']} cells of {figures['cell_m']} m, "
        f"{figures['steps']} steps, {figures['revisits']} revisits, "
        f"{figures['turns_90']} quarter-turns",
    ]
    draw_walk(lattice, path.cells, grid=grid, title=title, lines=lines).save(file, "PNG")


def _print(args: argparse.Namespace, figures: dict[str, Any]) -> None:
    from fasaco_edge.cli import terminal

    if args.json:
        print(json.dumps(figures))
        return
    rows = [(name.replace("_", " "), str(value)) for name, value in figures.items()]
    terminal.out().print(terminal.figures(rows))
    for file in (args.path_out, args.png):
        if file is not None:
            terminal.out().print(f"wrote {file}")
