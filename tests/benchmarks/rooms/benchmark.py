"""``benchmarks rooms``: rooms found on maps of generated homes and offices, partly seen."""

from __future__ import annotations

import argparse
import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fasaco_edge.bench.benchmark import Benchmark, MeasuredGoal, Report, Say
from fasaco_edge.drawing.plot import Plot, PlotView
from fasaco_edge.drawing.tints import number_rooms, paint_rooms
from fasaco_edge.grid.rooms import ROOM_M2, find_rooms
from tests.benchmarks.harness import add_floors
from tests.benchmarks.rooms.homes import KINDS, RESOLUTION_M, home, seen
from tests.benchmarks.rooms.judge import Score, judge

SHARES = (1.0, 0.8, 0.5, 0.2)
GOAL_RECALL, GOAL_PRECISION, GOAL_MATTHEWS, GOAL_MS = 0.95, 0.95, 0.9, 200.0
HEADER = ("floor", "seen", "floors", "recall", "precision", "matthews", "true", "found", "ms/Mpx")

# Margin around a picture [m].
MARGIN_M = 0.3


@dataclass(frozen=True, slots=True)
class Found:
    """The rooms of one floor, seen in part.

    Attributes:
        kind: of the floor.
        share: of its free pixels that were seen.
        score: how well they were found.
        cpu_s: time on a processor [s].
        pixels: of the map.
    """

    kind: str
    share: float
    score: Score
    cpu_s: float
    pixels: int


def measure(kinds: Sequence[str], seeds: Sequence[int], pictures: Path | None) -> Generator[Found]:
    """Yield the rooms of each floor, at each share; draw them if asked for."""
    least = round(ROOM_M2 / RESOLUTION_M**2)
    for kind in kinds:
        for number in seeds:
            floor = home(kind, number)
            for share in SHARES:
                grid = seen(floor, share, number)
                start = time.process_time()
                rooms = find_rooms(grid)
                cpu_s = time.process_time() - start
                found = np.zeros(grid.cells.shape, np.int32)
                row, col = grid.geometry.corner_of(rooms.geometry)
                rows, cols = rooms.labels.shape
                found[row : row + rows, col : col + cols] = rooms.labels
                truth = np.where(grid.cells == 0, floor.rooms, 0)
                if pictures:
                    plot = Plot(PlotView.over(grid.geometry.bounds(), MARGIN_M))
                    plot.ground(grid)
                    paint_rooms(plot, rooms)
                    number_rooms(plot, rooms)
                    plot.finished().save(pictures / f"{floor.name}-{100 * share:.0f}.png")
                yield Found(kind, share, judge(truth, found, least), cpu_s, grid.cells.size)


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_floors(parser, 10)
    parser.add_argument(
        "--pictures", type=Path, metavar="DIR", help="draw each map with its rooms into a folder"
    )


def _measure(args: argparse.Namespace, say: Say) -> Generator[Found, None, None]:
    if args.pictures:
        args.pictures.mkdir(parents=True, exist_ok=True)
    # What is met for the first time is compiled, or read from the cache.
    find_rooms(home("home", 0).grid)
    say("finding rooms")
    yield from measure(KINDS, range(args.seed, args.seed + args.floors), args.pictures)


def _figures(kind: str, share: float, samples: Sequence[Found]) -> dict[str, Any]:
    scores = [sample.score for sample in samples]
    return {
        "kind": kind,
        "share": share,
        "floors": len(samples),
        "recall": round(float(np.mean([score.recall for score in scores])), 3),
        "precision": round(float(np.mean([score.precision for score in scores])), 3),
        "matthews": round(float(np.mean([score.matthews for score in scores])), 3),
        "true": round(float(np.mean([score.true for score in scores])), 1),
        "found": round(float(np.mean([score.found for score in scores])), 1),
        "ms_per_mpx": round(
            1e9 * float(np.median([sample.cpu_s / sample.pixels for sample in samples])), 1
        ),
    }


def _report(args: argparse.Namespace, samples: Sequence[Found]) -> Report:
    groups = dict.fromkeys((sample.kind, sample.share) for sample in samples)
    figures = [
        _figures(*group, [one for one in samples if (one.kind, one.share) == group])
        for group in groups
    ]
    worst = {
        name: min(group[name] for group in figures) for name in ("recall", "precision", "matthews")
    }
    slowest = max(group["ms_per_mpx"] for group in figures)
    return Report(
        title="rooms found, against those drawn",
        header=HEADER,
        rows=tuple(
            (
                group["kind"], f"{100 * group['share']:.0f} %", str(group["floors"]),
                *(f"{group[name]:.3f}" for name in ("recall", "precision", "matthews")),
                f"{group['true']:.1f}", f"{group['found']:.1f}", f"{group['ms_per_mpx']:.0f}",
            )
            for group in figures
        ),
        figures={"rooms": figures},
        goals=(
            MeasuredGoal("worst recall", worst["recall"], GOAL_RECALL, at_least=True),
            MeasuredGoal("worst precision", worst["precision"], GOAL_PRECISION, at_least=True),
            MeasuredGoal(
                "worst Matthews coefficient", worst["matthews"], GOAL_MATTHEWS, at_least=True
            ),
            MeasuredGoal("time for 10^6 pixels", slowest, GOAL_MS, "ms"),
        ),
        remarks=("true, found: rooms of at least 1.5 m2 on each floor; time on a processor",),
    )  # fmt: skip


ROOMS = Benchmark(
    name="rooms",
    summary="rooms found on generated homes and offices, partly seen",
    description="Find the rooms of generated homes and offices with furniture, and walls at any "
    "angle, after a scanner has seen 100, 80, 50 and 20 % of their floor. Compare them with the "
    "true rooms: recall and precision (Bormann et al. 2016), Matthews coefficient (MAORIS, 2017).",
    add_options=_add_options,
    count=lambda args: len(KINDS) * len(SHARES) * int(args.floors),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks rooms
  python -m tests.benchmarks rooms --seed 100 --floors 5 --pictures /tmp/rooms --json
""",
)
