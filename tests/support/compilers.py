"""Kernel compiler of a few small kernels, as a separate process."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from fasaco_edge.kernels.manifest import why_missing
from fasaco_edge.planners.compiling import MODULE
from fasaco_edge.planners.stages import WALKS
from tests.support.processes import ENVIRONMENT

# This stage compiles within seconds.
STAGES = (WALKS,)
COMPILE_S = 900.0


def compile_into(
    folder: Path, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Compile the kernels of ``STAGES`` into a folder."""
    words = [sys.executable, "-m", MODULE, str(folder), "0", *STAGES]
    return subprocess.run(
        words,
        env=ENVIRONMENT | dict(environment or {}),
        capture_output=True,
        text=True,
        check=False,
        timeout=COMPILE_S,
    )


def why_not_whole(folder: Path) -> str:
    """Return the missing kernels of ``STAGES``, or the temporary files, in a folder; "" if none."""
    return why_missing(folder, STAGES) or ", ".join(file.name for file in folder.glob("*.tmp.*"))
