"""The folder of compiled kernels is one that nobody else could have filled, or none."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

from fasaco_edge.kernels import cache
from tests.kernels.harm import NOBODY, needs_root
from tests.kernels.installations import ALL_LOADED, told_by

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


def test_the_given_folder_is_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "service"))
    folder = cache.cache_folder()
    assert folder == tmp_path / "service" / f"kernels-{cache.code_digest()}"
    assert folder.is_dir()


def test_the_users_cache_is_the_default(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.cache_folder().parent == tmp_path / "fasaco-edge"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache.cache_folder().parent == tmp_path / "home" / ".cache" / "fasaco-edge"


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
    name = f"kernels-{cache.code_digest()}"
    monkeypatch.setattr(cache, "_name", lambda: name)
    # Forked off: it needs to read nothing more of a place that may be root's alone.
    if not (child := os.fork()):
        try:
            os.chdir(work)
            os.setuid(nameless)
            os.environ.clear()
            os.environ.update(environ)
            folder = cache.cache_folder()
            os._exit(int(folder is None or folder.parent != tmp))
        finally:
            os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert not any(work.iterdir())
    assert [made.name for made in tmp.iterdir()] == [f"fasaco-edge-{nameless}-{name}"]


def test_a_relative_user_cache_counts_as_none(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for relative in ("cache", "./cache", "~/cache"):
        monkeypatch.setenv("XDG_CACHE_HOME", relative)
        assert cache.wanted_folder().parent == tmp_path / "home" / ".cache" / "fasaco-edge"


def test_a_child_process_uses_the_same_cache(tmp_path, tmp, monkeypatch):
    (tmp_path / "file").touch()
    for given in (tmp_path, tmp_path / "file"):
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(given))
        parents = cache.cache_folder()
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(parents))
        assert cache.cache_folder() == parents
    # That of another version is not one to put a folder into.
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / f"kernels-{'0' * 12}"))
    assert cache.cache_folder().parent == tmp_path


def test_other_compilers_have_a_folder_of_their_own():
    now = cache.code_digest()
    for changed in cache.COMPILERS:
        versions = {"numba": "1", "llvmlite": "1"}
        one = cache.code_digest(versions.__getitem__)
        versions[changed] = "2"
        assert len({now, one, cache.code_digest(versions.__getitem__)}) == 3


@pytest.mark.parametrize("umask", [0o000, 0o077, 0o002])
def test_whatever_is_made_is_ours_alone(installed, umask):
    installed.tell(umask=umask)
    made = [installed.cache, installed.folder, *installed.folder.iterdir()]
    assert len(made) == 5
    assert {path.stat().st_mode & 0o077 for path in made} == {0}
    told = installed.tell(umask=umask)
    assert (told.missing, told.loaded, told.compiled, told.warnings) == ("", *ALL_LOADED)


def test_without_a_cache_folder_a_temporary_one_is_used(installed, tmp):
    installed.cache.touch()
    told = installed.tell()
    folder = Path(told.folder)
    # Straight in the sticky folder: whoever owned one between could replace ours.
    assert folder.parent == tmp
    assert folder.stat().st_mode & 0o777 == 0o700
    assert told.warnings == [
        f"{installed.cache} is no folder: compiled kernels are kept in {folder}"
    ]
    again = installed.tell()
    assert (again.missing, again.loaded, again.folder) == ("", 1, told.folder)


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
    (warning,) = told.warnings
    assert warning.endswith(f": compiled kernels are kept in {told.folder}")
    assert told.passed_over == warning.partition(": compiled")[0]


@needs_root
def test_root_with_the_home_of_another_user_leaves_it_alone(installed, tmp_path, tmp):
    home = tmp_path / "home"
    home.mkdir()
    os.chown(home, NOBODY, NOBODY)
    env = {"NUMBA_CACHE_DIR": None, "XDG_CACHE_HOME": None, "HOME": str(home)}
    told = installed.tell(env=env)
    assert Path(told.folder).parent == tmp
    assert list(home.iterdir()) == []
    assert "belongs to user" in told.warnings[0]


@needs_root
def test_a_taken_temporary_name_gives_a_folder_for_one_process(installed, tmp):
    """The folder is fresh, and lasts as long as its process."""
    installed.cache.touch()
    taken = Path(installed.tell().folder)
    assert taken.parent == tmp
    os.chown(taken, NOBODY, NOBODY)
    (tmp / "fasaco-edge-of-4194305-left").mkdir()  # by one that was killed
    child = (
        "import json, subprocess, sys; "
        "inner = subprocess.run([sys.executable, '-c', "
        "'from fasaco_edge.kernels import seven; seven.tell()'], capture_output=True, check=True); "
        "seven.tell(); print(inner.stdout.decode(), end=str())"
    )
    told = installed.tell(child)
    # Of the child: it loads what the parent has compiled, from where that keeps it.
    fresh = Path(told.folder)
    assert fresh.parent.parent == tmp
    assert fresh.parent != taken
    assert told.warnings == []
    assert not fresh.parent.exists()
    assert list(tmp.iterdir()) == [taken]


def test_kernels_are_compiled_even_if_none_can_be_kept(installed):
    installed.cache.touch()
    nowhere = "from fasaco_edge.kernels import cache; cache._temporary = lambda: []"
    told = installed.tell(before=nowhere)
    assert (told.loaded, told.compiled, told.folder) == (0, 2, None)
    (warning,) = told.warnings
    assert warning.endswith("compiled kernels are not kept, each process compiles its own")


def test_two_who_compile_at_once_do_not_disturb_each_other(installed):
    at_once = [installed.start("seven.tell(1)"), installed.start("seven.tell(1.5)")]
    at_once += [installed.start("seven.tell(1)")]
    for process in at_once:
        assert told_by(process).warnings == []
    told = installed.tell()
    assert (told.missing, told.loaded, told.compiled, told.warnings) == ("", *ALL_LOADED)
    assert len(list(installed.folder.iterdir())) == 5


@needs_mounts
def test_a_full_folder_is_passed_over(installed, tmp):
    installed.cache.mkdir(0o700)
    small = mounted(f"mount -t tmpfs -o size=1m,mode=700 tmpfs {installed.cache}")
    told = installed.tell(words=small)
    assert Path(told.folder).parent == tmp
    assert told.warnings == [
        f"{installed.cache} has less than {cache.NEEDED_MB} MB free: "
        f"compiled kernels are kept in {told.folder}"
    ]
    # systemd gives a service one in memory.
    run = tmp.parent / "run"
    run.mkdir(0o700)
    told = installed.tell(words=small, env={"RUNTIME_DIRECTORY": str(run)})
    assert Path(told.folder).parent == run


@needs_mounts
def test_a_disk_that_fills_up_meanwhile_ends_nothing(installed):
    installed.cache.mkdir(0o700)
    disk = mounted(f"mount -t tmpfs -o size=24m,mode=700 tmpfs {installed.cache}")
    fill = f"""
try:
    with open("{installed.cache}/ballast", "wb", buffering=0) as file:
        while file.write(bytes(4096)): pass
except OSError:
    pass
seven.tell()
import os
print(sorted(os.listdir(seven.code_files.kernel_folder())), file=open("{installed.root}/left", "w"))
print(__import__("json").dumps(["", "", *[0, 0], seven.said, None]))
"""
    told = installed.tell(fill, words=disk)
    (warning,) = told.warnings
    assert "No space left on device: each process compiles its own kernels" in warning
    assert (installed.root / "left").read_text() == "[]\n"


@needs_mounts
def test_a_folder_that_cannot_be_written_is_read(compiled, tmp):
    bound = f"mount --bind {compiled.cache} {compiled.cache}"
    read_only = mounted(f"{bound}; mount -o remount,ro,bind {compiled.cache}")
    told = compiled.tell(words=read_only)
    assert (told.missing, told.loaded, told.compiled, told.warnings) == ("", *ALL_LOADED)
    assert told.folder == str(compiled.folder)
    next(compiled.folder.glob("*.kernel")).unlink()
    told = compiled.tell(words=read_only)
    assert (told.loaded, told.compiled) == (0, 2)
    assert Path(told.folder).parent == tmp
    assert told.warnings == [
        f"{compiled.folder} cannot be written: compiled kernels are kept in {told.folder}"
    ]
