"""Each benchmark runs, small, and says what it promises."""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from fasaco_edge.bench import processes as placement
from fasaco_edge.bench.benchmark import Benchmark, Goal, Report
from fasaco_edge.cli import bench, main
from fasaco_edge.cli.bench import BENCHMARKS
from fasaco_edge.host.processes import cpu_seconds

MACHINE = {"processor", "cores", "load_1min", "python", "version"}
CHECKOUT = Path(__file__).parents[2]


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


def test_speed(capsys, tmp_path):
    file = tmp_path / "room.npy"
    np.save(file, np.ones((7, 9), bool))
    file.with_suffix(".json").write_text('{"start": [3, 4]}')
    options = ["--ants", "40", "--repeats", "2", "--return-home"]
    words = ["--grids", str(file), "--maps", "office", *options]
    document = figures(capsys, "speed", *words)
    assert [grid["grid"] for grid in document["grids"]] == [str(file), "office"]
    for grid in document["grids"]:
        assert_ordered(grid["wall_s"])
        assert_ordered(grid["cpu_s"])
        assert (grid["ants"], grid["repeats"]) == (40, 2)
        # Home again: every walk over a grid takes an even number of steps.
        assert grid["steps"] % 2 == 0
        assert grid["steps"] >= grid["cells"] - 1
        assert grid["ants_per_s"] == pytest.approx(40 / grid["wall_s"]["median"], rel=1e-2)
        assert grid["parallel"]["threads"] == 2
        assert grid["parallel"]["same_walk"] is True
    assert document["grids"][0]["cells"] == 63


def test_speed_goals_are_those_of_a_thousand_ants(capsys):
    document = figures(capsys, "speed", "--maps", "office", "--repeats", "1")
    (goal,) = document["goals"]
    assert (goal["limit"], goal["unit"], goal["at_least"]) == (0.25, "s", False)
    assert goal["measured"] == pytest.approx(document["grids"][0]["wall_s"]["median"], abs=1e-3)


def test_speed_needs_no_checkout(tmp_path):
    """As in a wheel: no tests, no project file, maps inside the package."""
    shutil.copytree(
        CHECKOUT / "fasaco_edge",
        tmp_path / "fasaco_edge",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    shutil.copytree(CHECKOUT / "maps", tmp_path / "fasaco_edge" / "_share" / "maps")
    words = ["bench", "speed", "--maps", "office", "--ants", "8", "--repeats", "1"]
    result = subprocess.run(
        [sys.executable, "-m", "fasaco_edge", *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_DISABLE_JIT": "1", "COLUMNS": "120"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "office" in result.stdout


def test_footprint(capsys):
    words = ("--starts", "1", "--settle", "0.1", "--idle", "1", "--mission", "1", "--ants", "8")
    document = figures(capsys, "footprint", *words)
    assert document["starts"] == 1
    for name in (
        "ready_s",
        "status_s",
        "idle_mb",
        "idle_percent",
        "warm_mb",
        "mission_percent",
        "peak_mb",
    ):
        assert_ordered(document[name])
    assert document["ready_s"]["median"] <= document["status_s"]["median"]
    # Memory does not depend on how busy the machine is. Where scipy is installed, as for the lab,
    # numba imports it: 8 MB.
    for point, most_mb in (("idle", 32.0), ("warm", 145.0)):
        own_mb, resident_mb = (document[f"{point}{of}_mb"]["median"] for of in ("_own", ""))
        assert 5.0 < own_mb <= min(most_mb, resident_mb)
    assert document["idle_mb"]["median"] < document["warm_mb"]["median"]
    assert document["warm_mb"]["median"] <= document["peak_mb"]["median"]
    assert document["loaded"]["warm"] == {"numba": True, "rerun": False}
    assert document["loaded"]["idle"]["rerun"] is False
    assert [goal["limit"] for goal in document["goals"]] == [1.5, 32.0, 0.5, 135.0, 2.0, 0.0]


def test_jitter(capsys):
    document = figures(capsys, "jitter", "--rounds", "1", "--block", "1.5")
    cases = {(case["place"], case["covering"]): case for case in document["cases"]}
    assert list(cases) == [
        ("on all cores", False),
        ("on all cores", True),
        ("on one core", False),
        ("on one core", True),
    ]
    for (_, covering), case in cases.items():
        late_us = case["late_us"]
        assert case["ticks"] == 150
        assert 0 < late_us["p50"] <= late_us["p99"] <= late_us["p99_9"] <= late_us["max"]
        # Held, it takes nothing; what it has published before may still arrive.
        # A thread that a busy machine does not run stops only once it is run again.
        if covering:
            assert case["daemon_share"] > 0.0
        else:
            assert case["daemon_share"] < 0.01
    assert document["goals"] == []


def test_a_control_loop_that_is_held_knows_it():
    command = [sys.executable, "-m", "fasaco_edge.bench.control_loop", "100", "1.5"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as loop:
        time.sleep(0.7)
        loop.send_signal(signal.SIGSTOP)
        time.sleep(0.2)
        loop.send_signal(signal.SIGCONT)
        late_us = [int(line) for line in loop.communicate(timeout=120)[0].split()]
    assert len(late_us) == 150
    worst = late_us.index(max(late_us))
    assert late_us[worst] > 150_000
    # Its deadlines stay where they were: it catches up.
    assert late_us[worst + 1] < late_us[worst] - 5_000
    assert late_us[-1] < 50_000


def test_where_a_process_runs(monkeypatch, tmp_path):
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        try:
            core = {min(os.sched_getaffinity(0))}
            placement.place(busy.pid, core, 5)
            assert os.sched_getaffinity(busy.pid) == core
            assert os.getpriority(os.PRIO_PROCESS, busy.pid) == 5
            before = cpu_seconds(busy.pid)
            time.sleep(0.5)
            assert 0.0 < cpu_seconds(busy.pid) - before < 0.6
            # An ordinary folder is no control group: nothing is left in it.
            monkeypatch.setattr(placement, "CGROUPS", tmp_path)
            with placement.weighed(busy.pid, 20) as group:
                assert group == ""
            assert list(tmp_path.iterdir()) == []
        finally:
            busy.kill()


def test_latency_alone_and_beside_a_recorder(capsys):
    pytest.importorskip("rerun")
    document = figures(capsys, "latency", "--samples", "2", "--pause", "0", "--recorder")
    assert document["recorded_total_ms"]["p99"] > 0
    assert document["recorder_ratio"] > 0
    assert (document["samples"], document["ants"]) == (2, 8)
    assert document["steps"] > 20_000
    assert document["daemon_peak_rss_mb"] > 10
    for name in ("total_ms", "plan_ms", "rest_ms"):
        part = document[name]
        assert 0 < part["min"] <= part["p50"] <= part["p99"] <= part["max"]
    assert document["plan_ms"]["p50"] < document["total_ms"]["p50"]
    goal, beside = document["goals"]
    assert (goal["measured"], goal["limit"]) == (document["rest_ms"]["p99"], 20.0)
    assert beside["measured"] == document["recorder_ratio"]


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
        goals = (Goal("count", float(len(samples)), 2.0, at_least=True),)
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


def test_without_a_name_all_are_listed(capsys):
    assert main(["bench"]) == 0
    listed = capsys.readouterr().out
    assert all(benchmark.name in listed for benchmark in BENCHMARKS)


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda benchmark: benchmark.name)
def test_help_teaches_by_example(benchmark, capsys):
    with pytest.raises(SystemExit):
        main(["bench", benchmark.name, "--help"])
    assert f"fasaco-edge bench {benchmark.name}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("benchmark", "words"),
    [
        ("speed", ["--ants", "0"]),
        ("speed", ["--repeats", "-1"]),
        ("speed", ["--threads", "nan"]),
        ("speed", ["--seed", "-1"]),
        ("speed", ["--seed", str(2**63)]),
    ],
)
def test_impossible_options_are_refused(benchmark, words, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["bench", benchmark, *words])
    assert words[0] in capsys.readouterr().err
