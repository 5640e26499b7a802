"""``plan --passes``: several passes over a map, one after the other."""

from __future__ import annotations

import argparse
import logging
import signal
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import Exit, writing
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.planning.request import PlanRequest, require_frame, say_written, watching
from fasaco_edge.cli.warmup import compile_kernels
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.processes import first_signal_calls
from fasaco_edge.planners.passes import check_passes
from fasaco_edge.planners.planner import Interrupt
from fasaco_edge.planners.stages import stages_of_plan

if TYPE_CHECKING:
    from fasaco_edge.offline.passes import PassPlans

LOG = logging.getLogger(__name__)


def plan_in_passes(args: argparse.Namespace, request: PlanRequest) -> int:
    """Plan the passes, print their figures, and write the requested files.

    Raises:
        BadConfiguration: an option does not go with ``--passes``, or a pass not with those before.
    """
    search = request.search
    check_passes(args.passes, "--passes")
    if not search.has_local_search:
        raise BadConfiguration(
            "--passes: only colony-search has passes", hint="leave --planner out"
        )
    if args.pheromone_png:
        raise BadConfiguration("--pheromone-png: several passes leave no single trail")
    compile_kernels(stages_of_plan(search.planner))
    # Imported only now, as these modules import the compiler.
    from fasaco_edge.offline.maps import load_map
    from fasaco_edge.offline.passes import plan_passes

    map = load_map(args.map, resolution_m=args.resolution, unknown_free=args.unknown_free)
    require_frame(map, args.xy_out)
    asked, total = Interrupt(), search.most_s
    total = None if total is None else total * len(args.passes)
    with first_signal_calls(signal.SIGINT, asked.asked.set), watching(total) as show:
        planned = plan_passes(
            map,
            request.robot,
            args.passes,
            start=args.start,
            start_xy=args.start_xy,
            end=args.end,
            line=request.line,
            align=args.align,
            search=search,
            stop=asked,
            watch=show,
        )
    if args.path_out is not None:
        with writing(args.path_out) as file:
            walks = [plan.cells for plan in planned.plans]
            np.savetxt(file, _numbered(walks), "%d", ",", header="pass,row,col", comments="")
    if args.xy_out is not None:
        with writing(args.xy_out) as file:
            rows = _numbered([plan.xy for plan in planned.plans])
            form = ("%d", "%.6f", "%.6f")
            np.savetxt(file, rows, form, ",", header="pass,x_m,y_m", comments="")
    if args.png is not None:
        with writing(args.png) as file:
            planned.plot(file)
    figures = planned.figures | {"map": str(args.map)}
    if args.json:
        print_json(figures)
    else:
        _print(args, planned, figures)
    return Exit.INTERRUPTED if asked.asked.is_set() else Exit.OK


def _numbered(tables: Sequence[NDArray[np.generic]]) -> NDArray[np.generic]:
    """Return tables (n, 2) as one, each row with the number of its pass, from 1."""
    return np.vstack(
        [np.column_stack((np.full(len(rows), at), rows)) for at, rows in enumerate(tables, 1)]
    )


def _print(args: argparse.Namespace, planned: PassPlans, figures: dict[str, Any]) -> None:
    """Print the sums, and a line for each pass."""
    passes = figures.pop("passes")
    if args.long:
        from fasaco_edge.offline.figures import floor_words

        floor = planned.floor
        figures["floor"] = "not known of a coverage grid" if floor is None else floor_words(floor)
        rows = [(name.replace("_", " "), text) for name, text in terminal.known(figures)]
        terminal.out().print(terminal.figures(rows))
    else:
        from fasaco_edge.offline.summary import rows_of_passes

        terminal.out().print(terminal.summary(rows_of_passes(planned)))
    for number, each in enumerate(passes, 1):
        gap = each["gap"]
        words = "" if gap is None else f", at most {gap:.1%} above the bound"
        terminal.out().print(
            f"pass {number}, {each['pass']}: {each['cells']} cells, {each['steps']} steps, "
            f"{each['cost_s']:.1f} s{words}"
        )
    say_written(args)
