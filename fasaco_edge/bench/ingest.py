"""``bench ingest``: from a map, or a map update, to what it changes of the lattice."""

from __future__ import annotations

import argparse
from collections.abc import Generator, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from fasaco_edge.bench.benchmark import Benchmark, Goal, Report, Say, positive
from fasaco_edge.bench.machine import machine, peak_mb
from fasaco_edge.bench.spread import percentile

if TYPE_CHECKING:
    from fasaco_edge.bench.ingest_runs import Ingest

DEFAULT_SIDES = (1024, 4000)
LEAST_SIDE, MOST_SIDE = 400, 8000
CASES = 4
# Of maps of which hardly anything has changed.
GOAL_SIDE, GOAL_SHARE, GOAL_MS = 1024, 0.01, 10.0
HEADER = ("side", "came as", "changed", "cells", "decode", "change", "p99", "anew", "ratio", "same")


def _side(text: str) -> int:
    side = int(text)
    if not LEAST_SIDE <= side <= MOST_SIDE:
        raise argparse.ArgumentTypeError(f"must be in {LEAST_SIDE}..{MOST_SIDE}, got {text}")
    return side


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--sides",
        nargs="+",
        type=_side,
        default=list(DEFAULT_SIDES),
        metavar="PIXELS",
        help=f"edge of the map (default: {' '.join(map(str, DEFAULT_SIDES))})",
    )
    parser.add_argument(
        "--repeats", type=positive, default=40, help="maps of each kind (default: %(default)s)"
    )


def _sides(args: argparse.Namespace) -> list[int]:
    return list(dict.fromkeys(args.sides))


def _measure(args: argparse.Namespace, say: Say) -> Generator[Ingest, None, None]:
    # Here, so that to list the benchmarks does not load the compiler.
    from fasaco_edge.bench.ingest_runs import measure  # noqa: PLC0415

    return measure(_sides(args), args.repeats, say)


def _report(args: argparse.Namespace, samples: Sequence[Ingest]) -> Report:
    kinds = dict.fromkeys((sample.side, sample.case) for sample in samples)
    figures = [
        _figures([sample for sample in samples if (sample.side, sample.case) == kind])
        for kind in kinds
    ]
    return Report(
        title="from a decoded message to what it changes [ms]",
        header=HEADER,
        rows=tuple(_row(kind) for kind in figures),
        figures={"maps": figures, "peak_rss_mb": peak_mb(), "machine": machine()},
        goals=tuple(_goals(figures)),
        remarks=(
            "side: of the map [pixels]; changed: share of them, and how many cells; change: median "
            "and 99th percentile; anew: the lattice of the whole map from nothing; same: whether "
            "both are, bit for bit",
            f"peak memory of this process {peak_mb()} MB",
        ),
    )


def _figures(samples: Sequence[Ingest]) -> dict[str, Any]:
    first = samples[0]
    return {
        "side": first.side,
        "case": first.case,
        "samples": len(samples),
        "changed": round(max(sample.changed for sample in samples), 6),
        "cells": max(sample.cells for sample in samples),
        "decode_ms": _ms([sample.decode_ms for sample in samples], 50.0),
        "change_ms": _ms([sample.change_ms for sample in samples], 50.0),
        "change_p99_ms": _ms([sample.change_ms for sample in samples], 99.0),
        "whole_ms": _ms([sample.whole_ms for sample in samples], 50.0),
        "same": all(sample.same for sample in samples),
    }


def _row(kind: dict[str, Any]) -> tuple[str, ...]:
    return (
        str(kind["side"]),
        kind["case"],
        f"{100.0 * kind['changed']:.3g} %",
        str(kind["cells"]),
        *(f"{kind[name]:.2f}" for name in ("decode_ms", "change_ms", "change_p99_ms", "whole_ms")),
        f"{kind['whole_ms'] / kind['change_ms']:.1f}",
        "yes" if kind["same"] else "NO",
    )


def _goals(figures: Sequence[dict[str, Any]]) -> Iterator[Goal]:
    for kind in figures:
        if kind["side"] == GOAL_SIDE and kind["changed"] < GOAL_SHARE:
            what = f"p99 of a {kind['case']}, {GOAL_SIDE} x {GOAL_SIDE}"
            yield Goal(what, kind["change_p99_ms"], GOAL_MS, "ms")


def _ms(values: Sequence[float], percent: float) -> float:
    value = percentile(values, percent)
    assert value is not None
    return round(value, 3)


INGEST = Benchmark(
    name="ingest",
    summary="from a map, or a map update, to the change window",
    description="Take in maps of a building in which a crate moves: as an update of a part, as a "
    "full map, as one that has grown on all sides by whole pixels, and as one that has moved by "
    "part of a pixel, as after a loop closure. Time what it takes from the decoded message to the "
    "new lattice and the cells that changed, and beside it the lattice of the whole map, made "
    "from nothing. Pixels of 5 cm, cells of 30 cm.",
    add_options=_add_options,
    count=lambda args: len(_sides(args)) * int(args.repeats) * CASES,
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  fasaco-edge bench ingest
  fasaco-edge bench ingest --sides 1024 --repeats 200 --json
""",
)
