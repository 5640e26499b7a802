"""Rerun's viewer, a program of its own."""

from __future__ import annotations

import importlib.util
import subprocess
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from fasaco_edge.errors import MissingExtra, ProcessEnded
from fasaco_edge.host.processes import python_program
from fasaco_edge.recording.read.frames import whole_part

# Its server would be open to the whole network else, and refuse to start beside another viewer.
VIEWER = python_program("rerun", "--bind", "127.0.0.1", "--port", "auto")


def view(paths: Sequence[Path]) -> None:
    """Show recordings until the viewer is closed; of torn ones what is whole.

    Raises:
        MissingExtra: rerun is not installed.
        ProcessEnded: the viewer cannot be shown, for want of a screen, say.
    """
    if importlib.util.find_spec("rerun") is None:
        raise MissingExtra("the viewer comes with rerun, which is not installed")
    with ExitStack() as copies:
        whole = [str(copies.enter_context(whole_part(path))[0]) for path in paths]
        ended = subprocess.run([*VIEWER, *whole], check=False)
    if ended.returncode:
        raise ProcessEnded(
            f"Rerun's viewer ended with {ended.returncode}",
            hint="it needs a screen: run it where there is one, or write --png or --html",
        )
