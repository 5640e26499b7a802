"""Commands run as a user runs them: processes of their own, with what they said."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import fasaco_edge as package

TIMEOUT_S = 400.0
PROGRAM = (sys.executable, "-m", "fasaco_edge")
# Found from any folder, installed or not.
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(package.__file__).parents[1])}


@dataclass(frozen=True)
class Ended:
    """How a command ended, and what it said."""

    code: int
    out: str
    err: str


def fasaco_edge(*words: object) -> Ended:
    """Run a command to its end; a traceback is never right."""
    command = [*PROGRAM, *(str(word) for word in words)]
    ended = subprocess.run(
        command, check=False, capture_output=True, text=True, timeout=TIMEOUT_S, env=ENVIRONMENT
    )
    assert "Traceback" not in ended.stderr, ended.stderr
    return Ended(ended.returncode, ended.stdout, ended.stderr)
