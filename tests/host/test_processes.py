"""Processes that others start import nothing of the working folder."""

import subprocess
import sys
from pathlib import Path

import pytest

TELL = """\
import subprocess
from fasaco_edge.host.processes import python_program
subprocess.run(python_program("platform"), check=True)
"""


@pytest.mark.parametrize("how", ["-P", "-I"])
def test_a_child_imports_nothing_of_the_working_folder(tmp_path: Path, how):
    (tmp_path / "fasaco_edge").mkdir()
    for name in ("platform.py", "json.py", "fasaco_edge/__init__.py"):
        (tmp_path / name).write_text("open('LOADED', 'w')\n")
    subprocess.run([sys.executable, how, "-c", TELL], cwd=tmp_path, check=True)
    assert not (tmp_path / "LOADED").exists()


def test_nobody_starts_a_module_otherwise():
    package = Path(__file__).parents[2] / "fasaco_edge"
    found = [
        file.name
        for file in package.rglob("*.py")
        if '"-m"' in file.read_text() and file.name != "processes.py"
    ]
    assert found == []
