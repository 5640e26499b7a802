"""Where compiled kernels are kept, and that nobody meets code of other sources."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from fasaco_edge.kernels import cache, jit

ROOT = Path(__file__).parents[2]


@pytest.fixture
def kernel_copy(tmp_path, monkeypatch):
    """The kernel sources as a copy that may be changed."""
    folder = tmp_path / "kernels"
    folder.mkdir()
    for source in cache.KERNEL_SOURCES:
        shutil.copy(source, folder)
    monkeypatch.setattr(cache, "KERNEL_SOURCES", sorted(folder.glob("*.py")))
    return folder


def test_every_kernel_source_counts(kernel_copy):
    seen = {cache.sources_digest()}
    for source in sorted(kernel_copy.glob("*.py")):
        source.write_text(source.read_text() + "\n# changed\n")
        seen.add(cache.sources_digest())
    assert len(seen) == 1 + len(list(kernel_copy.glob("*.py")))
    assert all(len(digest) == 12 for digest in seen)


def test_the_given_folder_is_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "service"))
    folder = cache.cache_folder()
    assert folder == tmp_path / "service" / f"kernels-{cache.sources_digest()}"
    assert folder.is_dir()


def test_the_users_cache_is_the_default(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.cache_folder().parent == tmp_path / "fasaco-edge"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache.cache_folder().parent == tmp_path / "home" / ".cache" / "fasaco-edge"


@pytest.fixture
def no_cache_but_temporary(tmp_path, monkeypatch):
    """A user whose cache cannot be written: a file stands where the folder should."""
    (tmp_path / "file").touch()
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    return tmp_path / "tmp"


def test_without_a_writable_cache_a_temporary_one_of_our_own_is_taken(no_cache_but_temporary):
    folder = cache.cache_folder()
    # Straight in the sticky folder: whoever owned one between could replace ours.
    assert folder.parent == no_cache_but_temporary
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_temporary_folder_of_another_user_is_not_trusted(no_cache_but_temporary, monkeypatch):
    """A cache is code: what lies in a folder somebody else made is not to be run."""
    them = os.getuid()
    me = them + 1
    monkeypatch.setattr(os, "getuid", lambda: me)
    mine = no_cache_but_temporary / f"fasaco-edge-{me}-kernels-{cache.sources_digest()}"
    mine.mkdir()  # by them, under my name
    assert cache.cache_folder() != mine


def run(code, root, folder):
    """Run a program on the packages in ``root``."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=root,
        env={**os.environ, "NUMBA_DISABLE_JIT": "0", "NUMBA_CACHE_DIR": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_caller_in_another_file_never_meets_the_old_code_of_its_callee(tmp_path):
    package = tmp_path / "fasaco_edge" / "kernels"
    package.mkdir(parents=True)
    for part in (package.parent / "__init__.py", package / "__init__.py"):
        part.touch()
    for module in (cache, jit):
        shutil.copy(module.__file__, package)
    head = "from fasaco_edge.kernels.jit import kernel\n"
    callee = head + "@kernel\ndef one():\n    return {}\n"
    caller = (
        head
        + "from fasaco_edge.kernels.callee import one\n"
        + "@kernel\ndef two():\n    return one() + one()\n"
    )
    (package / "caller.py").write_text(caller)
    for value in (1, 4):
        (package / "callee.py").write_text(callee.format(value))
        code = "from fasaco_edge.kernels.caller import two; print(two())"
        assert run(code, tmp_path, tmp_path / "cache") == str(2 * value)
    assert len(list((tmp_path / "cache").glob("kernels-*/**/*.nbi"))) == 4


def test_numba_imported_before_us_keeps_its_code_in_our_folder_too(tmp_path):
    code = "import numba; from fasaco_edge.kernels import jit; print(numba.config.CACHE_DIR)"
    folder = run(code, ROOT, tmp_path)
    assert folder == str(tmp_path / f"kernels-{cache.sources_digest()}")


def test_twins_agree_without_the_compiler():
    """What is fine as machine code may overflow or fail in plain Python, and the reverse."""
    if os.environ.get("NUMBA_DISABLE_JIT") == "1":
        pytest.skip("this is the run without the compiler")
    program = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "tests/kernels"]
    done = subprocess.run(
        [*program, "tests/planners", "-k", "twin or equation"],
        cwd=ROOT,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    assert " passed" in done.stdout


def test_a_child_process_uses_the_same_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    parents = cache.cache_folder()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(parents))
    assert cache.cache_folder() == parents
