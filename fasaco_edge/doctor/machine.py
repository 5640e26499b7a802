"""Checks of the computer: platform, clock, memory."""

from __future__ import annotations

import ctypes
import os
import platform
import re
import struct
import time
from pathlib import Path

from fasaco_edge.daemon.memory import afforded, has_default_sizes, limits_mib
from fasaco_edge.doctor.finding import CheckContext, Finding, fail, ok, warn

# Size of struct timex of adjtimex(2), and positions of its members [bytes].
TIMEX_BYTES, MAXERROR_AT, STATUS_AT = 208, 24, 40
STA_UNSYNC = 0x40
TIME_ERROR = 5
# Memory that a daemon needs at most to plan a large building [MB].
WANTED_MB = 350
# A limit below this number of pixels is a warning: a map of 100 m x 100 m at 5 cm.
WANTED_PIXELS = 4_000_000
PI_CMDLINES = ("boot/firmware/cmdline.txt", "boot/cmdline.txt")


def system(context: CheckContext) -> Finding:
    """Name computer, system and Python; warn if planning has no core of its own."""
    cores = len(os.sched_getaffinity(0))
    # A board has a name; a PC is named after its processor.
    board = _read(context.root / "proc/device-tree/model").rstrip("\0\n")
    model = board or _field(context.root / "proc/cpuinfo", r"model name\s*: ")
    found = f"{model or platform.machine()}, {cores} cores; Python {platform.python_version()}"
    name = _field(context.root / "etc/os-release", "PRETTY_NAME=").strip('"') or "Linux"
    details = [f"{name}, kernel {platform.release()}, {platform.machine()}"]
    if cores == 1:
        to_do = "give the robot's controller a higher priority: the unit has Nice=10"
        return warn(f"{found}: planning shares it with everything else", to_do, details)
    return ok(found, details)


def clock(context: CheckContext) -> Finding:
    """Check the clock: recordings, certificates and stamps depend on it."""
    written = (Path(__file__)).stat().st_mtime
    now = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime())
    wait = "timedatectl set-ntp true, or wait for the network"
    if time.time() < written - 86_400:
        found = f"{now}, before this program was installed: the clock was reset"
        return fail(found, wait)
    kept = kernel_clock()
    if kept is None:
        return warn(f"{now}; it is not known whether it is synchronised", wait)
    is_synchronised, error_s = kept
    if is_synchronised or (context.root / "run/systemd/timesync/synchronized").exists():
        return ok(f"{now}, synchronised, off by at most {error_s:.3g} s")
    return warn(f"{now}, not synchronised", wait)


def kernel_clock() -> tuple[bool, float] | None:
    """Return whether the kernel's clock is synchronised, and its largest error [s]; read-only."""
    timex = ctypes.create_string_buffer(TIMEX_BYTES)
    try:
        state = ctypes.CDLL(None).adjtimex(timex)
    except (AttributeError, OSError):
        return None
    if state < 0:
        return None
    (error_us,) = struct.unpack_from("q", timex, MAXERROR_AT)
    (status,) = struct.unpack_from("i", timex, STATUS_AT)
    return state != TIME_ERROR and not status & STA_UNSYNC, error_us / 1e6


def _field(file: Path, before: str) -> str:
    """Return the rest of the first line that begins with ``before``; "" if there is none."""
    match = re.search(f"^{before}(.*)$", _read(file), re.MULTILINE)
    return match[1].strip() if match else ""


def memory(context: CheckContext) -> Finding:
    """Check the size of the memory, and whether limits on it are enforced."""
    total_mb, free_mb = _meminfo_mb(context.root, "Total"), _meminfo_mb(context.root, "Available")
    found = f"{free_mb:.0f} MB of {total_mb:.0f} MB free"
    version = controller(context.root)
    details = (_limits(context, version),)
    unit = context.unit
    limit = unit.limit("MemoryMax") if unit else None
    if version is None:
        holds = "limits of the unit are not enforced" if limit else "a limit would not be enforced"
        return warn(
            f"{found}; the memory controller is off: {holds}", _how_to_enable(context.root), details
        )
    if free_mb < WANTED_MB:
        to_do = "stop other programs, or plan with larger cells (robot.tool_width_m)"
        return warn(f"{found}; the daemon may need {WANTED_MB} MB", to_do, details)
    smaller = afforded(context.config, limit).map
    if limit and smaller is not context.config.map:
        high, most = limits_mib(context.config)
        found += f"; the unit's limit is {limit / 1e6:.0f} MB: maps of no more than "
        found += f"{smaller.max_pixels} pixels and {smaller.max_lattice_cells} cells are accepted"
        if has_default_sizes(context.config) and smaller.max_pixels >= WANTED_PIXELS:
            return ok(found, details)
        to_do = f"systemctl edit fasaco-edge: MemoryHigh={high}M, MemoryMax={most}M"
        return warn(found, to_do, details)
    return ok(found, details)


def controller(root: Path) -> int | None:
    """Return the version of control groups that limits memory; None if memory is not limited."""
    if "memory" in _read(root / "sys/fs/cgroup/cgroup.controllers").split():
        return 2
    # Version 1 lists the names of its controllers even if the kernel was built without them.
    enabled = re.search(r"^memory\s+\d+\s+\d+\s+1$", _read(root / "proc/cgroups"), re.MULTILINE)
    return 1 if enabled and (root / "sys/fs/cgroup/memory").is_dir() else None


def _limits(context: CheckContext, version: int | None) -> str:
    groups = f"control groups version {version}" if version else "no memory controller"
    if context.unit is None:
        return f"{groups}; no unit fasaco-edge.service here: nothing limits the daemon"
    limits = [
        f"{name} {'none' if limit is None else f'{limit / 1e6:.0f} MB'}"
        for name in ("MemoryHigh", "MemoryMax")
        for limit in [context.unit.limit(name)]
    ]
    return f"{groups}; of the unit: {', '.join(limits)}"


def _how_to_enable(root: Path) -> str:
    words = "cgroup_enable=memory"
    for place in PI_CMDLINES:
        if (root / place).is_file():
            return f"add {words} to the one line of /{place}, and reboot"
    return f"start the kernel with {words}"


def _meminfo_mb(root: Path, name: str) -> float:
    kilobytes = _field(root / "proc/meminfo", rf"Mem{name}:\s+").partition(" ")[0]
    return int(kilobytes or 0) * 1024 / 1e6


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except OSError:
        return ""
