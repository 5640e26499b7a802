"""Memory, and who sees to it that the daemon takes no more than its share."""

from __future__ import annotations

import re
from pathlib import Path

from fasaco_edge.daemon.checks.finding import Finding, Level, Patient
from fasaco_edge.daemon.memory import afforded, limits_mib, needed_bytes

# A daemon with a plan of a large building takes less; what is free should do for it.
WANTED_MB = 350
PI_CMDLINES = ("boot/firmware/cmdline.txt", "boot/cmdline.txt")


def memory(patient: Patient) -> Finding:
    """Tell how much memory there is, and whether its limits hold."""
    total_mb, free_mb = _meminfo_mb(patient.root, "Total"), _meminfo_mb(patient.root, "Available")
    found = f"{free_mb:.0f} MB of {total_mb:.0f} MB free"
    version = controller(patient.root)
    details = (_told(patient, version),)
    unit = patient.unit
    limit = unit.limit("MemoryMax") if unit else None
    if version is None:
        holds = "limits of the unit do not hold" if limit else "no limit on memory would hold"
        return Finding(
            Level.WARN,
            f"{found}; the memory controller is off: {holds}",
            _how_to_enable(patient.root),
            details,
        )
    if free_mb < WANTED_MB:
        to_do = "end what else runs, or plan with larger cells (robot.tool_width_m)"
        return Finding(Level.WARN, f"{found}; the daemon may want {WANTED_MB} MB", to_do, details)
    if limit and limit < needed_bytes(patient.config):
        high, most = limits_mib(patient.config)
        smaller = afforded(patient.config, limit).map
        found += f"; the unit's limit is {limit / 1e6:.0f} MB: maps of no more than "
        found += f"{smaller.max_pixels} pixels and {smaller.max_lattice_cells} cells are taken"
        to_do = f"systemctl edit fasaco-edge: MemoryHigh={high}M, MemoryMax={most}M"
        return Finding(Level.WARN, found, to_do, details)
    return Finding(Level.OK, found, details=details)


def controller(root: Path) -> int | None:
    """Return which version of control groups limits memory; None where none does."""
    if "memory" in _read(root / "sys/fs/cgroup/cgroup.controllers").split():
        return 2
    # The names of version 1's stand there even where the kernel was told to leave them out.
    enabled = re.search(r"^memory\s+\d+\s+\d+\s+1$", _read(root / "proc/cgroups"), re.MULTILINE)
    return 1 if enabled and (root / "sys/fs/cgroup/memory").is_dir() else None


def _told(patient: Patient, version: int | None) -> str:
    groups = f"control groups version {version}" if version else "no memory controller"
    if patient.unit is None:
        return f"{groups}; no unit fasaco-edge.service here: nothing limits the daemon"
    limits = [
        f"{name} {'none' if limit is None else f'{limit / 1e6:.0f} MB'}"
        for name in ("MemoryHigh", "MemoryMax")
        for limit in [patient.unit.limit(name)]
    ]
    return f"{groups}; of the unit: {', '.join(limits)}"


def _how_to_enable(root: Path) -> str:
    words = "cgroup_enable=memory"
    for place in PI_CMDLINES:
        if (root / place).is_file():
            return f"add {words} to the one line of /{place}, and reboot"
    return f"start the kernel with {words}"


def _meminfo_mb(root: Path, name: str) -> float:
    match = re.search(rf"^Mem{name}:\s+(\d+) kB", _read(root / "proc/meminfo"), re.MULTILINE)
    return int(match[1]) * 1024 / 1e6 if match else 0.0


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except OSError:
        return ""
