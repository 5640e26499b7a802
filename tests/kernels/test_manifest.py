"""Compiled kernels that are not as they were written are compiled again, and never run."""

from __future__ import annotations

import os
import signal

import pytest

from fasaco_edge.kernels import manifest
from fasaco_edge.kernels.manifest import MANIFEST, NEVER, compiling_into, record, why_missing
from tests.kernels.harm import (
    HARMS,
    MISDEEDS,
    TAKEN,
    altered,
    cut,
    kernel_files,
    mark_of,
    needs_root,
)
from tests.kernels.installations import ALL_LOADED, COMPILES, fill_with, told_by

ALL = [
    *(pytest.param(harm, id=name) for name, harm in (HARMS | MISDEEDS).items()),
    *(pytest.param(harm, id=name, marks=needs_root) for name, harm in TAKEN.items()),
]
STAGES = ("all",)


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    """Each look at a folder is a process's first."""
    monkeypatch.setattr(manifest, "_COMPARED", _Forgetful())


class _Forgetful(dict):
    def __setitem__(self, folder, content):
        pass


@pytest.mark.parametrize("harm", ALL)
def test_a_harmed_file_is_seen_and_cleared_away(tmp_path, harm):
    folder = fill_with(tmp_path, 3)
    before, file, after, noted = kernel_files(folder)
    assert why_missing(folder, STAGES) == ""
    harm(file)
    assert why_missing(folder, STAGES).startswith(f"{file.name} ")
    with compiling_into(folder, lambda: None) as left:
        assert (left.stages, sorted(left.files)) == ([], [before.name, after.name])
        assert kernel_files(folder) == [before, after, noted]
        record(folder, left, "all")
    assert why_missing(folder, STAGES) == ""
    assert not mark_of(file).exists()


@pytest.mark.parametrize("harm", ALL)
def test_a_folder_with_a_damaged_manifest_is_compiled_again(tmp_path, harm):
    folder = fill_with(tmp_path, 3)
    harm(folder / MANIFEST)
    assert why_missing(folder, STAGES).startswith(
        (MANIFEST, NEVER, "0.nbc", "1.nbc", "2.nbc", "not")
    )
    with compiling_into(folder, lambda: None) as left:
        record(folder, left, "all")
    assert why_missing(folder, STAGES) == ""
    assert not mark_of(folder / MANIFEST).exists()


@pytest.mark.parametrize("text", ["[]", "{", '{"stages": 1, "files": {}}', '{"files": 2}'])
def test_a_manifest_of_another_form_counts_as_damaged(tmp_path, text):
    folder = fill_with(tmp_path, 1)
    (folder / MANIFEST).write_text(text)
    assert why_missing(folder, STAGES) == f"{MANIFEST} is damaged"


def test_every_cut_and_every_bit_is_seen(tmp_path):
    file = kernel_files(fill_with(tmp_path, 1))[0]
    whole = file.read_bytes()
    for harm in (cut, altered):
        for at in range(len(whole)):
            file.write_bytes(whole)
            harm(at)(file)
            assert why_missing(file.parent, STAGES) == f"{file.name} is damaged"


def test_files_of_a_killed_compiler_go_and_its_stages_stay(tmp_path):
    folder = fill_with(tmp_path, 2)
    (folder / "a.nbi.tmp.0123").touch()
    (folder / "a.nbc").write_bytes(b"of a stage that is not noted")
    assert why_missing(folder, STAGES) == ""
    with compiling_into(folder, lambda: None) as left:
        assert left.stages == ["all"]
        assert [file.name for file in kernel_files(folder)] == ["0.nbc", "1.nbc", MANIFEST]


def test_a_failed_write_leaves_the_manifest_before_it(tmp_path, monkeypatch):
    folder = fill_with(tmp_path, 1)
    before = (folder / MANIFEST).read_bytes()

    def fail(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    with compiling_into(folder, lambda: None) as left:
        monkeypatch.setattr(os, "fsync", fail)
        with pytest.raises(OSError, match="No space"):
            record(folder, left, "more")
    assert (folder / MANIFEST).read_bytes() == before


def test_a_stage_that_is_not_there_is_named(tmp_path):
    folder = fill_with(tmp_path, 1)
    assert why_missing(folder, ("all", "more")) == "not compiled yet: more"


def test_a_look_does_not_wait_for_a_compiler(tmp_path):
    folder = fill_with(tmp_path, 1)
    with compiling_into(folder, lambda: None):
        assert why_missing(folder, STAGES) == "another process is compiling them"


def test_two_who_compile_at_once_do_it_one_after_the_other(installed):
    at_once = [installed.start(env=COMPILES) for _ in range(3)]
    told = [told_by(process) for process in at_once]
    assert [one.warnings for one in told] == [[], [], []]
    assert sorted(one.compiled for one in told) == [0, 0, 2]
    assert installed.tell().work == ALL_LOADED


def test_a_reader_waits_for_who_compiles(compiled):
    holds = "print('ready', flush=True)\nimport sys\nsys.stdin.read()\nseven.tell()"
    writer = compiled.start(holds, env=COMPILES, stdin=-1)
    assert writer.stdout.readline() == "ready\n"
    reader = compiled.start()
    with pytest.raises(Exception, match="timed out"):
        reader.wait(3.0)
    writer.communicate("\n", timeout=100)
    told = told_by(reader)
    assert (told.loaded, told.compiled) == ALL_LOADED[:2]
    assert told.warnings == [f"waiting for kernels that are compiled in {compiled.folder}"]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_an_interrupted_compilation_starts_again(installed, number):
    amid = f"assert seven.seven(1) == 7\nimport os; os.kill(os.getpid(), {int(number)})"
    process = installed.start(amid, env=COMPILES)
    process.communicate(timeout=100)
    assert process.returncode == -number
    assert list(installed.folder.glob("*.nbc"))
    assert why_missing(installed.folder, STAGES) == NEVER
    assert installed.compile().compiled == 2
    assert installed.tell().work == ALL_LOADED


@pytest.mark.parametrize("name", ["gone", "altered in the middle", "another pickle"])
def test_damaged_kernels_are_not_run_and_reported_once(compiled, name):
    file = next(compiled.folder.glob("seven.eight-*.nbi"))
    (HARMS | MISDEEDS)[name](file)
    told = compiled.tell()
    assert (told.loaded, told.compiled) == (0, 2)
    (warning,) = told.warnings
    assert f": {file.name} " in warning
    assert warning.endswith(": kernels are compiled for this process alone")
    assert not mark_of(file).exists()
    # Who compiles mends it.
    assert compiled.compile().loaded >= 1
    assert compiled.tell().work == ALL_LOADED
