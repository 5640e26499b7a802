"""``fasaco-edge plan``: an offline plan for a map or a coverage grid in a file."""

from __future__ import annotations

import argparse
import logging
import signal
from collections import deque
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import Command, Exit, check_outputs, writing
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.planning.options import EPILOG, add_options
from fasaco_edge.cli.planning.request import read_request, require_frame, say_written, watching
from fasaco_edge.cli.warmup import compile_kernels
from fasaco_edge.config.cautions import tool_caution
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.map_files import find_map, map_sources
from fasaco_edge.host.processes import first_signal_calls
from fasaco_edge.offline.settings import CELLS
from fasaco_edge.planners.planner import ColonySnapshot, Interrupt, ignore
from fasaco_edge.planners.stages import ROOMS, stages_of_plan

if TYPE_CHECKING:
    from fasaco_edge.offline.result import Plan
    from fasaco_edge.offline.rooms import RoomsUnderLine

LOG = logging.getLogger(__name__)

WITH_PHEROMONE = ("colony-search", "fasaco", "aco")


def run(args: argparse.Namespace) -> int:
    """Plan, print the figures, and write the requested files."""
    request = read_request(args)
    robot, search = request.robot, request.search
    search.colony()  # its faults are reported before kernels are compiled
    check_outputs(
        (args.path_out, args.xy_out, args.png, args.pheromone_png),
        [*map_sources(find_map(args.map)), *request.sources],
    )
    _check_together(args)
    if args.robots or args.robots_xy:
        from fasaco_edge.cli.fleet_wing import plan_fleet

        return plan_fleet(args, request)
    if args.passes is not None:
        from fasaco_edge.cli.planning.passes import plan_in_passes

        return plan_in_passes(args, request)
    if args.pheromone_png and (request.own or search.planner not in WITH_PHEROMONE):
        raise BadConfiguration(
            "--pheromone-png: the planner leaves no pheromone",
            hint=f"choose --planner {', '.join(WITH_PHEROMONE[:-1])} or {WITH_PHEROMONE[-1]}",
        )
    has_curves = robot.turn_radius_m > 0.0
    stages = stages_of_plan(search.planner, has_curves=has_curves)
    compile_kernels((*stages, ROOMS) if args.rooms else stages)
    # Imported only now, as these modules import the compiler.
    from fasaco_edge.offline.maps import load_map
    from fasaco_edge.offline.plan import plan

    map = load_map(args.map, resolution_m=args.resolution, unknown_free=args.unknown_free)
    require_frame(map, args.xy_out)
    if request.line != CELLS and (caution := tool_caution(robot)):
        LOG.warning("%s", caution)
    asked = Interrupt()
    counted = not search.has_local_search
    total = search.ants if counted else search.most_s
    # A user's own planner has no request to end: Ctrl-C interrupts it.
    on_ctrl_c = nullcontext() if request.own else first_signal_calls(signal.SIGINT, asked.asked.set)
    trails: deque[ColonySnapshot] = deque(maxlen=1)
    with on_ctrl_c, watching(total, counted=counted) as show:
        planned = plan(
            map,
            robot,
            start=args.start,
            start_xy=args.start_xy,
            end=args.end,
            line=request.line,
            align=args.align,
            search=search,
            planner=request.own,
            stop=asked,
            watch=show,
            observe=trails.append if args.pheromone_png else ignore,
        )
    swept, asked_share = planned.swept_share, search.swept
    if swept is not None and asked_share is not None and swept < asked_share:
        LOG.warning(
            "--swept %g: the line sweeps %.4f; a larger --budget may find one that sweeps more",
            asked_share,
            swept,
        )
    if planned.curve_figures is not None and (left := planned.curve_figures.spot_turns):
        LOG.warning(
            "%d turn%s not fit on arcs of %g m: the robot would turn on the spot there%s",
            left,
            "s do" if left > 1 else " does",
            robot.turn_radius_m,
            "" if robot.reverses else ", or drive backward: without --forward-only",
        )
    if args.path_out is not None:
        with writing(args.path_out) as file:
            np.savetxt(file, planned.cells, "%d", ",", header="row,col", comments="")
    if args.xy_out is not None:
        with writing(args.xy_out) as file:
            line, header = planned.xy, "x_m,y_m"
            if planned.curve is not None:
                line, header = planned.curve.poses, "x_m,y_m,yaw_rad"
            np.savetxt(file, line, "%.6f", ",", header=header, comments="")
    if args.png is not None:
        with writing(args.png) as file:
            planned.plot(file, rooms=args.rooms)
    if args.pheromone_png is not None:
        _draw_pheromone(args.pheromone_png, planned, trails)
    _print(args, planned)
    return Exit.INTERRUPTED if asked.asked.is_set() else Exit.OK


def _check_together(args: argparse.Namespace) -> None:
    """Refuse options that do not go together."""
    has_robots = args.robots or args.robots_xy
    if args.passes is not None and has_robots:
        raise BadConfiguration("--passes is for one robot, not with --robots and --robots-xy")
    if args.rooms and (args.passes is not None or has_robots):
        raise BadConfiguration("--rooms is for one pass of one robot, not with several")
    if args.rooms and Path(args.map).suffix == ".npy":
        raise BadConfiguration(
            "--rooms: a coverage grid shows no walls", hint="give a map_server .yaml or an image"
        )


def _draw_pheromone(file: Path, planned: Plan, trails: Sequence[ColonySnapshot]) -> None:
    from fasaco_edge.offline.result import pheromone_picture_of

    if not trails or trails[0].tau is None:
        raise BadConfiguration(
            f"{file}: the search ended before its first cohort of ants",
            hint="give it a larger --budget, or none",
        )
    with writing(file) as new:
        pheromone_picture_of(planned, trails[0].tau).save(new, "PNG")


def _print(args: argparse.Namespace, planned: Plan) -> None:
    """Print the figures as JSON, those that matter in some lines, or all as a table."""
    figures = planned.figures | {"map": str(args.map)}
    under = planned.rooms if args.rooms else None
    if under is not None:
        figures["rooms"] = [asdict(room) for room in under.rooms]
    if args.json:
        print_json(figures)
        return
    if args.long:
        figures["floor"] = planned.floor or "not known of a coverage grid"
        if planned.curve_figures is not None:
            figures["curve"] = planned.curve_figures
        rows = [(name.replace("_", " "), text) for name, text in terminal.known(figures)]
        terminal.out().print(terminal.figures(rows))
    else:
        from fasaco_edge.offline.summary import rows_of

        terminal.out().print(terminal.summary(rows_of(planned)))
    if under is not None:
        terminal.out().print(_table(under))
    say_written(args)


def _table(under: RoomsUnderLine) -> Table:
    """Return a table of the rooms."""
    from fasaco_edge.judge.floor import share_words

    table = Table(box=None, padding=(0, 2, 0, 0))
    for name in ("room", "floor", "swept", "entered"):
        table.add_column(name, justify="right", style="cyan" if name == "room" else "")
    for room in under.rooms:
        swept = "-" if room.swept_share is None else share_words(room.swept_share)
        often = {0: "never", 1: "once"}.get(room.entered, f"{room.entered} times")
        table.add_row(str(room.room), f"{room.area_m2:,.1f} m2", swept, often)
    return table


COMMAND = Command(
    description="Plan a walk over all cells that the robot can reach, and the line along it that "
    "it drives; print how good they are. Files are written only where an option names them.",
    run=run,
    add_options=add_options,
    epilog=EPILOG,
)
