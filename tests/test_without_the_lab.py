"""Tests of the lab are skipped on a machine that has only what `make test` installs."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
# What the extra 'lab' installs; its own dependencies are among the project's.
PACKAGES = ("irsim", "karto_scanmatcher", "scipy", "shapely")
MISSING = "raise ModuleNotFoundError(f'No module named {__name__!r}', name=__name__)\n"


def test_all_campaigns_can_be_collected(tmp_path):
    for package in PACKAGES:
        (tmp_path / f"{package}.py").write_text(MISSING)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "--collect-only", "-q", "tests/campaigns"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
