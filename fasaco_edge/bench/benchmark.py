"""Benchmark: options, samples one by one, and a report on any number of them.

To add a benchmark, write a file that ends with a ``Benchmark``, and add it to ``BENCHMARKS`` in
``fasaco_edge.cli.bench`` or ``tests.benchmarks.__main__``. A benchmark that a user interrupts
reports on the samples so far.
"""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Callable, Generator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from fasaco_edge import __version__
from fasaco_edge.errors import FasacoError
from fasaco_edge.planners.own.loading import SHAPE, is_place

Sample = TypeVar("Sample")

# Shows in a few words what is measured.
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class MeasuredGoal:
    """A limit and the measured value, in the same ``unit``.

    Attributes:
        what: name of the measured value.
        measured: the measured value; None if nothing was measured.
        limit: the largest good value, or the least one if ``at_least``.
        unit: "s", "MB", ...; "" for a plain number.
        at_least: whether more is better.
    """

    what: str
    measured: float | None
    limit: float
    unit: str = ""
    at_least: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the goal was reached; None if nothing was measured."""
        if self.measured is None:
            return None
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit

    def document(self) -> dict[str, object]:
        """Return this as JSON values."""
        return {**asdict(self), "met": self.met}


@dataclass(frozen=True, slots=True)
class ResultTable:
    """A title, the columns' names, and rows of as many cells as there are columns."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Report:
    """Results, for people and for machines.

    Attributes:
        title, header, rows: the first table, see ``ResultTable``.
        figures: the results as JSON values.
        goals: the goals, with the measured values.
        remarks: sentences below the table.
        further: tables after the first.
        faults: errors that ended single measurements; the tables hold the others.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    figures: dict[str, Any]
    goals: tuple[MeasuredGoal, ...] = ()
    remarks: tuple[str, ...] = ()
    further: tuple[ResultTable, ...] = ()
    faults: tuple[FasacoError, ...] = ()

    @property
    def tables(self) -> tuple[ResultTable, ...]:
        """All tables, in order."""
        return (ResultTable(self.title, self.header, self.rows), *self.further)


@dataclass(frozen=True, slots=True)
class Benchmark(Generic[Sample]):
    """One benchmark of ``fasaco-edge bench``.

    Attributes:
        name: its name on the command line.
        summary: what it measures, in one line.
        description: what it does, and how to read the result.
        add_options: declares its options.
        count: returns the number of samples that ``measure`` will yield.
        measure: yields samples; it releases its resources even if it is closed early.
        report: returns the report on the samples so far, of which there may be none.
        epilog: examples.
        write: writes the files that the options request, and returns their names.
    """

    name: str
    summary: str
    description: str
    add_options: Callable[[argparse.ArgumentParser], None]
    count: Callable[[argparse.Namespace], int]
    measure: Callable[[argparse.Namespace, Say], Generator[Sample, None, None]]
    report: Callable[[argparse.Namespace, Sequence[Sample]], Report]
    epilog: str = ""
    write: Callable[[argparse.Namespace, Sequence[Sample]], tuple[Path, ...]] = lambda *_: ()


def positive(text: str) -> int:
    """Read a whole number above zero."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"must be 1 or more, got {number}")
    return number


def seconds_above_zero(text: str) -> float:
    """Read a time [s] above 0, up to an hour."""
    number = float(text)
    if not 0.0 < number <= 3600.0:
        raise argparse.ArgumentTypeError(f"must be above 0, and at most 3600 s, got {text}")
    return number


def add_grid_options(parser: argparse.ArgumentParser, default_maps: tuple[str, ...]) -> None:
    """Declare ``--grids`` and ``--maps``."""
    parser.add_argument(
        "--grids",
        nargs="+",
        action="extend",
        default=[],
        metavar="FILE.npy",
        help="coverage grids (bool, True = free); FILE.json beside one may name "
        'the start: {"start": [row, col]}',
    )
    parser.add_argument(
        "--maps",
        nargs="+",
        action="extend",
        default=[],
        metavar="MAP",
        help="map_server YAMLs or names from `maps`, in cells of 0.3 m for a robot of 0.18 m "
        f"radius (default, without --grids: {' '.join(default_maps)})",
    )


def add_own_planners(parser: argparse.ArgumentParser) -> None:
    """Declare ``--planner``."""
    parser.add_argument(
        "--planner",
        nargs="+",
        action="extend",
        type=_place,
        default=[],
        metavar="PLACE",
        help=f"planners of your own, {SHAPE}, as rows beside the others; they run with your "
        "rights, see fasaco_edge/researcher.md",
    )


def _place(text: str) -> str:
    if not is_place(text):
        raise argparse.ArgumentTypeError(f"must be {SHAPE}, got {text!r}")
    return text


def grid_names(args: argparse.Namespace, default_maps: tuple[str, ...]) -> tuple[str, ...]:
    """Return the requested grids and maps, or else the default maps."""
    return (*args.grids, *args.maps) or default_maps


def machine() -> dict[str, object]:
    """Return processor, cores, load, Python and package version as JSON values."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "load_1min": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "version": __version__,
    }


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        name, _, value = line.partition(":")
        if name.strip() in ("model name", "Model"):
            return value.strip()
    return platform.machine()
