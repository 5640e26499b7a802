"""``warmup`` compiles all, and says truly whether all is there."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fasaco_edge.kernels.folder import code_digest
from fasaco_edge.kernels.manifest import MANIFEST
from fasaco_edge.planners.stages import STAGES, WALKS
from tests.kernels.harm import zeroed
from tests.kernels.installations import fill_with
from tests.support.processes import ENVIRONMENT, fasaco_edge

COUNT = """
import importlib
from fasaco_edge.kernels.folder import KERNEL_SOURCES, kernel_module
from fasaco_edge.planners.compiling import warm_up
warm_up()
modules = [importlib.import_module(f"fasaco_edge.kernels.{kernel_module(file)}")
           for file in KERNEL_SOURCES]
kernels = {id(k): k for m in modules for k in vars(m).values() if hasattr(k, "stats")}.values()
print(sum(sum(kernel.stats.cache_misses.values()) for kernel in kernels))
"""


@pytest.fixture(scope="module")
def ready():
    return json.loads(fasaco_edge("warmup", "--json").out)


def test_warmup_says_where_the_kernels_are():
    ended = fasaco_edge("warmup")
    assert ended.code == 0
    assert "kernels ready after" in ended.err
    assert "kernels-" in ended.err


def test_compiled_kernels_are_loaded_and_not_compiled_again(ready):
    assert ready["ready"] is True
    checked = fasaco_edge("warmup", "--check", "--json")
    assert checked.code == 0
    again = json.loads(checked.out)
    assert (again["ready"], again["folder"], again["seconds"]) == (True, ready["folder"], 0.0)
    counted = subprocess.run(
        [sys.executable, "-c", COUNT], env=ENVIRONMENT, capture_output=True, text=True, check=True
    )
    assert counted.stdout == "0\n"


def test_a_stage_that_is_missing_is_compiled(ready, tmp_path, monkeypatch):
    complete = Path(ready["folder"])
    folder = shutil.copytree(complete, tmp_path / complete.name)
    folder.chmod(0o700)
    noted = json.loads((folder / MANIFEST).read_text())
    noted["stages"].remove(WALKS)
    gone = [name for name in noted["files"] if name.startswith("walks.")]
    for name in gone:
        del noted["files"][name]
        (folder / name).unlink()
    (folder / MANIFEST).write_text(json.dumps(noted))
    monkeypatch.setitem(ENVIRONMENT, "NUMBA_CACHE_DIR", str(tmp_path))
    assert f"not compiled yet: {WALKS};" in fasaco_edge("warmup", "--check").err
    ended = fasaco_edge("warmup", "--json")
    assert ended.code == 0, ended
    told = json.loads(ended.out)
    assert (told["ready"], told["folder"]) == (True, str(folder))


def test_a_check_compiles_nothing_and_makes_no_folder(tmp_path, monkeypatch):
    monkeypatch.setitem(ENVIRONMENT, "NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    ended = fasaco_edge("warmup", "--check")
    assert ended.code == 1
    assert "kernels not ready: they were never compiled" in ended.err
    assert os.listdir(tmp_path) == []


def test_a_check_tells_what_is_damaged_and_what_is_not_trusted(tmp_path, monkeypatch):
    monkeypatch.setitem(ENVIRONMENT, "NUMBA_CACHE_DIR", str(tmp_path))
    folder = tmp_path / f"kernels-{code_digest()}"
    fill_with(tmp_path, 1, folder.name, STAGES)
    file = folder / "0.nbc"
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
    assert not_used == f"{folder} may be written by all users: not used"
    assert not_ready.startswith("kernels not ready: they were never compiled")
    assert f" in {temporary}/" in not_ready
    assert list(temporary.iterdir()) == []


def test_a_check_with_prune_removes_what_others_have_left(tmp_path, monkeypatch):
    monkeypatch.setitem(ENVIRONMENT, "NUMBA_CACHE_DIR", str(tmp_path))
    old = tmp_path / f"kernels-{'0' * 12}"
    old.mkdir()
    ended = fasaco_edge("warmup", "--check", "--prune", "--json")
    assert json.loads(ended.out)["removed"] == 1
    assert not old.exists()
