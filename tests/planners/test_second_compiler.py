"""Stages that a second process compiles at the same time are handed over to the first."""

import os

import pytest

from fasaco_edge.kernels.manifest import chosen_folder
from fasaco_edge.planners import compiling
from fasaco_edge.planners.compiling import SecondCompiler, compile_missing
from fasaco_edge.planners.stages import AREAS, STAGES, WALKS


@pytest.fixture
def two_cores(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(compiling, "TWO_MB", 0.0)


def handed_over(folder, stages):
    with SecondCompiler(folder, stages) as second:
        second.hand_over()
    assert not folder.with_name(f"{folder.name}.second").exists()
    return {file.name for file in folder.iterdir()}


def test_functions_that_the_first_lacks_are_moved(tmp_path, two_cores):
    (tmp_path / "own").mkdir()
    compile_missing()
    (there,) = chosen_folder(STAGES)[0].glob("areas.find_areas-*.nbi")
    own = tmp_path / "own" / there.name
    own.write_bytes(b"compiled by the first")
    names = handed_over(tmp_path / "own", (WALKS, AREAS))
    assert own.read_bytes() == b"compiled by the first"
    assert not any(name.startswith(f"{own.stem}.") and name != own.name for name in names)
    assert any(name.startswith("areas.cells_beside-") and name.endswith(".nbc") for name in names)


def test_a_failed_compilation_hands_over_nothing(tmp_path, two_cores, monkeypatch):
    monkeypatch.setattr(compiling, "APART", ("no stage",))
    (tmp_path / "own").mkdir()
    assert handed_over(tmp_path / "own", (WALKS, "no stage")) == set()


@pytest.mark.parametrize(("cores", "needed_mb"), [(1, 0.0), (2, 1e9)])
def test_one_core_or_little_memory_has_one_compiler(tmp_path, monkeypatch, cores, needed_mb):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(cores)))
    monkeypatch.setattr(compiling, "TWO_MB", needed_mb)
    assert SecondCompiler(tmp_path / "own", (WALKS, AREAS)).stages == []
