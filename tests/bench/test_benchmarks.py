"""Each benchmark runs, small, and says what it promises."""

import argparse
import json
import signal
from dataclasses import replace

import pytest
from rich.console import Console

from fasaco_edge.bench.benchmark import Benchmark, MeasuredGoal, Report
from fasaco_edge.cli import bench, main
from fasaco_edge.cli.bench import BENCHMARKS

MACHINE = {"processor", "cores", "load_1min", "python", "version"}


def figures(capsys, *words):
    code = main(["bench", *words, "--json"])
    said = capsys.readouterr()
    assert code == 0, said.err
    document = json.loads(said.out)
    assert document["benchmark"] == words[0]
    assert document["interrupted"] is False
    assert set(document["machine"]) == MACHINE
    assert document["peak_rss_mb"] > 10
    return document


def assert_ordered(spread):
    assert 0 < spread["low"] <= spread["median"] <= spread["high"]


def test_the_benchmark_of_the_daemon_reports_its_figures(capsys):
    document = figures(capsys, "daemon", "--starts", "1", "--maps", "2", "--load", "1")
    assert (document["starts"], document["maps"]) == (1, 2)
    for name in ("ready_s", "status_s", "idle_mb", "idle_percent", "peak_mb"):
        assert_ordered(document[name])
    assert document["ready_s"]["median"] <= document["status_s"]["median"]
    # Memory does not depend on how busy the machine is. Where scipy is installed, as for the lab,
    # numba imports it: 8 MB.
    for point, most_mb in (("idle", 32.0), ("warm", 145.0)):
        own_mb, resident_mb = (document[f"{point}{of}_mb"]["median"] for of in ("_own", ""))
        assert 5.0 < own_mb <= min(most_mb, resident_mb)
    assert document["idle_mb"]["median"] < document["warm_mb"]["median"]
    assert document["warm_mb"]["median"] <= document["peak_mb"]["median"]
    for name in ("total_ms", "plan_ms", "rest_ms"):
        delay = document[name]
        assert 0 < delay["min"] <= delay["p50"] <= delay["p99"] <= delay["max"]
    assert document["plan_ms"]["p50"] < document["total_ms"]["p50"]
    assert [goal["limit"] for goal in document["goals"]] == [1.5, 32.0, 0.5, 135.0, 20.0]


def counting(upto, interrupt_at=None):
    """A benchmark of numbers; the user loses patience at one of them."""
    closed = []

    def measure(args, say):
        try:
            for number in range(upto):
                if number == interrupt_at:
                    signal.raise_signal(signal.SIGINT)
                yield number
        finally:
            closed.append(True)

    def report(args, samples):
        rows = tuple((f"[{sample}]", "x") for sample in samples)
        goals = (MeasuredGoal("count", float(len(samples)), 2.0, at_least=True),)
        return Report("numbers [n]", ("n", "of [n]"), rows, {"n": len(samples)}, goals)

    benchmark = Benchmark("numbers", "", "", lambda _: None, lambda _: upto, measure, report)
    return benchmark, closed


@pytest.fixture
def ctrl_c():
    """Ctrl-C as a terminal's process gets it, also where this one was started without one."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def run(benchmark, **options):
    given = {"json": False, "check": False, **options}
    return bench.run(argparse.Namespace(benchmark=benchmark, **given))


@pytest.mark.usefixtures("ctrl_c")
def test_interrupted_benchmark_prints_what_it_has(capsys):
    benchmark, closed = counting(5, interrupt_at=3)
    assert run(benchmark, json=True) == 130
    document = json.loads(capsys.readouterr().out)
    assert (document["n"], document["interrupted"]) == (3, True)
    assert closed == [True]


@pytest.mark.usefixtures("ctrl_c")
def test_table_shows_brackets_and_the_interruption(capsys):
    benchmark, _ = counting(2, interrupt_at=1)
    assert run(benchmark) == 130
    shown = capsys.readouterr().out
    for words in ("numbers [n]", "of [n]", "[0]", "missed", "interrupted"):
        assert words in shown


def test_wide_tables_keep_words_whole(capsys, monkeypatch):
    names = [f"figure{number}" for number in range(20)]
    wide = Report("wide", ("map", *names), (("flat", *["0.125\n(0-1)"] * 20),), {})
    benchmark, _ = counting(1)
    benchmark = replace(benchmark, report=lambda args, samples: wide)
    for is_terminal in (False, True):
        monkeypatch.setattr(Console, "is_terminal", is_terminal)
        assert run(benchmark) == 0
        shown = capsys.readouterr().out
        assert all(name in shown for name in names)
        assert shown.count("0.125") == 20
        # A range is below its median in a table, beside it in a paragraph.
        assert len(shown.splitlines()) < 20
        assert (max(map(len, shown.splitlines())) <= 80) is is_terminal


@pytest.mark.parametrize(("samples", "code"), [(1, 1), (2, 0)])
def test_missed_goal_fails_only_a_check(samples, code, capsys):
    benchmark, _ = counting(samples)
    assert run(benchmark, check=True) == code
    assert run(benchmark) == 0
    capsys.readouterr()


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda benchmark: benchmark.name)
def test_report_on_nothing_measured(benchmark):
    parser = argparse.ArgumentParser()
    benchmark.add_options(parser)
    report = benchmark.report(parser.parse_args([]), [])
    assert all(goal.met is None for goal in report.goals)
    json.dumps(report.figures, allow_nan=False)


@pytest.mark.parametrize(
    "words", ["--starts 0", "--maps -1", "--maps nan", "--load 0", "--load 3601"]
)
def test_impossible_options_are_refused(words, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["bench", "daemon", *words.split()])
    assert words.split()[0] in capsys.readouterr().err
