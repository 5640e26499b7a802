"""``fasaco-edge plan --robots``: one walk for each of several robots, which share the floor."""

from __future__ import annotations

import argparse
import signal
import time
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import Exit, writing
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.geojson import SUFFIX, lines_collection
from fasaco_edge.cli.planning.request import require_frame, watching
from fasaco_edge.cli.planning.results import say_written
from fasaco_edge.cli.warmup import compile_kernels
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.processes import first_signal_calls
from fasaco_edge.offline.settings import ANYWHERE, CELLS, HOME
from fasaco_edge.planners.cost import count_turns
from fasaco_edge.planners.planner import Interrupt, SearchProgress, TimeBudget
from fasaco_edge.planners.stages import stages_of_plan
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.limits import MAX_FLEET_PARTS

if TYPE_CHECKING:
    from fasaco_edge.cli.planning.request import PlanRequest
    from fasaco_edge.fleet.planning.division import Division
    from fasaco_edge.grid.lattice import Cell, CoverageLattice
    from fasaco_edge.grid.occupancy import OccupancyGrid


def plan_fleet(args: argparse.Namespace, request: PlanRequest) -> int:
    """Plan, print the figures, and write the requested files."""
    robot, search = request.robot, request.search
    _check(args, request)
    compile_kernels(stages_of_plan(search.planner, is_shared=True))
    # Imported late, as they import the compiler.
    from fasaco_edge.fleet.planning.division import Fleet, divide
    from fasaco_edge.offline.maps import load_map

    map = load_map(args.map, resolution_m=args.resolution, unknown_free=args.unknown_free)
    require_frame(map, args.xy_out)
    lattice = map.lattice(robot)
    starts = args.robots or [lattice.cell_at(*xy) for xy in args.robots_xy]
    _check_apart(starts)
    fleet = Fleet(starts, robot.cost(lattice.cell_m), args.end == HOME, search.seed, search.threads)
    asked = Interrupt()
    began, cpu = time.perf_counter(), time.process_time()
    with first_signal_calls(signal.SIGINT, asked.asked.set), watching(search.most_s) as show:
        assert search.most_s is not None
        is_over = TimeBudget(search.most_s)

        def stop(progress: SearchProgress) -> bool:
            show(progress)
            return asked(progress) or is_over(progress)

        division = divide(lattice, fleet, stop)
    figures = _figures(args, request, lattice, division) | {
        "wall_s": round(time.perf_counter() - began, 6),
        "cpu_s": round(time.process_time() - cpu, 6),
    }
    robots = [_robot(lattice, walk) for walk in division.walks]
    for one, cost_s in zip(robots, division.costs_s, strict=True):
        one["cost_s"] = cost_s
    _write(args, lattice, map.grid, division, figures)
    _print(args, figures, robots)
    return Exit.INTERRUPTED if asked.asked.is_set() else Exit.OK


def _check(args: argparse.Namespace, request: PlanRequest) -> None:
    """Refuse options that do not apply to several robots."""
    search, count = request.search, len(args.robots or args.robots_xy)
    line = "a line over the floor is for one robot"
    refused = (
        (args.end not in (ANYWHERE, HOME), "--end", "several robots cannot end in one cell"),
        (
            not search.has_local_search,
            "--planner",
            "several robots are planned for by colony-search",
        ),
        (request.line != CELLS, "--line", line),
        (args.pheromone_png is not None, "--pheromone-png", "it shows the colony of one robot"),
        (args.align is not None, "--align", line),
        (args.overlap is not None, "--overlap", line),
        (args.clearance is not None, "--clearance", line),
    )
    for is_given, option, why in refused:
        if is_given:
            raise BadConfiguration(f"{option}: {why}", hint=f"leave {option} out")
    if count > MAX_FLEET_PARTS:
        raise BadConfiguration(f"at most {MAX_FLEET_PARTS} robots share a floor, got {count}")


def _check_apart(starts: Sequence[Cell]) -> None:
    for (one, here), (other, there) in combinations(enumerate(starts, 1), 2):
        if here == there:
            raise BadConfiguration(
                f"robots {one} and {other} both start in cell {here}",
                hint="give each a cell of its own",
            )


def _figures(
    args: argparse.Namespace, request: PlanRequest, lattice: CoverageLattice, division: Division
) -> dict[str, object]:
    """Return the figures of all robots together, as JSON values."""
    from fasaco_edge.offline.result import driving

    steps = [len(walk) - 1 for walk in division.walks]
    least = division.lower_bound_steps
    window = lattice.window
    passed = np.zeros(lattice.states.shape, np.int64)
    for walk in division.walks:
        rows, cols = np.unique(walk - (window.row0, window.col0), axis=0).T
        passed[rows, cols] += 1
    return {
        "planner": request.search.planner,
        "seed": request.search.seed,
        "map": str(args.map),
        "tool_m": request.robot.tool_width_m,
        "cell_m": lattice.cell_m,
        "end": args.end,
        "cells": division.cells,
        "makespan_steps": max(steps),
        "makespan_s": max(division.costs_s),
        "lower_bound_makespan_steps": least,
        "gap": round(max(steps) / least - 1, 6) if least else None,
        "steps": sum(steps),
        "balance": round(sum(steps) / len(steps) / max(steps), 6) if max(steps) else None,
        "swept_twice": int(np.count_nonzero(passed > 1)),
        "revisits": sum(len(walk) for walk in division.walks) - int(np.count_nonzero(passed)),
        "unreachable_cells": int(np.count_nonzero(lattice.coverable & (passed == 0))),
        "rounds": division.rounds,
        **driving(request.robot),
        "budget_s": request.search.most_s,
        "threads": request.search.threads,
    }


def _robot(lattice: CoverageLattice, walk: NDArray[np.int32]) -> dict[str, object]:
    """Return the figures of one robot, as JSON values."""
    turns = count_turns(walk)
    return {
        "start": walk[0].tolist(),
        "end": walk[-1].tolist(),
        "cells": len(np.unique(walk, axis=0)),
        "steps": len(walk) - 1,
        "length_m": round((len(walk) - 1) * lattice.cell_m, 3),
        "turns_90": turns.quarter,
        "turns_180": turns.half,
    }


def _write(
    args: argparse.Namespace,
    lattice: CoverageLattice,
    grid: OccupancyGrid | None,
    division: Division,
    figures: dict[str, object],
) -> None:
    if args.path_out is not None:
        with writing(args.path_out) as file:
            _write_rows(file, "robot,row,col", "%d", division.walks)
    if args.xy_out is not None:
        from fasaco_edge.offline.ground import line_through

        lines = [line_through(lattice, walk) for walk in division.walks]
        with writing(args.xy_out) as file:
            if args.xy_out.suffix == SUFFIX:
                each = enumerate((line.tolist() for line in lines), 1)
                document = lines_collection((line, {"robot": number}) for number, line in each)
                file.write_bytes(encode_json(document))
            else:
                _write_rows(file, "robot,x_m,y_m", ("%d", "%.6f", "%.6f"), lines)
    if args.png is not None:
        from fasaco_edge.fleet.review.drawing import draw_fleet

        gap = f", at most {figures['gap']:.1%} above the lower bound" if figures["gap"] else ""
        lines_below = [
            f"{Path(args.map).name}: {figures['cells']} cells of {lattice.cell_m:g} m, "
            f"{len(division.walks)} robots; longest walk {figures['makespan_steps']} steps{gap}; "
            f"{figures['swept_twice']} cells passed by two or more",
        ]
        title = f"{figures['planner']}, {len(division.walks)} robots, seed {figures['seed']}"
        with writing(args.png) as file:
            draw_fleet(lattice, division.walks, grid=grid, title=title, lines=lines_below).save(
                file, "PNG"
            )


def _write_rows(
    file: Path, header: str, form: str | Sequence[str], tables: Sequence[NDArray[np.generic]]
) -> None:
    """Write tables (n, 2) as one CSV, each row with the number of its robot, from 1."""
    numbered = [
        np.column_stack((np.full(len(table), number), table))
        for number, table in enumerate(tables, 1)
    ]
    np.savetxt(file, np.vstack(numbered), form, ",", header=header, comments="")


def _summary(figures: dict[str, Any], robots: int) -> list[tuple[str, str]]:
    """Return the figures that matter, as names and words."""
    from fasaco_edge.text import duration

    gap = (
        ""
        if figures["gap"] is None
        else f", at most {100 * figures['gap']:.1f} % above the lower bound"
    )
    turns = "" if figures["turn_s"] else " without turns"
    rows = [
        ("map", f"{figures['map']}, {figures['cells']} cells of {figures['cell_m']:g} m"),
        ("time", f"{duration(figures['makespan_s'])}{turns}, of the robot that takes longest"),
        ("longest", f"{figures['makespan_steps']} of {figures['steps']} steps{gap}"),
        ("passed", f"{figures['swept_twice']} cells by two or more of {robots} robots"),
    ]
    if count := figures["unreachable_cells"]:
        rows.append(("not reached", f"{count} cells that no walk from a start leads to"))
    return rows


def _print(
    args: argparse.Namespace, figures: dict[str, object], robots: list[dict[str, object]]
) -> None:
    """Print the figures as JSON or as tables."""
    if args.json:
        print_json(figures | {"robots": robots})
        return
    if args.long:
        rows = [(name.replace("_", " "), str(value)) for name, value in figures.items()]
        terminal.out().print(terminal.figures(rows))
    else:
        terminal.out().print(terminal.summary(_summary(figures, len(robots))))
    for number, robot in enumerate(robots, 1):
        terminal.out().print(
            f"robot {number}: from {robot['start']} to {robot['end']}, {robot['steps']} steps, "
            f"{robot['length_m']} m, {robot['cost_s']:.1f} s, {robot['turns_90']} quarter-turns"
        )
    say_written(args)
