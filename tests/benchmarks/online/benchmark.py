"""``benchmarks online``: whole missions in buildings that the robot does not know."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from fasaco_edge.bench.benchmark import (
    Benchmark,
    Report,
    add_grid_options,
    grid_names,
    positive,
)
from tests.benchmarks.harness import SECONDS, within
from tests.benchmarks.online.buildings import BuildingChoice
from tests.benchmarks.online.contenders import CONTENDERS, DAEMON
from tests.benchmarks.online.judge import MissionRun
from tests.benchmarks.online.report import report
from tests.benchmarks.online.robot import Pace
from tests.benchmarks.online.runs import OnlinePlan, count, measure

DEFAULT_MAPS = ("office", "flat", "walled_grid", "basement", "warehouse")
# Sizes of buildings [cells]; a mission over many more takes days.
FEWEST_CELLS, MOST_CELLS = 1_000, 1_000_000
# Options that figures say of themselves.
CONDITIONS = (
    "starts", "ranges", "seeds", "cost", "turn_s", "speed_m_s", "proposals", "planners",
)  # fmt: skip


def _some(text: str) -> int:
    number = int(text)
    if number < 0:
        raise argparse.ArgumentTypeError(f"must be 0 or more, got {number}")
    return number


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument(
        "--generated",
        type=_some,
        default=0,
        metavar="N",
        help="number of synthetic buildings, in place of the default maps (default: 0)",
    )
    parser.add_argument(
        "--cells",
        type=within(FEWEST_CELLS, MOST_CELLS),
        default=5_000,
        help="cells of each synthetic building (default: %(default)s)",
    )
    parser.add_argument(
        "--planners",
        nargs="+",
        choices=CONTENDERS,
        default=[DAEMON],
        metavar="NAME",
        help="; ".join(f"{name}: {one.about}" for name, one in CONTENDERS.items())
        + "; figures and goals are for the first, a table compares all (default: %(default)s)",
    )
    _add_robot_options(parser)
    parser.add_argument(
        "--starts",
        type=positive,
        default=2,
        metavar="N",
        help="starts in each building: its own, then random ones (default: %(default)s)",
    )
    parser.add_argument(
        "--seeds",
        type=positive,
        default=1,
        metavar="N",
        help="use the planner's seeds 0 to N - 1 (default: %(default)s)",
    )
    parser.add_argument(
        "--proposals",
        type=positive,
        default=2_000_000,
        help="limit on the moves that a plan tries, in place of the daemon's time limit (default: "
        "%(default)s, about its 0.1 s)",
    )


def _add_robot_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--ranges",
        nargs="+",
        type=within(0.1, 100.0),
        default=[3.5, 8.0],
        metavar="M",
        help="range of the scanner, of 360 degrees [m] (default: 3.5 8)",
    )
    parser.add_argument(
        "--cost",
        choices=("steps", "turns"),
        default="steps",
        help="cost to minimise: steps alone, or time with turns (default: steps)",
    )
    parser.add_argument(
        "--turn-s",
        type=SECONDS,
        default=1.5,
        metavar="S",
        help="time of a quarter-turn [s] (default: %(default)g)",
    )
    parser.add_argument(
        "--speed-m-s",
        type=within(0.01, 10.0),
        default=0.25,
        metavar="V",
        help="speed straight on [m/s] (default: %(default)g)",
    )


def _plan(args: argparse.Namespace) -> OnlinePlan:
    names = grid_names(args, () if args.generated else DEFAULT_MAPS)
    return OnlinePlan(
        choice=BuildingChoice(names, args.generated, args.cells),
        starts=args.starts,
        ranges_m=tuple(dict.fromkeys(args.ranges)),
        seeds=args.seeds,
        pace=Pace(args.speed_m_s, args.turn_s),
        with_turns=args.cost == "turns",
        proposals=args.proposals,
        planners=tuple(dict.fromkeys(args.planners)),
    )


def _report(args: argparse.Namespace, runs: Sequence[MissionRun]) -> Report:
    about = {name: getattr(args, name) for name in CONDITIONS}
    return report(with_turns=args.cost == "turns", about=about, runs=runs)


ONLINE = Benchmark(
    name="online",
    summary="whole missions in unknown buildings, against plans on known maps",
    description="Send a simulated robot into unknown buildings. After every cell it scans, the "
    "real mission decides, the daemon's planner plans with counted work, and it drives on. There "
    "is no bus and no waiting for plans, so the same options give the same missions. A judge that "
    "shares no code with mission and planner compares every track with a near-optimal walk on the "
    "known map. A ratio of 1.015 is 1.5 % more.",
    add_options=_add_options,
    count=lambda args: count(_plan(args)),
    measure=lambda args, say: measure(_plan(args), say),
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks online
  python -m tests.benchmarks online --maps flat basement --ranges 3.5
  python -m tests.benchmarks online --grids *.npy --starts 3 --seeds 10 --json
  python -m tests.benchmarks online --generated 3 --cells 10000 --cost turns
  python -m tests.benchmarks online --planners fasaco fasaco-anew aco aco-anew spiral-stc zigzag
""",
)
