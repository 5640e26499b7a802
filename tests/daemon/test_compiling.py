"""The kernel compiler stays small: it goes on in a fresh process where it has grown."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from fasaco_edge.daemon.compiling import MODULE, REASON, STAGE
from fasaco_edge.kernels.cache import missing_from, own_folder
from fasaco_edge.planners.warmup import STAGES
from tests.support.processes import ENVIRONMENT

GROWN = f"import {MODULE} as compiling; compiling.MOST_MB = 0.0; compiling.main()"
# Small kernels that Python calls: what is loaded needs no others.
LOST = ("lattice.reach.update_reach-*", "bound.lines.lines_of-*")


def lose_some(folder: Path) -> None:
    """Remove a kernel of each of ``LOST``, and the list of them all."""
    for pattern in (*LOST, "complete-*"):
        min(folder.glob(pattern), key=lambda file: file.stat().st_size).unlink()


def test_compiling_continues_in_a_fresh_process_when_it_is_large(tmp_path):
    warm = own_folder()
    assert warm is not None
    folder = shutil.copytree(warm, tmp_path / warm.name)
    folder.chmod(0o700)
    lose_some(folder)
    done = subprocess.run(
        [sys.executable, "-c", GROWN],
        env=ENVIRONMENT | {"NUMBA_CACHE_DIR": str(folder)},
        capture_output=True,
        text=True,
        check=True,
    )
    said = [line.partition("\t")[0::2] for line in done.stdout.splitlines()]
    assert [word for word, _ in said].count(REASON) == 1
    assert said.count((STAGE, STAGES[0])) > 1
    assert said[-1] == (STAGE, STAGES[-1])
    assert missing_from(folder) == ""
