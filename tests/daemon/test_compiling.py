"""The kernel compiler stays small: it goes on in a fresh process where it has grown."""

from __future__ import annotations

import subprocess
import sys

from fasaco_edge.kernels.manifest import why_missing
from fasaco_edge.planners.compiling import MODULE, REASON, STAGE, WARNING
from fasaco_edge.planners.stages import AREAS, WALKS
from tests.support.processes import ENVIRONMENT

GROWN = f"import {MODULE} as it; it.MOST_MB, it.PLENTY_MB = 0.0, 1e9; it.main()"


def compiler_in(folder, *stages, **process):
    words = [sys.executable, "-c", GROWN, str(folder), "0", *stages]
    process = subprocess.run(
        words, env=ENVIRONMENT, capture_output=True, text=True, check=True, **process
    )
    return [line.partition("\t")[0::2] for line in process.stdout.splitlines()]


def test_compiling_continues_in_a_fresh_process_when_it_is_large(tmp_path):
    folder = tmp_path / "cache" / "kernels"
    said = compiler_in(folder, WALKS)
    assert [word for word, _ in said].count(REASON) == 1
    assert said.count((STAGE, WALKS)) > 1
    assert why_missing(folder, (WALKS,)) == ""
    assert why_missing(folder, (WALKS, AREAS)) == f"not compiled yet: {AREAS}"
    assert {file.stat().st_mode & 0o077 for file in (folder, *folder.iterdir())} == {0}
    assert compiler_in(folder, WALKS) == []


def test_a_folder_without_write_permission_is_a_warning(tmp_path):
    (tmp_path / "file").touch()
    ((word, text),) = compiler_in(tmp_path / "file" / "kernels", WALKS)
    assert word == WARNING
    assert text.endswith("each process compiles its own kernels")
