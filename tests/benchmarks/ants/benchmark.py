"""``benchmarks ants``: worth of the ants, and of their trail, in repairs and in spare time."""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import asdict
from typing import NamedTuple

from fasaco_edge.bench.benchmark import (
    Benchmark,
    MeasuredGoal,
    Report,
    ResultTable,
    Say,
    add_grid_options,
    grid_names,
    positive,
    seconds_above_zero,
)
from fasaco_edge.planners.grids import read_grid
from tests.benchmarks.ants.moments import (
    FIRST,
    FIRST_BUDGETS_S,
    FIRST_TURN,
    FLAT,
    LARGE,
    LARGE_CELLS,
    LIVING,
    NEW,
    NONE,
    REPAIR,
    REST,
    SPOT,
    VARIANTS,
    MomentsPlan,
    Replay,
    measure,
    variants_of,
)
from tests.benchmarks.harness import check_names, within
from tests.benchmarks.online.buildings import BuildingChoice

DEFAULT_MAPS = ("flat", "office", "basement")
GENERATED_CELLS = 1_000
# Goals: cost of a variant to that without ants; share of ants in what spare time saves.
GOALS = ((REPAIR, LIVING, 0.997), (LARGE, NEW, 0.997), (FIRST, NEW, 0.98))
LEAST_SHARE_OF_ANTS = 1 / 3
# Variants whose costs are compared.
PAIRS = ((LIVING, NONE), (NEW, NONE), (FLAT, NONE), (LIVING, NEW), (LIVING, FLAT))


class Ratio(NamedTuple):
    """A ratio of two sums, and its standard error, clustered by building; NaN for one building."""

    value: float
    error: float

    def __str__(self) -> str:
        error = "" if math.isnan(self.error) else f" ± {self.error:.4f}"
        return f"{self.value:.4f}{error}"


def ratio(parts: Sequence[tuple[str, float, float]]) -> Ratio | None:
    """Return the ratio of two sums over parts: building, numerator, denominator; None for 0 / 0."""
    below = sum(part[2] for part in parts)
    if not below:
        return None
    value = sum(part[1] for part in parts) / below
    residuals: dict[str, float] = {}
    for place, over, under in parts:
        residuals[place] = residuals.get(place, 0.0) + over - value * under
    count = len(residuals)
    if count < 2:
        return Ratio(value, math.nan)
    spread = sum(one**2 for one in residuals.values()) * count / (count - 1)
    return Ratio(value, math.sqrt(spread) / below)


def _cost(replays: Sequence[Replay], one: str, other: str) -> Ratio | None:
    """Return the mean cost of one variant over that of another."""
    answered = [each for each in replays if {one, other} <= set(each.answers)]
    costs = ((each, each.answers[one].cost_s, each.answers[other].cost_s) for each in answered)
    return ratio([(each.place, this_s / that_s, 1.0) for each, this_s, that_s in costs])


def _share_of_ants(attempts: Sequence[Replay], variant: str) -> Ratio | None:
    answers = ((each.place, each.answers[variant]) for each in attempts)
    return ratio(
        [(place, one.by_ants_s, one.by_ants_s + one.by_search_s) for place, one in answers]
    )


def _saved_to_none(attempts: Sequence[Replay], variant: str) -> Ratio | None:
    both = ((each.place, each.answers[variant], each.answers[NONE]) for each in attempts)
    return ratio([(place, one.saved_s, other.saved_s) for place, one, other in both])


def report(args: argparse.Namespace, replays: Sequence[Replay]) -> Report:
    """Sum up any number of moments, even none."""
    kinds = dict.fromkeys(one.kind for one in replays)
    by_kind = {kind: [one for one in replays if one.kind == kind] for kind in kinds}
    attempts = [one for one in replays if one.kind in {SPOT, REST}]
    spare = {kind: some for kind, some in by_kind.items() if kind in {SPOT, REST}}
    return Report(
        title=f"cost of a variant over that of another, {args.cost}",
        header=("", "plans", *(f"{one} / {other}" for one, other in PAIRS)),
        rows=tuple(
            (kind, str(len(some)), *(_text(_cost(some, *pair)) for pair in PAIRS))
            for kind, some in by_kind.items()
        ),
        figures={"cost": args.cost, "replays": [asdict(one) for one in replays]},
        goals=tuple(_goals(by_kind, attempts)),
        remarks=(
            "living: ants on the mission's trail; new: on a trail that is uniform at first; flat: "
            "on one that stays uniform; none: without ants. Means, with standard errors clustered "
            "by building. Repairs end by themselves; an attempt takes the processor time that a "
            f"mission gives it, a search of a very large lattice {args.large_s:g} s.",
            "saved: on the present walk; taken: the same of attempts for which a mission changes "
            "its path. by ants: their share of what is saved on the search's first walk. first "
            "walk: by the paper's colony, and by searches from it, over simple walks, and searches "
            "from these.",
        ),
        further=(
            ResultTable(
                "seconds saved in spare time",
                ("", "trail", "attempts", "saved [s]", "to none", "by ants", "taken [s]"),
                tuple(
                    (kind, *row)
                    for kind, some in (spare | {"all attempts": attempts}).items()
                    if some
                    for row in _spare_rows(some)
                ),
            ),
            ResultTable(
                "work of a plan, means",
                ("", "trail", "ants", "proposals", "processor [ms]"),
                tuple(
                    (kind, *row) for kind, some in by_kind.items() for row in _work_rows(kind, some)
                ),
            ),
        ),
    )


def _spare_rows(attempts: Sequence[Replay]) -> Iterator[tuple[str, ...]]:
    for variant in VARIANTS:
        answers = [one.answers[variant] for one in attempts]
        yield (
            variant,
            str(len(answers)),
            f"{sum(one.saved_s for one in answers):.1f}",
            _text(_saved_to_none(attempts, variant)),
            _text(_share_of_ants(attempts, variant)),
            f"{sum(one.taken_s for one in answers):.1f}",
        )


def _work_rows(kind: str, replays: Sequence[Replay]) -> Iterator[tuple[str, ...]]:
    for variant in variants_of(kind):
        answers = [one.answers[variant] for one in replays]
        yield (
            variant,
            f"{statistics.fmean(one.ants for one in answers):,.0f}",
            f"{statistics.fmean(one.proposals for one in answers):,.0f}",
            f"{1e3 * statistics.fmean(one.processor_s for one in answers):.1f}",
        )


def _goals(by_kind: dict[str, list[Replay]], attempts: Sequence[Replay]) -> Iterator[MeasuredGoal]:
    for kind, variant, most in GOALS:
        if kind in by_kind:
            cost = _value(_cost(by_kind[kind], variant, NONE))
            yield MeasuredGoal(f"{kind}: cost with ants to without", cost, most)
    if attempts:
        least: tuple[tuple[str, Callable[[Sequence[Replay], str], Ratio | None], float], ...] = (
            ("share of ants", _share_of_ants, LEAST_SHARE_OF_ANTS),
            ("with ants to without", _saved_to_none, 1.0),
        )
        for what, measured, limit in least:
            value = _value(measured(attempts, LIVING))
            yield MeasuredGoal(f"saved in spare time: {what}", value, limit, at_least=True)


def _value(found: Ratio | None) -> float | None:
    return None if found is None else round(found.value, 4)


def _text(found: Ratio | None) -> str:
    return "-" if found is None else str(found)


def _names(args: argparse.Namespace) -> tuple[str, ...]:
    return grid_names(args, () if args.generated or args.large else DEFAULT_MAPS)


def _plan_of(args: argparse.Namespace) -> MomentsPlan:
    names = _names(args)
    check_names(names)
    return MomentsPlan(
        choice=BuildingChoice(() if args.first else names, args.generated, GENERATED_CELLS),
        missions=args.missions,
        most={REPAIR: args.moments, SPOT: args.moments, REST: args.rests},
        seeds=args.seeds,
        with_turns=args.cost == "turns",
        large=args.large,
        large_s=args.large_s,
        first=[read_grid(name) for name in names] if args.first else (),
    )


def _measure(args: argparse.Namespace, say: Say) -> Generator[Replay, None, None]:
    yield from measure(_plan_of(args), say)


def _count(args: argparse.Namespace) -> int:
    names = len(_names(args))
    first, missions = (names, 0) if args.first else (0, names)
    moments = (missions + args.generated) * (2 * args.moments + args.rests)
    return int(args.seeds * (first * (1 + len(FIRST_BUDGETS_S)) + moments + args.large))


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_grid_options(parser, DEFAULT_MAPS)
    parser.add_argument(
        "--cost", choices=("steps", "turns"), default="turns", help="(default: turns)"
    )
    for name, default, what in (
        ("--missions", 1, "missions in each building, from different starts"),
        ("--moments", 40, "most repairs, and most attempts around spots, in each building"),
        ("--rests", 8, "most attempts at the whole rest in each building"),
        ("--seeds", 2, "answers of each variant to each moment"),
    ):
        parser.add_argument(
            name, type=positive, default=default, metavar="N", help=f"{what} (default: {default})"
        )
    for name, what in (
        ("--generated", f"buildings of {GENERATED_CELLS:,} cells, in place of the default maps"),
        ("--large", f"known buildings of {LARGE_CELLS:,} cells, in place of the default maps"),
    ):
        parser.add_argument(
            name, type=within(0, 1000), default=0, metavar="N", help=f"{what} (default: 0)"
        )
    parser.add_argument(
        "--first", action="store_true",
        help="first walks over known maps and grids, in place of missions there; a quarter-turn "
        f"costs {FIRST_TURN:g} steps",
    )  # fmt: skip
    parser.add_argument(
        "--large-s", type=seconds_above_zero, default=20.0, metavar="S",
        help="processor time of a search of a very large lattice [s] (default: %(default)g)",
    )  # fmt: skip


ANTS = Benchmark(
    name="ants",
    summary="worth of ants and of their trail in repairs and in spare time",
    description="Record what missions ask their planner for: repairs, and attempts at a better "
    "path in spare time. Plan each again with ants on the mission's trail, on a new one, on a flat "
    "one, and without ants; compare cost and seconds saved.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=report,
    epilog="""\
examples:
  python -m tests.benchmarks ants
  python -m tests.benchmarks ants --maps flat office --generated 3 --seeds 4 --json
  python -m tests.benchmarks ants --large 2 --seeds 1
  python -m tests.benchmarks ants --first --maps flat office --grids *.npy
""",
)
