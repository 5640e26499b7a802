"""The report of ``fasaco-edge review`` on a fleet: one screen, JSON, a picture."""

from __future__ import annotations

import argparse

import msgspec
from rich.table import Table

from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import writing
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.client.phrases import scale_words
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.fleet.review.report import FleetFigures, review_fleet
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.text import one_line, percent

# Options for the recording of one robot only.
ONE_ROBOT_OPTIONS = ("long", "at", "point", "against", "export")
HEADER = (
    "robot", "state", "busy", "waited", "swept", "through", "again", "driven m", "kB/s",
    "plan ms",
)  # fmt: skip


def print_fleet(args: argparse.Namespace) -> int:
    """Review a fleet's recording.

    Raises:
        BadConfiguration: an option is for the recording of one robot.
    """
    for name in ONE_ROBOT_OPTIONS:
        value = getattr(args, name)
        # Compared with None, as 0 is a valid time for --at.
        if value is not None and value is not False:
            raise BadConfiguration(
                f"--{name}: this is the recording of a fleet",
                hint="review the recording of one of its robots",
            )
    review = review_fleet(args.recordings)
    if args.json:
        print_json(msgspec.to_builtins(review.figures))
    else:
        _print(review.figures)
    if args.png:
        from fasaco_edge.fleet.review.drawing import draw_fleet_review

        with writing(args.png) as file:
            draw_fleet_review(review).save(file, "PNG")
    return 0


def _print(figures: FleetFigures) -> None:
    console = terminal.out()
    console.print(f"fleet {one_line(figures.fleet)}: {len(figures.robots)} robots", style="bold")
    if simulated := scale_words(figures.time_scale):
        console.print(f"{simulated}: times are by the robots' clocks")
    console.print(
        terminal.figures(
            [
                (
                    "makespan",
                    f"{clock(figures.makespan_s)} of {clock(figures.duration_s)} recorded",
                ),
                (
                    "balance",
                    f"{figures.busy_balance:.2f} by time at work, {figures.swept_balance:.2f} by "
                    "area swept (least / most)",
                ),
                (
                    "swept",
                    f"{figures.swept_m2:.1f} m2; of floor swept by another robot: "
                    f"{figures.again_m2:.1f} m2 swept again ({percent(figures.again_share)}), "
                    f"{figures.through_m2:.1f} m2 driven through",
                ),
                ("waited", f"{figures.waited_s:.0f} s in all"),
                ("divisions", str(figures.divisions)),
            ]
        )
    )
    table = Table(*HEADER, box=None, padding=(0, 1, 0, 0))
    for column in table.columns[2:]:
        column.justify = "right"
    for robot in figures.robots:
        plan = (
            "-"
            if robot.plan_ms_p99 is None
            else f"{robot.plan_ms_p50:.0f}, {robot.plan_ms_p99:.0f}"
        )
        waited = f"{robot.waits} x, {robot.waited_s:.0f} s" if robot.waits else "-"
        table.add_row(
            one_line(robot.name),
            one_line(robot.state),
            clock(robot.busy_s),
            waited,
            f"{robot.swept_m2:.1f}",
            f"{robot.through_m2:.1f}",
            f"{robot.again_m2:.1f}",
            f"{robot.driven_m:.0f}",
            f"{robot.kb_s:.1f} ({robot.peak_kb_s:.1f})",
            plan,
        )
    console.print(table)
    console.print(
        "swept [m2]; through, again [m2]: driven through, or swept again, after another robot had "
        "swept there. kB/s: messages to the fleet (in brackets the largest mean over 5 s). "
        "plan ms: median and 99 %, by the recorder's clock.",
        style="dim",
    )
