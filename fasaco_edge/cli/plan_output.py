"""The output of ``fasaco-edge plan``: progress bar, figures, picture."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import progress, progress_of_time

if TYPE_CHECKING:
    from fasaco_edge.grid.lattice import CoverageLattice
    from fasaco_edge.grid.occupancy import OccupancyGrid
    from fasaco_edge.planners.colony import ColonyConfig
    from fasaco_edge.planners.path import CoveragePath
    from fasaco_edge.planners.problem import CoverageProblem
    from fasaco_edge.planners.stopping import SearchProgress

# A terminal shows no more pictures a second; drawing them costs the search time.
LEAST_INTERVAL_S = 0.05


def figures_of(
    args: argparse.Namespace,
    problem: CoverageProblem,
    path: CoveragePath,
    search: dict[str, Any],
) -> dict[str, Any]:
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
        "cell_m": args.cell,
        "start": list(problem.start),
        "end": path.cells[-1].tolist(),
        **walk,
        # What there is to cover; the walk may pass over no other cells.
        "cells": problem.cells,
        "length_m": round(path.steps * args.cell, 3),
        "cost_s": path.cost_s,
        "lower_bound_steps": path.lower_bound_steps,
        "gap": None if path.gap is None else round(path.gap, 6),
        "unreachable_cells": int(np.count_nonzero(problem.unreachable)),
        "speed_m_s": args.speed_m_s,
        "turn_s": args.turn_s,
        "budget_s": args.budget,
        "target_gap": args.target_gap,
        "threads": args.threads,
        **search,
    }


def draw(
    args: argparse.Namespace,
    file: Path,
    lattice: CoverageLattice,
    grid: OccupancyGrid | None,
    path: CoveragePath,
    figures: dict[str, Any],
) -> None:
    """Draw the walk."""
    from fasaco_edge.drawing.pictures import draw_walk

    ants = path.work.ants
    counted = "1 ant" if ants == 1 else f"{ants} ants"
    colony = f" {figures['velocities']}, {counted}, seed {path.seed}" if ants else ""
    search = f", {path.work.perturbations} perturbations" if args.local_search else ""
    title = path.planner + colony + search
    lines = [
        f"{Path(figures['map']).name}: {figures['cells']} cells of {figures['cell_m']} m, "
        f"{figures['steps']} steps, {figures['revisits']} revisits, "
        f"{figures['turns_90']} quarter-turns; "
        f"at most {path.gap or 0.0:.1%} above the fewest steps there can be",
    ]
    draw_walk(lattice, path.cells, grid=grid, title=title, lines=lines).save(file, "PNG")


def print_figures(args: argparse.Namespace, figures: dict[str, Any]) -> None:
    """Print the figures as JSON or as a table."""
    from fasaco_edge.cli.console import terminal

    if args.json:
        print_json(figures)
        return
    rows = [(name.replace("_", " "), str(value)) for name, value in figures.items()]
    terminal.out().print(terminal.figures(rows))
    for file in (args.path_out, args.png):
        if file is not None:
            terminal.out().print(f"wrote {file}")


@contextmanager
def watching(
    args: argparse.Namespace, colony: ColonyConfig
) -> Iterator[Callable[[SearchProgress], None]]:
    """Yield what shows how far a search is: the budget used up, else the ants that walked."""
    with progress_of_time() if args.local_search else progress() as bar:
        total = args.budget if args.local_search else colony.ants
        task = bar.add_task("ants", total=total)
        began = shown = time.perf_counter()

        def show(search: SearchProgress) -> None:
            nonlocal shown
            now = time.perf_counter()
            if not bar.disable and now - shown >= LEAST_INTERVAL_S:
                shown = now
                done = now - began if args.local_search else search.work.ants
                bar.update(task, completed=done, description=_words(search))

        yield show


def _words(search: SearchProgress) -> str:
    words = f"{search.steps} steps"
    return words if search.gap is None else f"{words}, {search.gap:.2%} above the bound"
