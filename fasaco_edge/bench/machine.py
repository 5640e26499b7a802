"""Where figures come from: without the machine they mean little."""

from __future__ import annotations

import os
import platform
import resource
from pathlib import Path
from typing import Any

from fasaco_edge import __version__


def machine() -> dict[str, Any]:
    """Return processor, cores, load, Python and package version as JSON values."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "load_1min": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "version": __version__,
    }


def peak_mb() -> float:
    """Return the most memory this process was ever resident with [MB]."""
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6, 1)


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        name, _, value = line.partition(":")
        if name.strip() in ("model name", "Model"):
            return value.strip()
    return platform.machine()
