"""``fasaco-edge bench``: benchmarks, each of them a subcommand."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import closing
from typing import Any

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from fasaco_edge.bench.benchmark import Benchmark, Report, ResultTable, Sample, machine
from fasaco_edge.bench.daemon import DAEMON
from fasaco_edge.bench.planners import PLANNERS
from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.console.arguments import Exit, Subcommand, add_common, add_json
from fasaco_edge.cli.console.logs import report_error
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.host.processes import peak_mb

BENCHMARKS: tuple[Benchmark[Any], ...] = (PLANNERS, DAEMON)

# More columns than any table has.
MOST_COLUMNS = 10_000

EPILOG = """\
examples:
  fasaco-edge bench daemon                             is this computer fast enough?
  fasaco-edge bench planners --planner mine.py:walk    your planner beside the others

Each benchmark has --help, and prints a table, or JSON with --json. Ctrl-C interrupts it: it then
reports the measurements so far. Figures are medians with their range. Run benchmarks on an idle
machine.
"""


def add_benchmarks(
    parser: argparse.ArgumentParser, benchmarks: Sequence[Benchmark[Any]] = BENCHMARKS
) -> None:
    """Add each benchmark to ``parser`` as a subcommand."""
    parser.set_defaults(
        command=run, benchmark=None, usage=parser, log_level="warning", with_parent=None
    )
    commands = parser.add_subparsers(title="benchmarks", metavar="BENCHMARK")
    for benchmark in benchmarks:
        words = commands.add_parser(
            benchmark.name,
            help=benchmark.summary,
            description=benchmark.description,
            epilog=benchmark.epilog,
        )
        add_common(words)
        benchmark.add_options(words)
        add_json(words, "the figures")
        words.add_argument(
            "--check", action="store_true", help=f"exit with {Exit.ERROR:d} if a goal is missed"
        )
        words.set_defaults(benchmark=benchmark)


def run(args: argparse.Namespace) -> int:
    """Run a benchmark and report it; without one, list all."""
    if args.benchmark is None:
        args.usage.print_help()
        return 0
    samples, interrupted_in = _measure(args.benchmark, args)
    interrupted = interrupted_in is not None
    report: Report = args.benchmark.report(args, samples)
    if args.json:
        goals = [goal.document() for goal in report.goals]
        document = {
            "benchmark": args.benchmark.name,
            **report.figures,
            "peak_rss_mb": peak_mb(),
            "machine": machine(),
            "goals": goals,
            "interrupted": interrupted,
        }
        print_json(document)
    else:
        _print(report, interrupted_in)
    for fault in report.faults:
        report_error(fault)
    for file in args.benchmark.write(args, samples):
        terminal.err().print(f"wrote {file}")
    if interrupted:
        return Exit.INTERRUPTED
    missed = any(goal.met is False for goal in report.goals)
    return Exit.ERROR if report.faults or (args.check and missed) else Exit.OK


def _measure(
    benchmark: Benchmark[Sample], args: argparse.Namespace
) -> tuple[list[Sample], str | None]:
    """Return the samples, and the measurement that the user interrupted; None for none."""
    samples: list[Sample] = []
    present = benchmark.name
    with terminal.progress() as bar:
        task = bar.add_task(benchmark.name, total=benchmark.count(args))

        def say(what: str) -> None:
            nonlocal present
            present = what
            bar.update(task, description=what)

        try:
            with closing(benchmark.measure(args, say)) as measuring:
                for sample in measuring:
                    samples.append(sample)
                    bar.advance(task)
        except KeyboardInterrupt:
            return samples, present
    return samples, None


def _print(report: Report, interrupted_in: str | None) -> None:
    console = terminal.out()
    for shown in report.tables:
        _print_table(console, shown)
    if report.goals:
        console.print(_goals(report))
    for remark in report.remarks:
        console.print(remark, style="dim")
    if interrupted_in is not None:
        text = f"interrupted in {interrupted_in}; these are the measurements made until then"
        console.print(Text(text, "yellow"))


def _print_table(console: Console, shown: ResultTable) -> None:
    """Print a table; on a terminal too narrow for it, each row as a paragraph."""
    table = _table(shown.title)
    # Text keeps line breaks in a cell; the console escapes them in a plain string.
    first, *others = map(Text, shown.header)
    table.add_column(first, style="cyan", overflow="fold")
    for column in others:
        table.add_column(column, justify="right", overflow="fold")
    for row in shown.rows:
        table.add_row(*map(Text, row))
    # At a smaller width, words would be broken.
    options = console.options.update(max_width=MOST_COLUMNS)
    least = Measurement.get(console, options, table).minimum
    if console.is_terminal and least > console.width:
        console.print(Text(shown.title, "bold"))
        for row in shown.rows:
            figures = zip(shown.header[1:], row[1:], strict=True)
            words = ", ".join(f"{name} {value}" for name, value in figures)
            console.print(Text.assemble((row[0], "cyan"), f": {words}".replace("\n", " ")))
        return
    usual, console.width = console.width, max(console.width, least)
    console.print(table)
    console.width = usual


def _goals(report: Report) -> Table:
    verdicts: dict[bool | None, Text | str] = {
        True: Text("met", "green"),
        False: Text("missed", "red"),
        None: "not measured",
    }
    table = _table("goals of the default options")
    for column in ("", "measured", "goal", ""):
        table.add_column(column, justify="left" if column == "" else "right")
    for goal in report.goals:
        sign = "at least" if goal.at_least else "at most"
        measured = "-" if goal.measured is None else f"{goal.measured:.4g} {goal.unit}".strip()
        table.add_row(
            goal.what, measured, f"{sign} {goal.limit:g} {goal.unit}".strip(), verdicts[goal.met]
        )
    return table


def _table(title: str) -> Table:
    return Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        padding=(0, 0, 0, 1),
    )


COMMAND = Subcommand(
    description="Compare planners; or measure the daemon's memory, load and delays on this "
    "machine, and whether they meet their goals.",
    run=run,
    add_options=add_benchmarks,
    epilog=EPILOG,
    is_group=True,
)
