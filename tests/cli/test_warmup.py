"""``warmup`` compiles all, and says truly whether all is there."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fasaco_edge.kernels.cache import code_digest
from tests.kernels.harm import zeroed
from tests.kernels.installations import fill_with
from tests.support.processes import ENVIRONMENT, fasaco_edge

COUNT = """
import importlib
from fasaco_edge.kernels.release import KERNEL_SOURCES, kernel_module
from fasaco_edge.planners.warmup import warm_up
warm_up()
modules = [importlib.import_module(f"fasaco_edge.kernels.{kernel_module(file)}")
           for file in KERNEL_SOURCES]
kernels = {id(k): k for m in modules for k in vars(m).values() if hasattr(k, "stats")}.values()
print(sum(sum(kernel.stats.cache_misses.values()) for kernel in kernels))
"""


@pytest.fixture(scope="module")
def ready():
    """What a warm-up tells that found all kernels, or has compiled them."""
    return json.loads(fasaco_edge("warmup", "--json").out)


def test_warmup_says_where_the_kernels_are():
    ended = fasaco_edge("warmup")
    assert ended.code == 0
    assert "kernels ready after" in ended.err
    assert "kernels-" in ended.err


def test_what_is_ready_is_loaded_and_never_compiled(ready):
    assert ready["ready"] is True
    checked = fasaco_edge("warmup", "--check", "--json")
    assert checked.code == 0
    again = json.loads(checked.out)
    assert (again["ready"], again["folder"], again["seconds"]) == (True, ready["folder"], 0.0)
    counted = subprocess.run(
        [sys.executable, "-c", COUNT], env=ENVIRONMENT, capture_output=True, text=True, check=True
    )
    assert counted.stdout == "0\n"


def test_two_processes_compile_what_is_missing(ready, tmp_path, monkeypatch):
    complete = Path(ready["folder"])
    folder = tmp_path / complete.name
    shutil.copytree(complete, folder)
    # Of both ends; called from Python: who loads a kernel does not compile what that one calls.
    names = ("lattice.areas.cells_beside", "lattice.polygons.count_in", "ants.colony.deposit")
    missing = [file for name in names for file in folder.glob(f"{name}-*")]
    for file in [*missing, *folder.glob("complete-*")]:
        file.unlink()
    monkeypatch.setitem(ENVIRONMENT, "NUMBA_CACHE_DIR", str(tmp_path))
    ended = fasaco_edge("warmup", "--jobs", "2", "--json")
    assert ended.code == 0, ended
    told = json.loads(ended.out)
    assert (told["ready"], told["folder"]) == (True, str(folder))
    assert len(missing) >= len(names)
    assert all(file.exists() for file in missing)


def test_the_same_sources_make_the_same_code(ready):
    """The compiler names the code of an expression over whole arrays after an address."""
    folder = Path(ready["folder"])
    named = [
        file.name
        for file in folder.glob("*.kernel")
        if b"__numba_array_expr_0x" in file.read_bytes()
    ]
    assert named == [], "loop over the elements instead, or a release differs with each build"


def test_a_check_compiles_nothing_and_makes_no_folder(tmp_path, monkeypatch):
    monkeypatch.setitem(ENVIRONMENT, "NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    ended = fasaco_edge("warmup", "--check")
    assert ended.code == 1
    assert "kernels not ready: they were never all compiled" in ended.err
    assert os.listdir(tmp_path) == []


def test_a_check_tells_what_is_damaged_and_what_is_not_trusted(tmp_path, monkeypatch):
    monkeypatch.setitem(ENVIRONMENT, "NUMBA_CACHE_DIR", str(tmp_path))
    folder = tmp_path / f"kernels-{code_digest()}"
    file, _ = fill_with(tmp_path, 1, folder.name)
    assert fasaco_edge("warmup", "--check").err == f"kernels ready in {folder}\n"
    zeroed(file)
    ended = fasaco_edge("warmup", "--check")
    assert ended.code == 1
    assert ended.err == (
        f"kernels not ready: {file.name} is damaged; in {folder}: "
        "`fasaco-edge warmup` compiles them\n"
    )
    folder.chmod(0o777)
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    temporary.chmod(0o1777)
    monkeypatch.setitem(ENVIRONMENT, "TMPDIR", str(temporary))
    ended = fasaco_edge("warmup", "--check")
    assert ended.code == 1
    not_used, not_ready = ended.err.splitlines()
    assert not_used == f"{folder} may be written by everybody: not used"
    assert not_ready.startswith("kernels not ready: they were never all compiled")
    assert f" in {temporary}/" in not_ready
    assert list(temporary.iterdir()) == []


def test_a_check_with_prune_removes_what_others_have_left(tmp_path, monkeypatch):
    monkeypatch.setitem(ENVIRONMENT, "NUMBA_CACHE_DIR", str(tmp_path))
    old = tmp_path / f"kernels-{'0' * 12}"
    old.mkdir()
    ended = fasaco_edge("warmup", "--check", "--prune", "--json")
    assert json.loads(ended.out)["removed"] == 1
    assert not old.exists()
