"""The folder of compiled kernels is one that nobody else could have filled, or none."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

from fasaco_edge.kernels import folder as folders
from fasaco_edge.kernels.folder import code_digest, processor, temporary_folder, wanted_folder
from fasaco_edge.kernels.manifest import chosen_folder
from tests.kernels.harm import NOBODY, needs_root
from tests.kernels.installations import ALL_LOADED

HOMES = ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "RUNTIME_DIRECTORY")


@pytest.fixture
def tmp(tmp_path, monkeypatch):
    """A sticky temporary folder, as /tmp is one."""
    made = tmp_path / "tmp"
    made.mkdir()
    made.chmod(0o1777)
    monkeypatch.setattr(tempfile, "tempdir", str(made))
    monkeypatch.setenv("TMPDIR", str(made))
    return made


def mounts_are_ours() -> bool:
    if os.geteuid() != 0 or shutil.which("unshare") is None:
        return False
    tried = subprocess.run(["unshare", "--mount", "true"], check=False, capture_output=True)
    return tried.returncode == 0


needs_mounts = pytest.mark.skipif(not mounts_are_ours(), reason="needs mounts of its own (root)")


def mounted(command: str) -> list[str]:
    """Return the words before those of a program that sees a mount nobody else sees."""
    return ["unshare", "--mount", "sh", "-ec", f'{command}; exec "$@"', "sh"]


@needs_root
def test_a_file_of_another_user_does_not_exclude_a_temporary_folder(tmp):
    for name in ("x", "kernels"):
        (tmp / name).touch()
        os.chown(tmp / name, NOBODY, NOBODY)
    assert temporary_folder() == tmp


def test_the_given_folder_is_taken_and_not_made(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "service"))
    there = tmp_path / "service" / f"kernels-{code_digest()}"
    assert chosen_folder() == (there, "")
    assert list(tmp_path.iterdir()) == []


def test_the_users_cache_is_the_default(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert wanted_folder().parent == tmp_path / "fasaco-edge"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    # A relative one would be another in each working folder.
    for relative in ("", "cache", "./cache", "~/cache"):
        monkeypatch.setenv("XDG_CACHE_HOME", relative)
        assert wanted_folder().parent == tmp_path / "home" / ".cache" / "fasaco-edge"


@needs_root
@pytest.mark.parametrize("relative", [None, "cache", "~/cache"])
def test_no_cache_is_laid_into_the_working_folder(tmp_path, tmp, monkeypatch, relative):
    """As by a container's user, who has neither a name nor a home, in a folder of its own."""
    nameless = 987_654
    work = tmp_path / "work"
    work.mkdir()
    os.chown(work, nameless, nameless)
    for folder in (tmp_path, *tmp_path.parents[:-2]):
        folder.chmod(folder.stat().st_mode | 0o011)
    environ = {name: value for name, value in os.environ.items() if name not in HOMES}
    if relative is not None:
        environ["XDG_CACHE_HOME"] = relative
    digest = code_digest()
    monkeypatch.setattr(folders, "code_digest", lambda: digest)
    # Forked off: it needs to read nothing more of a place that may be root's alone.
    if not (child := os.fork()):
        try:
            os.chdir(work)
            os.setuid(nameless)
            os.environ.clear()
            os.environ.update(environ)
            name = f"fasaco-edge-{nameless}-kernels-{digest}"
            os._exit(int(chosen_folder() != (tmp / name, "")))
        finally:
            os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert not any(work.iterdir())


def test_other_compilers_have_a_folder_of_their_own():
    now = code_digest()
    for changed in folders.COMPILERS:
        versions = {"numba": "1", "llvmlite": "1"}
        one = code_digest(versions.__getitem__)
        versions[changed] = "2"
        assert len({now, one, code_digest(versions.__getitem__)}) == 3


def test_another_processor_has_a_folder_of_its_own(tmp_path, monkeypatch):
    pi, pc = tmp_path / "pi", tmp_path / "pc"
    pi.write_text("Features : fp asimd\nCPU part : 0xd08\n" * 4)
    pc.write_text("model name : a b\nflags : fpu sse avx2 ibrs\ncpu MHz : 3000\n")
    # What a kernel of another version shows more or less is no other processor.
    same = tmp_path / "same"
    same.write_text("model name : a b\nflags : fpu sse avx2\ncpu MHz : 2000\n")
    assert len({processor(pi), processor(pc)}) == 2
    assert processor(pc) == processor(same)
    before = code_digest()
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    assert code_digest() != before


@pytest.mark.parametrize("umask", [0o000, 0o002])
def test_code_that_others_may_write_is_not_loaded(installed, umask):
    """As of a compiler without a umask of its own."""
    installed.compile(umask=umask)
    told = installed.tell()
    assert (told.loaded, told.compiled) == (0, 2)
    assert "may be written by" in told.warnings[0]


def test_without_a_cache_folder_a_temporary_one_is_used(installed, tmp):
    installed.cache.touch()
    told = installed.compile(umask=0o077)
    folder = Path(told.folder)
    # Straight in the sticky folder: whoever owned one between could replace ours.
    assert folder.parent == tmp
    assert folder.stat().st_mode & 0o777 == 0o700
    why = f"{installed.cache} is no folder: compiled kernels are kept in {folder}"
    assert told.warnings == [why]
    again = installed.tell()
    assert (again.loaded, again.folder, again.warnings) == (1, told.folder, [why])


HARMED_FOLDERS = {
    "its group may write": lambda folder: folder.chmod(0o770),
    "everybody may write above": lambda folder: folder.parent.chmod(0o777),
    "a file": lambda folder: (shutil.rmtree(folder), folder.touch()),
}
OF_OTHERS = {
    "of another user": lambda folder: os.chown(folder, NOBODY, NOBODY),
    "of another user above": lambda folder: os.chown(folder.parent, NOBODY, NOBODY),
    "behind a link of another user": lambda folder: (
        folder.rename(folder.parent.with_name("elsewhere")),
        folder.symlink_to("../elsewhere"),
        os.chown(folder, NOBODY, NOBODY, follow_symlinks=False),
    ),
}


@pytest.mark.parametrize(
    "harm",
    [
        *(pytest.param(harm, id=name) for name, harm in HARMED_FOLDERS.items()),
        *(pytest.param(harm, id=name, marks=needs_root) for name, harm in OF_OTHERS.items()),
    ],
)
def test_a_folder_that_others_could_have_filled_is_never_used(compiled, tmp, harm):
    """A cache is code: what lies in a folder somebody else may write to is not to be run."""
    harm(compiled.folder)
    told = compiled.tell()
    assert (told.loaded, told.compiled) == (0, 2)
    assert Path(told.folder).parent == tmp
    assert told.warnings[0].endswith(f": compiled kernels are kept in {told.folder}")


@needs_root
def test_root_does_not_use_another_users_home(installed, tmp_path, tmp):
    home = tmp_path / "home"
    home.mkdir()
    os.chown(home, NOBODY, NOBODY)
    env = {"NUMBA_CACHE_DIR": None, "XDG_CACHE_HOME": None, "HOME": str(home)}
    told = installed.tell(env=env)
    assert Path(told.folder).parent == tmp
    assert list(home.iterdir()) == []
    assert "belongs to user" in told.warnings[0]


def test_kernels_are_compiled_even_if_none_can_be_kept(installed, tmp):
    installed.cache.touch()
    told = installed.tell(env={"RUNTIME_DIRECTORY": str(installed.cache)})
    assert (told.loaded, told.compiled, told.folder) == (0, 2, None)
    assert list(tmp.iterdir()) == []
    (warning,) = told.warnings
    assert warning.endswith("compiled kernels are not kept, each process compiles its own")


@needs_mounts
def test_a_full_folder_is_passed_over(installed, tmp):
    installed.cache.mkdir(0o700)
    small = mounted(f"mount -t tmpfs -o size=1m,mode=700 tmpfs {installed.cache}")
    told = installed.compile(umask=0o077, words=small)
    assert Path(told.folder).parent == tmp
    assert told.warnings == [
        f"{installed.cache} has less than {folders.NEEDED_MB} MB free: "
        f"compiled kernels are kept in {told.folder}"
    ]
    # systemd gives a service one in memory.
    run = tmp.parent / "run"
    run.mkdir(0o700)
    told = installed.compile(umask=0o077, words=small, env={"RUNTIME_DIRECTORY": str(run)})
    assert Path(told.folder).parent == run


@needs_mounts
def test_a_folder_that_cannot_be_written_is_read(compiled, tmp):
    bound = f"mount --bind {compiled.cache} {compiled.cache}"
    read_only = mounted(f"{bound}; mount -o remount,ro,bind {compiled.cache}")
    told = compiled.tell(words=read_only)
    assert told.work == ALL_LOADED
    assert told.folder == str(compiled.folder)
    next(compiled.folder.glob("*.nbc")).unlink()
    told = compiled.tell(words=read_only)
    assert (told.loaded, told.compiled) == (0, 2)
    assert Path(told.folder).parent == tmp
    assert told.warnings[0] == (
        f"{compiled.folder} cannot be written: compiled kernels are kept in {told.folder}"
    )


def test_folders_of_other_versions_are_removed_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = wanted_folder()
    kept = [folder, tmp_path / "kernels-mine", tmp_path / "other"]
    elsewhere = tmp_path / "other" / "precious"
    old = tmp_path / f"kernels-{'0' * 12}"
    for other in (*kept, elsewhere, old):
        other.mkdir(parents=True, exist_ok=True)
    (old / "a.nbc").write_bytes(bytes(100_000))
    (tmp_path / f"kernels-{'1' * 12}").symlink_to(elsewhere)
    assert folders.prune(folder) == (1, 0.1)
    assert all(other.is_dir() for other in (*kept, elsewhere))
    assert not old.exists()
