"""The slow, obvious twin of the colony, which comes with the tests and not with a wheel."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from fasaco_edge.host.resources import folder

MODULE = "fasaco_edge_naive_twins"


def naive_file() -> Path | None:
    """Return the file of the naive twins; None where this is no source checkout."""
    try:
        file = folder("tests") / "naive.py"
    except FileNotFoundError:
        return None
    return file if file.is_file() else None


def load_naive(file: Path) -> ModuleType:
    """Import the twins from their file; the tests are no package on any path."""
    spec = importlib.util.spec_from_file_location(MODULE, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look their own module up by its name.
    sys.modules[MODULE] = module
    spec.loader.exec_module(module)
    return module
