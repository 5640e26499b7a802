"""``fasaco-edge plan``: plan offline, for a map or a coverage grid in a file."""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import Command, Exit, check_output, writing
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.plan_line import (
    Ground,
    Line,
    PlannedFloor,
    judged_floor,
    read_lattice,
    write_line,
)
from fasaco_edge.cli.plan_options import CELLS, EPILOG, add_options, check, settle
from fasaco_edge.cli.plan_progress import watching
from fasaco_edge.cli.plan_turning import turning_limits
from fasaco_edge.cli.warmup import compile_kernels
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.map_files import find_map
from fasaco_edge.host.processes import ctrl_c_asks
from fasaco_edge.planners.colony import ColonyConfig, parse_velocities
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.planner import (
    GapReached,
    Interrupt,
    SearchProgress,
    StoppingCriterion,
    TimeBudget,
    ignore,
)
from fasaco_edge.planners.registry import planner_of

if TYPE_CHECKING:
    from fasaco_edge.bench.floor import JudgedFloor
    from fasaco_edge.grid.lattice import Cell, CoverageLattice
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem


def run(args: argparse.Namespace) -> int:
    """Plan, print the figures, write what was asked for."""
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
    file = find_map(args.map)
    if file.suffix == ".npy":
        _check_no_floor(args, file)
    for output in (args.path_out, args.xy_out, args.png):
        check_output(output)
    if args.robots or args.robots_xy:
        from fasaco_edge.cli.plan_fleet import plan_fleet

        return plan_fleet(args, file)
    compile_kernels()
    ground = _read(args, file)
    problem = _pose(args, ground)
    asked = Interrupt()
    with ctrl_c_asks(asked.asked.set):
        path, search = _plan(args, colony, problem, asked)
    line_xy = ground.line(args, path.cells, ends=problem.end is not None)
    judged = judged_floor(args, ground.grid, line_xy)
    floor = PlannedFloor.of(judged.figures) if judged else None
    figures = figures_of(args, ground, problem, path, search)
    if args.path_out is not None:
        with writing(args.path_out):
            np.savetxt(args.path_out, path.cells, "%d", ",", header="row,col", comments="")
    if args.xy_out is not None:
        with writing(args.xy_out):
            write_line(args.xy_out, line_xy)
    if args.png is not None:
        with writing(args.png):
            draw(args, args.png, ground, path, figures, judged, line_xy)
    print_figures(args, figures, floor)
    return Exit.INTERRUPTED if asked.asked.is_set() else Exit.OK


def _check_no_floor(args: argparse.Namespace, file: Path) -> None:
    wanted = {"--xy-out": args.xy_out is not None, f"--line {args.line}": args.line != CELLS}
    for option, is_wanted in wanted.items():
        if is_wanted:
            raise BadConfiguration(
                f"{option}: {file} is a coverage grid (.npy), which lies in no map frame",
                hint="plan on a map_server YAML file, or ask for --path-out",
            )


def _read(args: argparse.Namespace, file: Path) -> Ground:
    grid, cells = read_lattice(args, file)
    start = _start(args, cells, file)
    if grid is None or args.line == CELLS:
        return Ground(cells, grid, start)
    return Ground.of_floor(args, grid, cells, start)


def _pose(args: argparse.Namespace, ground: Ground) -> CoverageProblem:
    from fasaco_edge.planners.problem import CoverageProblem

    cost = CoverageCost.for_robot(ground.lattice.cell_m, args.speed_m_s, args.turn_s)
    return CoverageProblem.of(ground.lattice, ground.start, end=ground.end(args), cost=cost)


def _start(args: argparse.Namespace, lattice: CoverageLattice, file: Path) -> Cell:
    from fasaco_edge.planners.grids import start_cell

    if args.start is not None:
        cell: Cell = args.start
        return cell
    if args.start_xy is not None:
        return lattice.cell_at(*args.start_xy)
    return start_cell(lattice, file)


def _plan(
    args: argparse.Namespace, colony: ColonyConfig, problem: CoverageProblem, asked: Interrupt
) -> tuple[CoveragePath, dict[str, object]]:
    """Plan with a progress bar; return the path and the figures of the search itself.

    A planner that knows no lower bound is given one, for its path and for ``--target-gap``.
    """
    from fasaco_edge.planners.bound import lower_bound_of

    planner = planner_of(args.planner, colony, args.threads, args.local_search)
    bound = None if args.local_search else lower_bound_of(problem)
    criteria = _criteria(args, asked)
    ended_by = "the search"
    total = args.budget if args.local_search else colony.ants
    with watching(total, counted=not args.local_search) as show:

        def stop(search: SearchProgress) -> bool:
            nonlocal ended_by
            known = search if bound is None else replace(search, lower_bound_cost_s=bound.cost_s)
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
    if bound is not None:
        path = replace(path, lower_bound_steps=bound.steps, lower_bound_cost_s=bound.cost_s)
    return path, search


def _criteria(args: argparse.Namespace, asked: Interrupt) -> dict[str, StoppingCriterion]:
    """Return what ends the search early, by its name; a budget begins to run here."""
    criteria: dict[str, StoppingCriterion] = {"Ctrl-C": asked}
    if args.target_gap is not None:
        criteria["target gap"] = GapReached(args.target_gap)
    if args.budget is not None:
        criteria["budget"] = TimeBudget(args.budget)
    return criteria


def figures_of(
    args: argparse.Namespace,
    ground: Ground,
    problem: CoverageProblem,
    path: CoveragePath,
    search: dict[str, object],
) -> dict[str, object]:
    """Return the figures of a walk and of the search for it, as JSON values."""
    from fasaco_edge.planners.path import walk_figures

    walk = asdict(walk_figures(problem.lattice, path.cells))
    return {
        "planner": path.planner,
        "local_search": args.local_search,
        "seed": path.seed,
        "ants": path.work.ants,
        "kicks": path.work.perturbations,
        "proposals": path.work.proposals,
        "velocities": {"fasaco": args.velocities, "aco": "1"}.get(path.planner),
        "map": str(args.map),
        "line": args.line,
        "tool_m": args.cell,
        "cell_m": problem.lattice.cell_m,
        "lattice_deg": round(ground.lattice_deg, 3),
        "start": list(problem.start),
        "end": path.cells[-1].tolist(),
        **walk,
        # What there is to cover; the walk may pass over no other cells.
        "cells": problem.cells,
        "length_m": round(path.steps * problem.lattice.cell_m, 3),
        "cost_s": path.cost_s,
        "lower_bound_steps": path.lower_bound_steps,
        "lower_bound_cost_s": path.lower_bound_cost_s,
        "gap": None if path.gap is None else round(path.gap, 6),
        "unreachable_cells": int(np.count_nonzero(problem.unreachable)),
        "speed_m_s": args.speed_m_s,
        "turn_s": args.turn_s,
        **turning_limits(args),
        "budget_s": args.budget,
        "target_gap": args.target_gap,
        "threads": args.threads,
        **search,
    }


def draw(
    args: argparse.Namespace,
    file: Path,
    ground: Ground,
    path: CoveragePath,
    figures: dict[str, object],
    judged: JudgedFloor | None,
    line_xy: Line,
) -> None:
    """Draw the walk, as the line ``line_xy``, and what it leaves of the floor."""
    from fasaco_edge.drawing.pictures import draw_walk
    from fasaco_edge.drawing.plot import MapLayer

    ants = path.work.ants
    counted = "1 ant" if ants == 1 else f"{ants} ants"
    colony = f" {figures['velocities']}, {counted}, seed {path.seed}" if ants else ""
    search = f", {path.work.perturbations} perturbations" if args.local_search else ""
    title = path.planner + colony + search
    askew = f" at {figures['lattice_deg']:g} degrees" if figures["lattice_deg"] else ""
    lines = [
        f"{Path(args.map).name}: {figures['cells']} cells of {figures['cell_m']:g} m{askew}, "
        f"{figures['steps']} steps, {figures['revisits']} revisits, "
        f"{figures['turns_90']} quarter-turns; "
        f"at most {path.gap or 0.0:.1%} above the least time there can be",
    ]
    if judged is not None:
        lines.append(f"reachable floor: {PlannedFloor.of(judged.figures)}")
    swept = MapLayer(judged.geometry, judged.swept) if judged and args.line != CELLS else None
    draw_walk(
        ground.lattice,
        path.cells,
        grid=ground.grid,
        title=title,
        lines=lines,
        line_xy=line_xy,
        swept=swept,
        unswept=MapLayer(judged.geometry, judged.unswept) if judged else None,
    ).save(file, "PNG")


def print_figures(
    args: argparse.Namespace, figures: dict[str, object], floor: PlannedFloor | None
) -> None:
    """Print the figures as JSON or as a table."""
    if args.json:
        print_json(figures | {"floor": asdict(floor) if floor else None})
        return
    rows = [(name.replace("_", " "), str(value)) for name, value in figures.items()]
    rows.append(("floor", str(floor or "not known of a coverage grid")))
    terminal.out().print(terminal.figures(rows))
    for file in (args.path_out, args.xy_out, args.png):
        if file is not None:
            terminal.out().print(f"wrote {file}")


COMMAND = Command(
    description="Plan a walk over all cells the robot can reach, and say how good it is.",
    run=run,
    add_options=add_options,
    epilog=EPILOG,
)
