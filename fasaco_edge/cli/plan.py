"""``fasaco-edge plan``: an offline plan for a map or a coverage grid in a file."""

from __future__ import annotations

import argparse
import logging
import signal
from collections import deque
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fasaco_edge.cli.console.arguments import Exit, Subcommand, check_outputs
from fasaco_edge.cli.planning.options import EPILOG, add_options
from fasaco_edge.cli.planning.request import RequestedPlan, read_request, require_frame, watching
from fasaco_edge.cli.planning.results import print_plan, write_files
from fasaco_edge.cli.warmup import compile_kernels
from fasaco_edge.config.cautions import tool_caution
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.map_files import find_map, map_sources
from fasaco_edge.host.processes import first_signal_calls
from fasaco_edge.offline.settings import CELLS
from fasaco_edge.planners.passes import check_passes
from fasaco_edge.planners.planner import ColonySnapshot, Interrupt, ignore
from fasaco_edge.planners.stages import ROOMS, stages_of_plan

if TYPE_CHECKING:
    from fasaco_edge.offline.maps import Map
    from fasaco_edge.offline.passes import PassPlans
    from fasaco_edge.offline.result import Plan

LOG = logging.getLogger(__name__)

WITH_PHEROMONE = ("colony-search", "fasaco", "aco")


def run(args: argparse.Namespace) -> int:
    """Plan, print the figures, and write the requested files."""
    request = read_request(args)
    robot, search = request.robot, request.search
    search.colony()  # raises faults before kernels are compiled
    check_outputs(
        (args.path_out, args.xy_out, args.png, args.pheromone_png),
        [*map_sources(find_map(args.map)), *request.sources],
    )
    _check_together(args, request)
    stages = stages_of_plan(search.planner, has_curves=robot.turn_radius_m > 0.0)
    compile_kernels((*stages, ROOMS) if args.rooms else stages)
    # A late import, as it imports the compiler.
    from fasaco_edge.offline.maps import load_map

    map = load_map(args.map, resolution_m=args.resolution, unknown_free=args.unknown_free)
    require_frame(map, args.xy_out)
    if request.line != CELLS and (caution := tool_caution(robot)):
        LOG.warning("%s", caution)
    asked, trails = Interrupt(), deque[ColonySnapshot](maxlen=1)
    # A user's own planner cannot be asked to stop: Ctrl-C interrupts it.
    with nullcontext() if request.own else first_signal_calls(signal.SIGINT, asked.asked.set):
        planned = _plan(args, request, map, asked, trails)
    _warn(request, planned)
    write_files(args, planned, trails)
    print_plan(args, planned)
    return Exit.INTERRUPTED if asked.asked.is_set() else Exit.OK


def _check_together(args: argparse.Namespace, request: RequestedPlan) -> None:
    search = request.search
    if args.rooms and args.passes is not None:
        raise BadConfiguration("--rooms is for one pass, not for several")
    if args.rooms and Path(args.map).suffix == ".npy":
        raise BadConfiguration(
            "--rooms: a coverage grid shows no walls", hint="give a map_server .yaml or an image"
        )
    if args.passes is not None:
        check_passes(args.passes, "--passes")
        if not search.has_local_search:
            raise BadConfiguration(
                "--passes: only colony-search has passes", hint="leave --planner out"
            )
        if args.pheromone_png:
            raise BadConfiguration("--pheromone-png: each of several passes has a trail of its own")
    leaves_none = request.own or search.planner not in WITH_PHEROMONE
    if args.pheromone_png and leaves_none:
        raise BadConfiguration(
            "--pheromone-png: the planner leaves no pheromone",
            hint=f"choose --planner {', '.join(WITH_PHEROMONE[:-1])} or {WITH_PHEROMONE[-1]}",
        )


def _plan(
    args: argparse.Namespace,
    request: RequestedPlan,
    map: Map,
    asked: Interrupt,
    trails: deque[ColonySnapshot],
) -> Plan | PassPlans:
    from fasaco_edge.offline.passes import plan_passes
    from fasaco_edge.offline.plan import plan

    search = request.search
    counted = not search.has_local_search
    total = search.ants if counted else search.most_s
    given: dict[str, Any] = {
        "start": args.start,
        "start_xy": args.start_xy,
        "end": args.end,
        "line": request.line,
        "align": args.align,
        "search": search,
        "stop": asked,
    }
    if args.passes is not None:
        total = None if total is None else total * len(args.passes)
        with watching(total) as show:
            return plan_passes(map, request.robot, args.passes, watch=show, **given)
    observe = trails.append if args.pheromone_png else ignore
    with watching(total, counted=counted) as show:
        own = request.own
        return plan(map, request.robot, planner=own, watch=show, observe=observe, **given)


def _warn(request: RequestedPlan, planned: Plan | PassPlans) -> None:
    """Warn if the line sweeps less floor than requested, or has turns that fit on no arc."""
    floor, asked_share = planned.floor, request.search.swept
    if floor is None or floor.swept_share is None:
        return
    if asked_share is not None and floor.swept_share < asked_share:
        LOG.warning(
            "--swept %g: the line sweeps %.4f, and leaves %.2f m2; a larger --budget may find one "
            "that sweeps more, unless no line gets at the rest",
            asked_share,
            floor.swept_share,
            floor.reachable_m2 - floor.swept_m2,
        )
    if left := floor.spot_turns:
        LOG.warning(
            "%d turn%s not fit on arcs of %g m: the robot would turn on the spot there%s",
            left,
            "s do" if left > 1 else " does",
            request.robot.turn_radius_m,
            "" if request.robot.reverses else "; without --forward-only it may drive backward",
        )


COMMAND = Subcommand(
    description="Plan a walk over all cells that the robot can reach, and the line that it drives "
    "along this walk; print how good they are. Only files that an option names are written.",
    run=run,
    add_options=add_options,
    epilog=EPILOG,
)
