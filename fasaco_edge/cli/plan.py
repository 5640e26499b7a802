"""``fasaco-edge plan``: plan offline, for a map or a coverage grid in a file."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fasaco_edge.cli.console import exits
from fasaco_edge.cli.console.arguments import add_command
from fasaco_edge.cli.plan_options import ANYWHERE, EPILOG, HOME, add_options, check, settle
from fasaco_edge.host.signals import ctrl_c_asks

if TYPE_CHECKING:
    from fasaco_edge.cli.console.arguments import Subparsers
    from fasaco_edge.grid.lattice import Cell, CoverageLattice
    from fasaco_edge.grid.occupancy import OccupancyGrid
    from fasaco_edge.planners.colony import ColonyConfig
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem
    from fasaco_edge.planners.stopping import Interrupt, SearchProgress, StoppingCriterion


def add_to(commands: Subparsers, common: argparse.ArgumentParser) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        common,
        "plan",
        run,
        about="plan a coverage path offline",
        description="Plan a walk over all cells the robot can reach, and say how good it is.",
        epilog=EPILOG,
    )
    add_options(parser)


def run(args: argparse.Namespace) -> int:
    """Plan, print the figures, write what was asked for."""
    from fasaco_edge.cli.console.arguments import check_output, writing
    from fasaco_edge.cli.plan_output import draw, figures_of, print_figures
    from fasaco_edge.cli.warmup import compile_kernels
    from fasaco_edge.grid.map_files import find_map
    from fasaco_edge.planners.colony import ColonyConfig, parse_velocities
    from fasaco_edge.planners.stopping import Interrupt

    settle(args)
    check(args)
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
    problem = _pose(args, lattice, file)
    asked = Interrupt()
    with ctrl_c_asks(asked.asked.set):
        path, search = _plan(args, colony, problem, asked)
    figures = figures_of(args, problem, path, search)
    if args.path_out is not None:
        with writing(args.path_out):
            np.savetxt(args.path_out, path.cells, "%d", ",", header="row,col", comments="")
    if args.png is not None:
        with writing(args.png):
            draw(args, args.png, lattice, grid, path, figures)
    print_figures(args, figures)
    return exits.INTERRUPTED if asked.asked.is_set() else exits.OK


def _read(args: argparse.Namespace) -> tuple[CoverageLattice, OccupancyGrid | None, Path]:
    from fasaco_edge.grid.lattice import CoverageLattice, Footprint
    from fasaco_edge.grid.map_files import find_map, read_coverage_grid, read_map

    file = find_map(args.map)
    if file.suffix == ".npy":
        return CoverageLattice.from_free(read_coverage_grid(file), args.cell), None, file
    grid = read_map(file)
    return CoverageLattice.from_map(grid, Footprint(args.cell, args.robot_radius)), grid, file


def _pose(args: argparse.Namespace, lattice: CoverageLattice, file: Path) -> CoverageProblem:
    from fasaco_edge.planners.cost import CoverageCost
    from fasaco_edge.planners.problem import CoverageProblem

    start = _start(args, lattice, file)
    end = {ANYWHERE: None, HOME: start}.get(args.end, args.end)
    cost = CoverageCost.for_robot(args.cell, args.speed_m_s, args.turn_s)
    return CoverageProblem.of(lattice, start, end=end, cost=cost)


def _start(args: argparse.Namespace, lattice: CoverageLattice, file: Path) -> Cell:
    from fasaco_edge.planners.start import start_cell

    if args.start is not None:
        cell: Cell = args.start
        return cell
    if args.start_xy is not None:
        return lattice.cell_at(*args.start_xy)
    return start_cell(lattice, file)


def _plan(
    args: argparse.Namespace, colony: ColonyConfig, problem: CoverageProblem, asked: Interrupt
) -> tuple[CoveragePath, dict[str, Any]]:
    """Plan with a progress bar; return the path and the figures of the search itself.

    A planner that knows no lower bound is given one, for its path and for ``--target-gap``.
    """
    from fasaco_edge.cli.plan_output import watching
    from fasaco_edge.planners.graph import lower_bound_steps
    from fasaco_edge.planners.planner import ignore
    from fasaco_edge.planners.registry import planner_of

    planner = planner_of(args.planner, colony, args.threads, args.local_search)
    bound = 0 if args.local_search else lower_bound_steps(problem)
    criteria = _criteria(args, asked)
    ended_by = "the search"
    with watching(args, colony) as show:

        def stop(search: SearchProgress) -> bool:
            nonlocal ended_by
            known = replace(search, lower_bound_steps=max(search.lower_bound_steps, bound))
            show(known)
            over = [name for name, is_over in criteria.items() if is_over(known)]
            ended_by = over[0] if over else ended_by
            return bool(over)

        wall, cpu = time.perf_counter(), time.process_time()
        path = planner.plan(problem, stop, ignore)
        search = {
            "ended_by": ended_by,
            "first_walk_ms": round(1e3 * path.first_walk_s, 3),
            "wall_s": round(time.perf_counter() - wall, 6),
            "cpu_s": round(time.process_time() - cpu, 6),
        }
    known = max(path.lower_bound_steps, bound)
    return replace(path, lower_bound_steps=known), search


def _criteria(args: argparse.Namespace, asked: Interrupt) -> dict[str, StoppingCriterion]:
    """Return what ends the search early, by its name; a budget begins to run here."""
    from fasaco_edge.planners.stopping import GapReached, TimeBudget

    criteria: dict[str, StoppingCriterion] = {"Ctrl-C": asked}
    if args.target_gap is not None:
        criteria["target gap"] = GapReached(args.target_gap)
    if args.budget is not None:
        criteria["budget"] = TimeBudget(args.budget)
    return criteria
