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
    assert folder == tmp_path / "service" / f"kernels-{cache.code_digest()}"
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
    mine = no_cache_but_temporary / f"fasaco-edge-{me}-kernels-{cache.code_digest()}"
    mine.mkdir()  # by them, under my name
    assert cache.cache_folder() != mine


def run(code, root, folder, **environ):
    """Run a program on the packages in ``root``."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=root,
        env={**os.environ, "NUMBA_DISABLE_JIT": "0", "NUMBA_CACHE_DIR": str(folder)} | environ,
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
    for source in (jit.__file__, cache.__file__):
        shutil.copy(source, package)
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


def test_other_compilers_have_a_folder_of_their_own():
    now = cache.code_digest()
    for changed in cache.COMPILERS:
        versions = {"numba": "1", "llvmlite": "1"}
        one = cache.code_digest(versions.__getitem__)
        versions[changed] = "2"
        assert len({now, one, cache.code_digest(versions.__getitem__)}) == 3


KERNEL = """
from fasaco_edge.kernels.jit import kernel, note_all_compiled
from fasaco_edge.kernels.cache import missing_from, usable_folder
@kernel
def seven():
    return 7
print(missing_from(usable_folder()) or "nothing", end="; ")
seven()
stats = seven.stats
print(sum(stats.cache_hits.values()), "loaded", sum(stats.cache_misses.values()), "compiled")
note_all_compiled()
"""


@pytest.fixture
def one_kernel(tmp_path):
    """Tells what was missing, loaded and compiled of an installation with one kernel."""
    package = tmp_path / "fasaco_edge" / "kernels"
    package.mkdir(parents=True)
    for part in (package.parent / "__init__.py", package / "__init__.py"):
        part.touch()
    for source in (jit.__file__, cache.__file__):
        shutil.copy(source, package)
    (package / "seven.py").write_text(KERNEL)

    def tell(**environ):
        code = "import fasaco_edge.kernels.seven"
        return run(code, tmp_path, tmp_path / "cache", **environ)

    return tell


def test_what_is_said_to_be_there_is_loaded(one_kernel):
    assert one_kernel() == "they were never all compiled for this installation; 0 loaded 1 compiled"
    assert one_kernel() == "nothing; 1 loaded 0 compiled"


def test_code_of_another_processor_is_not_run(one_kernel):
    """As in a folder that was copied from another robot."""
    one_kernel()
    told = one_kernel(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
    assert told.startswith("they were compiled for another processor")
    assert told.endswith("; 0 loaded 1 compiled")
    # Both are kept from then on; what is noted is of the one that came last.
    assert one_kernel().endswith("; 1 loaded 0 compiled")


def test_an_installation_elsewhere_compiles_its_own(one_kernel, tmp_path):
    one_kernel()
    shutil.move(tmp_path / "fasaco_edge", tmp_path / "moved" / "fasaco_edge")
    told = run("import fasaco_edge.kernels.seven", tmp_path / "moved", tmp_path / "cache")
    assert told == "they were never all compiled for this installation; 0 loaded 1 compiled"


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (lambda file, note: file.unlink(), "is gone; 0 loaded 1 compiled"),
        (lambda file, note: note.write_text("[]"), "cannot be read; 1 loaded 0 compiled"),
        (lambda file, note: note.unlink(), "for this installation; 1 loaded 0 compiled"),
    ],
    ids=["removed", "no note", "none"],
)
def test_what_was_harmed_is_missing(one_kernel, tmp_path, harm, said):
    one_kernel()
    (file,) = (tmp_path / "cache").glob("kernels-*/*/*.nbc")
    (note,) = (tmp_path / "cache").glob("kernels-*/complete-*.json")
    harm(file, note)
    assert one_kernel().endswith(said)
    assert one_kernel() == "nothing; 1 loaded 0 compiled"


def test_folders_of_other_versions_are_removed_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = cache.cache_folder()
    kept = [folder, tmp_path / "kernels-mine", tmp_path / "other"]
    elsewhere = tmp_path / "other" / "precious"
    for other in (*kept, elsewhere, tmp_path / f"kernels-{'0' * 12}" / "kernels_abc"):
        other.mkdir(parents=True, exist_ok=True)
    (tmp_path / f"kernels-{'0' * 12}" / "kernels_abc" / "a.nbc").write_bytes(bytes(100_000))
    (tmp_path / f"kernels-{'1' * 12}").symlink_to(elsewhere)
    assert cache.prune(folder) == (1, 0.1)
    assert all(other.is_dir() for other in (*kept, elsewhere))
    assert not (tmp_path / f"kernels-{'0' * 12}").exists()


def test_numba_imported_before_us_keeps_its_code_in_our_folder_too(tmp_path):
    code = "import numba; from fasaco_edge.kernels import cache, jit; print(numba.config.CACHE_DIR)"
    folder = run(code, ROOT, tmp_path)
    assert folder == str(tmp_path / f"kernels-{cache.code_digest()}")


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
