"""Compiled kernels are kept and found again, and code of other sources is never run."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fasaco_edge.kernels import folder
from fasaco_edge.kernels.random import draw
from tests.kernels.installations import ALL_LOADED, COMPILES, PATIENCE_S
from tests.support.examples import PLAIN
from tests.support.inner import entry
from tests.support.processes import ENVIRONMENT

ROOT = Path(__file__).parents[2]


@pytest.fixture
def kernel_copy(tmp_path, monkeypatch):
    """The kernel sources as a copy that may be changed."""
    copied = tmp_path / "kernels"
    copied.mkdir()
    for source in folder.KERNEL_SOURCES:
        shutil.copy(source, copied)
    monkeypatch.setattr(folder, "KERNEL_SOURCES", sorted(copied.glob("*.py")))
    return copied


def test_every_kernel_source_counts(kernel_copy):
    seen = {folder.sources_digest()}
    for source in sorted(kernel_copy.glob("*.py")):
        source.write_text(source.read_text() + "\n# changed\n")
        seen.add(folder.sources_digest())
    assert len(seen) == 1 + len(list(kernel_copy.glob("*.py")))
    assert all(len(digest) == 12 for digest in seen)


def test_changed_sources_never_meet_the_code_of_others(compiled):
    source = compiled.package / "seven.py"
    source.write_text(source.read_text().replace("7 * x", "6 * x + x"))
    told = compiled.tell()
    assert (told.loaded, told.compiled) == (0, 2)
    assert not Path(told.folder).exists()


def test_code_for_another_processor_is_not_run(compiled):
    """As in a folder that was copied from another robot."""
    other = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    told = compiled.tell(env=other)
    assert (told.loaded, told.compiled) == (0, 2)
    shutil.copytree(compiled.folder, told.folder)
    told = compiled.tell(env=other)
    assert (told.loaded, told.compiled) == (0, 2)


def test_a_moved_installation_loads_the_code_of_the_same_sources(compiled, tmp_path):
    shutil.move(compiled.root, tmp_path / "moved")
    compiled.root = tmp_path / "moved"
    for source in compiled.root.rglob("*.py"):
        os.utime(source, (1, 1))
    assert compiled.tell().work == ALL_LOADED


def test_code_for_other_types_is_kept_for_one_process(compiled, tmp_path, monkeypatch):
    (tmp := tmp_path / "tmp").mkdir(0o700)
    before = sorted((file.name, file.stat().st_mtime_ns) for file in compiled.folder.iterdir())
    for _ in range(2):
        told = compiled.tell("seven.tell(1.5)", env={"TMPDIR": str(tmp)})
        assert told.work == (0, 2, [])
    after = sorted((file.name, file.stat().st_mtime_ns) for file in compiled.folder.iterdir())
    assert after == before
    assert list(tmp.iterdir()) == []


def test_what_a_killed_process_left_is_removed_and_nothing_in_use(compiled, tmp_path):
    (tmp := tmp_path / "tmp").mkdir(0o700)
    env = {"TMPDIR": str(tmp)}
    killed = compiled.start("import os; seven.tell(1.5); os.kill(os.getpid(), 9)", env=env)
    killed.communicate(timeout=PATIENCE_S)
    (left,) = tmp.iterdir()
    living = compiled.start("seven.tell(1.5); input()", env=env, stdin=subprocess.PIPE)
    assert living.stdout.readline()
    for folder_in_tmp in tmp.iterdir():
        os.utime(folder_in_tmp, (1, 1))
    compiled.tell("seven.tell(1.5)", env=env)
    (used,) = tmp.iterdir()
    assert used != left
    living.communicate("\n", timeout=PATIENCE_S)
    assert list(tmp.iterdir()) == []


PACKED = """
def parsed(): return next(iter(seven.seven.overloads.values())).library._shared_module

assert seven.seven(1) == 7
assert parsed() is not None
seven.jit.pack_loaded()
assert parsed() is None
"""
CALLS_IT = """
@seven.jit.kernel
def nine(x): return seven.seven(x) + 2 * x

assert nine(1) == 9
seven.jit.pack_loaded()
assert parsed() is not None
"""


def test_a_loaded_kernel_is_called_by_one_compiled_later(compiled):
    assert compiled.tell(f"{PACKED}{CALLS_IT}\nseven.tell()").work == (2, 0, [])


def test_other_types_are_added_by_who_compiles(compiled):
    assert compiled.tell("seven.noted.stages.clear(); seven.tell(1.5)", env=COMPILES).work == (
        0,
        2,
        [],
    )
    for code in ("seven.tell()", "seven.tell(1.5)"):
        told = compiled.tell(code)
        assert told.work == ALL_LOADED


def test_a_function_in_a_file_that_is_not_named_is_not_kept(installed):
    """The folder's name stands for the sources of the kernels: others may change below it."""
    elsewhere = installed.root / "elsewhere.py"
    elsewhere.write_text("from fasaco_edge.kernels import jit\n@jit.kernel\ndef f(x): return x\n")
    installed.tell("import elsewhere; elsewhere.f(1); seven.tell()", env=COMPILES)
    assert not list(installed.folder.glob("elsewhere*"))


def test_the_users_own_functions_are_kept_where_the_user_says(installed, tmp_path):
    """Of a program that has numba for itself: neither changes the other's settings."""
    (installed.root / "own.py").write_text(OWN)
    (installed.root / "__pycache__").mkdir(exist_ok=True)
    given = {"NUMBA_CACHE_LOCATOR_CLASSES": "InTreeCacheLocator"} | COMPILES
    told = installed.tell(OWN_AND_OURS, before="import numba", env=given)
    assert told.folder == str(installed.folder)
    assert len(list(installed.folder.glob("*.nbi"))) == 2
    assert len(list((installed.root / "__pycache__").glob("own.f-*.nbi"))) == 1


OWN = """
import numba
@numba.njit(cache=True)
def f(x): return x
"""
OWN_AND_OURS = "import own; own.f(1); seven.tell()"


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


@pytest.mark.skipif(PLAIN, reason="kernels are plain functions")
def test_an_inner_kernel_refuses_a_call_from_python():
    stream = np.array([1], np.uint64)
    with pytest.raises(TypeError, match="draw is an inner kernel"):
        draw(stream)
    assert entry(draw)(stream) > 0


INTERRUPTED = """
import os, signal
import numpy as np
from numba.core import event
from fasaco_edge.kernels.lattice.polygons import count_in

class Interrupt(event.Listener):
    def on_start(self, event):
        os.kill(os.getpid(), signal.SIGINT)
        came.append("still here")

    def on_end(self, event):
        pass

came = []
event.register("numba:compiler_lock", Interrupt())
signal.signal(signal.SIGINT, signal.default_int_handler)
try:
    count_in(np.zeros((1, 2), np.uint8), np.zeros(2, np.uint8))
except KeyboardInterrupt:
    print(came[0], count_in.signatures != [])
"""


def test_ctrl_c_while_a_kernel_is_loaded_waits_until_it_is_there():
    """LLVM takes what an interrupted callback did not return for a machine code without bytes."""
    words = [sys.executable, "-c", INTERRUPTED]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "still here True\n", "")
