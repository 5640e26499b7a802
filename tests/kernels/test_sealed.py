"""A file of compiled code that is not as it was written is compiled again, and never run."""

from __future__ import annotations

import os

import pytest

from fasaco_edge.kernels.cache import missing_from, note_complete
from fasaco_edge.kernels.sealed import UnsoundFileError, read_sealed, write_sealed
from tests.campaigns.file_calls import Failure, Kind, Watch, why_not
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
from tests.kernels.installations import ALL_LOADED, fill_with

POSSIBLE = HARMS | MISDEEDS | (TAKEN if os.geteuid() == 0 else {})
ALL = [
    *(pytest.param(harm, id=name) for name, harm in (HARMS | MISDEEDS).items()),
    *(pytest.param(harm, id=name, marks=needs_root) for name, harm in TAKEN.items()),
]


@pytest.mark.parametrize("harm", ALL)
def test_a_harmed_file_is_missing_until_it_is_written_again(tmp_path, harm):
    before, file, after, _ = fill_with(tmp_path, 3)
    payload = read_sealed(file)
    assert missing_from(file.parent) == ""
    harm(file)
    assert missing_from(file.parent).startswith(f"{file.name} ")
    with pytest.raises(UnsoundFileError):
        read_sealed(file)
    write_sealed(file, payload)
    assert read_sealed(file) == payload
    assert missing_from(file.parent) == ""
    assert not mark_of(file).exists()
    assert kernel_files(tmp_path)[:3] == [before, file, after]


@pytest.mark.parametrize("harm", ALL)
def test_a_harmed_file_that_nobody_writes_again_is_cleared_away(tmp_path, harm):
    """Code that is linked into its callers is read when those are compiled, and not before."""
    before, file, after, note = fill_with(tmp_path, 3)
    harm(file)
    note_complete(file.parent)
    assert missing_from(file.parent) == ""
    assert kernel_files(tmp_path) == [before, after, note]
    assert not os.path.lexists(file)


def test_a_kernel_lost_at_run_time_is_not_listed_as_present(installed):
    """The disk returns a file once only: the next process reports and compiles it."""
    lose = (
        "for file in seven.code_files.kernel_folder().glob('seven.eight-*'): file.write_bytes(b'')"
    )
    told = installed.tell(f"seven.eight(1)\n{lose}\nseven.tell()")
    assert "could not be read again" in told.warnings[0]
    second = installed.tell()
    assert (second.missing != "", second.compiled) == (True, 1)
    third = installed.tell()
    assert (third.missing, third.compiled) == ("", 0)


@pytest.mark.skipif(bool(why_not()), reason=why_not())
def test_a_kernel_that_fails_to_read_again_stays_unlisted(installed):
    installed.tell("seven.tell(note=False)")
    files = kernel_files(installed.cache)
    with Watch([installed.cache], Failure(Kind.OPEN, 8, "EMFILE")) as watch:
        told = installed.tell(env=watch.environment)
        assert watch.failed_on() == str(files[0])
    assert "could not be read again" in told.warnings[0]
    assert kernel_files(installed.cache) == files
    assert (installed.tell().compiled, installed.tell().missing) == (0, "")


@pytest.mark.skipif(bool(why_not()), reason=why_not())
@pytest.mark.parametrize("kind", [Kind.OPEN, Kind.LOOK])
def test_a_list_that_the_disk_does_not_give_is_told_as_such(compiled, kind):
    (note,) = compiled.cache.rglob("complete-*")
    told = set()
    for number in range(1, 9):
        with Watch([compiled.cache], Failure(kind, number, "EIO")) as watch:
            missing = compiled.look(env=watch.environment)
            if watch.failed_on() == str(note):
                told.add(missing)
    assert told <= {"", "the list of them cannot be read: Input/output error"}
    assert told or kind is Kind.LOOK


@pytest.mark.parametrize("harm", ALL)
def test_a_harmed_list_is_written_again(tmp_path, harm):
    *files, note = fill_with(tmp_path, 3)
    harm(note)
    told = missing_from(note.parent)
    assert told.startswith(("the list of them ", "they were never all compiled"))
    note_complete(note.parent)
    assert missing_from(note.parent) == ""
    assert kernel_files(tmp_path) == [*files, note]
    assert not mark_of(note).exists()


def test_every_cut_and_every_bit_is_seen(tmp_path):
    file = tmp_path / "a.kernel"
    payload = bytes(range(40))
    write_sealed(file, payload)
    assert read_sealed(file) == payload
    whole = file.read_bytes()
    for harm in (cut, altered):
        for at in range(len(whole)):
            file.write_bytes(whole)
            harm(at)(file)
            with pytest.raises(UnsoundFileError, match=r"is (damaged|empty)"):
                read_sealed(file)
    file.write_bytes(whole + b"x")
    with pytest.raises(UnsoundFileError, match="is damaged"):
        read_sealed(file)


def test_a_file_that_cannot_be_written_leaves_the_one_before_it(tmp_path, monkeypatch):
    file = tmp_path / "a.kernel"
    write_sealed(file, b"before")
    full = OSError(28, "No space left on device")

    def fail(descriptor: int) -> None:
        raise full

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="No space"):
        write_sealed(file, b"after")
    assert read_sealed(file) == b"before"
    assert list(tmp_path.iterdir()) == [file]


def test_what_a_killed_process_has_begun_is_cleared_away(tmp_path):
    *_, note = fill_with(tmp_path, 1)
    living = note.with_name(f"a.kernel.partial-{os.getpid()}")
    living.touch()
    note.with_name("a.kernel.partial-4194305").touch()  # more than any process number
    note.unlink()
    note_complete(note.parent)
    assert list(note.parent.glob("*.partial-*")) == [living]


def test_damaged_kernels_are_compiled_again_and_reported_once(installed):
    """Each damage to one kernel of many: none runs, nothing ends, the next start finds all."""
    more = "\n@jit.kernel\ndef k{0}(x):\n    return x + {0}\n"
    with (installed.package / "seven.py").open("a") as file:
        file.writelines(more.format(number) for number in range(len(POSSIBLE)))
    calls = "".join(f"assert seven.k{n}(1) == {n + 1}; " for n in range(len(POSSIBLE)))
    stats = ", ".join(f"seven.k{number}.stats" for number in range(len(POSSIBLE)))
    code = f"{calls} seven.more = [{stats}]; seven.tell()"
    first = installed.tell(code)
    assert (first.loaded, first.compiled) == (0, 2 + len(POSSIBLE))
    by_name = {file.name.partition("-")[0]: file for file in kernel_files(installed.cache)}
    harmed = [by_name[f"seven.k{number}"] for number in range(len(POSSIBLE))]
    for file, harm in zip(harmed, POSSIBLE.values(), strict=True):
        harm(file)
    told = installed.tell(code)
    assert (told.loaded, told.compiled) == (1, len(POSSIBLE))
    (warning,) = told.warnings
    assert ": the compiled kernel " in warning
    assert warning.endswith(": it is compiled again")
    assert not mark_of(harmed[0]).exists()
    again = installed.tell(code)
    assert (again.missing, again.loaded, again.compiled) == ("", 1 + len(POSSIBLE), 0)
    assert again.warnings == []


def test_a_cache_of_empty_files_is_compiled_again(compiled):
    for file in kernel_files(compiled.cache):
        cut(0)(file)
    told = compiled.tell()
    assert told.missing == "the list of them is empty"
    assert (told.loaded, told.compiled, len(told.warnings)) == (0, 2, 1)
    again = compiled.tell()
    assert (again.missing, again.loaded, again.compiled, again.warnings) == ("", *ALL_LOADED)
