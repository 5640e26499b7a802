"""Compiled kernels are kept and found again, and nobody meets code of other sources."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fasaco_edge.kernels import cache, release
from tests.kernels.installations import ALL_LOADED, package_in, told_by
from tests.support.processes import ENVIRONMENT

ROOT = Path(__file__).parents[2]


@pytest.fixture
def kernel_copy(tmp_path, monkeypatch):
    """The kernel sources as a copy that may be changed."""
    folder = tmp_path / "kernels"
    folder.mkdir()
    for source in release.KERNEL_SOURCES:
        shutil.copy(source, folder)
    monkeypatch.setattr(release, "KERNEL_SOURCES", sorted(folder.glob("*.py")))
    return folder


def test_every_kernel_source_counts(kernel_copy):
    seen = {release.sources_digest()}
    for source in sorted(kernel_copy.glob("*.py")):
        source.write_text(source.read_text() + "\n# changed\n")
        seen.add(release.sources_digest())
    assert len(seen) == 1 + len(list(kernel_copy.glob("*.py")))
    assert all(len(digest) == 12 for digest in seen)


def test_a_caller_in_another_file_never_gets_old_callee_code(tmp_path):
    package = package_in(tmp_path)
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
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=tmp_path,
            env={
                **os.environ,
                "NUMBA_DISABLE_JIT": "0",
                "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
            },
            capture_output=True,
            text=True,
            check=True,
            timeout=600,
        )
        assert done.stdout.strip() == str(2 * value)
    assert len(list((tmp_path / "cache").glob("kernels-*/*.kernel"))) == 4


def test_other_compilers_have_a_folder_of_their_own():
    now = cache.code_digest()
    for changed in cache.COMPILERS:
        versions = {"numba": "1", "llvmlite": "1"}
        one = cache.code_digest(versions.__getitem__)
        versions[changed] = "2"
        assert len({now, one, cache.code_digest(versions.__getitem__)}) == 3


def test_what_is_said_to_be_there_is_loaded(installed):
    first = installed.tell()
    assert first.missing == "they were never all compiled for this version"
    assert (first.loaded, first.compiled, first.warnings) == (0, 2, [])
    again = installed.tell()
    assert again.missing == ""
    assert (again.loaded, again.compiled, again.warnings) == ALL_LOADED


def test_what_is_loaded_needs_nothing_of_what_compiles(compiled):
    """It takes as long as all else of loading, and is read where something is compiled."""
    which = "print('numba.np.linalg' in sys.modules, file=sys.stderr)"
    for code, is_needed in (("seven.tell()", False), ("seven.tell(1.5, note=False)", True)):
        _, err = compiled.start(f"{code}\nimport sys\n{which}").communicate(timeout=100)
        assert err.split() == [str(is_needed)]


def test_code_of_another_processor_is_not_run(compiled):
    """As in a folder that was copied from another robot."""
    told = compiled.tell(env={"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""})
    assert told.missing.startswith("they were compiled for another processor")
    assert (told.loaded, told.compiled) == (0, 2)
    # Both are kept from then on.
    for env in ({}, {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}):
        told = compiled.tell(env=env)
        assert told.missing == ""
        assert (told.loaded, told.compiled, told.warnings) == ALL_LOADED


def test_a_moved_installation_loads_the_code_of_the_same_sources(compiled, tmp_path):
    shutil.move(compiled.root, tmp_path / "moved")
    compiled.root = tmp_path / "moved"
    told = compiled.tell()
    assert told.missing == ""
    assert (told.loaded, told.compiled, told.warnings) == ALL_LOADED


def test_more_code_than_was_noted_is_no_change(compiled):
    """Another process compiles for other types: what was there is there."""
    more = compiled.tell("seven.tell(1.5, note=False)")
    assert (more.missing, more.loaded, more.compiled) == ("", 0, 2)
    assert compiled.tell().missing == ""
    again = compiled.tell("seven.tell(1.5, note=False)")
    assert (again.missing, again.loaded, again.compiled) == ("", 1, 0)


def test_code_for_other_types_under_the_same_name_is_not_run(compiled):
    """Should the digest in a file's name ever meet another one's."""
    compiled.tell("seven.tell(1.5)")
    of_eight = sorted(compiled.folder.glob("seven.eight-*.kernel"))
    assert len(of_eight) == 2
    one, other = (file.read_bytes() for file in of_eight)
    of_eight[0].write_bytes(other)
    of_eight[1].write_bytes(one)
    told = compiled.tell()
    assert (told.loaded, told.compiled, told.warnings) == (1, 1, [])


def test_a_function_in_a_file_that_is_not_named_is_not_kept(installed):
    """The folder's name stands for the sources of the kernels: others may change below it."""
    elsewhere = installed.root / "elsewhere.py"
    elsewhere.write_text("from fasaco_edge.kernels import jit\n@jit.kernel\ndef f(x): return x\n")
    installed.tell("import elsewhere; elsewhere.f(1); seven.tell()")
    assert not list(installed.folder.glob("elsewhere*"))


def test_numba_imported_first_with_other_folders_changes_nothing(installed, tmp_path):
    given = {"NUMBA_CACHE_LOCATOR_CLASSES": "InTreeCacheLocator"}
    told = installed.tell(before="import numba", env=given)
    assert told.folder == str(installed.folder)
    assert len(list(installed.folder.glob("*.kernel"))) == 2
    assert not list(tmp_path.rglob("*.nb[ci]"))


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


def test_twins_agree_without_the_compiler():
    """What is fine as machine code may overflow or fail in plain Python, and the reverse."""
    if os.environ.get("NUMBA_DISABLE_JIT") == "1":
        pytest.skip("this is the run without the compiler")
    # To rewrite assertions would take as long as some of these; what fails is shown all the same.
    plain = ["-p", "no:cacheprovider", "--assert=plain"]
    program = [sys.executable, "-m", "pytest", *plain, "tests/kernels"]
    done = subprocess.run(
        [*program, "tests/planners", "-k", "twin or equation"],
        cwd=ROOT,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=400,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    assert " passed" in done.stdout


LOOK = """\
import yaml, warnings
warnings.simplefilter("error")
from fasaco_edge.kernels.jit import kernel, numba
assert yaml.safe_load("a: 1")
import sys
assert sys.modules["yaml"] is yaml
numba.core.config.reload_config()
print(numba.config.DISABLE_JIT, int(numba.config.OPT))
"""


def test_a_numba_file_in_the_working_folder_is_ignored(tmp_path: Path):
    (tmp_path / ".numba_config.yaml").write_text("disable_jit: 1\nopt: 0\n")
    words = [sys.executable, "-P", "-c", LOOK]
    done = subprocess.run(
        words, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert done.stdout == "0 3\n", done.stderr


INTERRUPTED = """
import os, signal
from llvmlite.binding.executionengine import ExecutionEngine as Engine
import numpy as np
from fasaco_edge.kernels.lattice.polygons import count_in

def interrupted(callback):
    def called(*args):
        os.kill(os.getpid(), signal.SIGINT)
        return callback(*args)
    return called

Engine._find_module_ptr = interrupted(Engine._find_module_ptr)
signal.signal(signal.SIGINT, signal.default_int_handler)
try:
    count_in(np.zeros((1, 2), np.uint8), np.zeros(2, np.uint8))
except KeyboardInterrupt:
    print("interrupted")
"""


def test_ctrl_c_during_a_kernel_load_interrupts_without_a_crash():
    """LLVM takes the missing result of an interrupted callback for empty machine code."""
    words = [sys.executable, "-c", INTERRUPTED]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "interrupted\n", "")


SEVEN_THEN_EIGHT = """
assert seven.seven(1) == 7
for file in jit_folder.glob({gone!r}): file.unlink()
seven.more.clear()
seven.tell(note=False)
"""


def after_seven(gone):
    """A process that loads one kernel, then loses files, then needs the other, which calls it."""
    head = "from pathlib import Path\njit_folder = Path(seven.code_files.kernel_folder())\n"
    return head + SEVEN_THEN_EIGHT.format(gone=gone)


def test_what_was_loaded_is_taken_into_what_is_compiled_after_it(compiled):
    compiled.tell("assert seven.seven(1) == 7; seven.tell()")
    told = compiled.tell(after_seven("seven.eight-*.kernel"))
    assert (told.loaded, told.compiled, told.warnings) == (1, 1, [])
    assert len(list(compiled.folder.glob("seven.eight-*.kernel"))) == 1
    assert compiled.tell().loaded == 1


def test_a_loaded_kernel_stays_callable_once_its_file_is_gone(compiled):
    """As in a deleted folder: callers compiled now work, but are not kept."""
    compiled.tell("assert seven.seven(1) == 7; seven.tell()")
    told = compiled.tell(after_seven("*.kernel"))
    assert (told.loaded, told.compiled) == (1, 1)
    (warning,) = told.warnings
    assert warning.endswith("the compiled kernel is gone: others that need it are not kept")
    assert not list(compiled.folder.glob("*.kernel"))


WRITTEN_AGAIN = """
import shutil
from pathlib import Path
assert seven.seven(1) == 7
shutil.copyfile({other!r}, {file!r})
for eight in Path({file!r}).parent.glob("seven.eight-*"): eight.unlink()
seven.more.clear()
seven.tell(note=False)
"""


def test_a_kernel_file_replaced_meanwhile_is_not_linked_against(compiled, tmp_path):
    """As where two processes begin with an empty folder, and name their code differently.

    Code compiled against the new file was kept, and crashed each later process (SIGSEGV).
    """
    (file,) = compiled.folder.glob("seven.seven-*.kernel")
    first = file.read_bytes()
    file.unlink()
    others = "for _ in range(9): seven.jit.kernel(lambda x: x)(1)\n"
    compiled.tell(f"{others}assert seven.seven(1) == 7; seven.tell()")
    (other := tmp_path / "other").write_bytes(file.read_bytes())
    assert other.read_bytes() != first
    file.write_bytes(first)
    told = compiled.tell(WRITTEN_AGAIN.format(other=str(other), file=str(file)))
    (warning,) = told.warnings
    assert warning.endswith("written again by another process: others that need it are not kept")
    assert (told.loaded, told.compiled) == (1, 1)
    assert compiled.tell().warnings == []


def test_what_another_process_was_faster_with_stays(compiled):
    """Who has loaded it links it later, and reads it again for that."""
    (file,) = compiled.folder.glob("seven.seven-*.kernel")
    first = file.read_bytes()
    # It comes between the look and the compiling.
    late = "seven.seven._cache.load_overload = lambda *_: None\nseven.jit.kernel(lambda x: x)(1)\n"
    told = compiled.tell(f"{late}assert seven.seven(1) == 7; seven.tell(note=False)")
    assert (told.compiled, told.warnings) == (1, [])
    assert file.read_bytes() == first


ARRAYS = """
import sys
import numpy as np

@jit.kernel
def turned(x):
    y = x.copy()
    y[1:] = x[:-1]
    return y.sum()
"""


def test_functions_inside_a_kernel_bring_no_modules_along(installed):
    """numba's arrays and linear algebra took 6 MB, for environments that nothing looks into."""
    with (installed.package / "seven.py").open("a") as source:
        source.write(ARRAYS)
    code = (
        "assert seven.turned(seven.np.arange(4.0)) == 3.0; seven.more.append(seven.turned.stats)\n"
        "seven.said.append('numba.np.arraymath' in seven.sys.modules); seven.tell()"
    )
    assert told_by(installed.start(code)).compiled == 3
    again = told_by(installed.start(code))
    assert (again.loaded, again.compiled, again.warnings) == (2, 0, [False])
