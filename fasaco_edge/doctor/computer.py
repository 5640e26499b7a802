"""Checks of the computer: platform, clock, memory, space, permissions, compiled kernels."""

from __future__ import annotations

import ctypes
import os
import platform
import re
import stat
import struct
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fasaco_edge.daemon.ledger.file import lock_file, why_no_lock
from fasaco_edge.daemon.memory import has_default_sizes, limited_to_memory, limits_mib
from fasaco_edge.doctor.finding import CheckContext, Finding, Level, fail, ok, warn, worst
from fasaco_edge.host.durable import file_in_place_of
from fasaco_edge.host.files import why_not_trusted
from fasaco_edge.kernels.folder import outdated, wanted_folder
from fasaco_edge.kernels.manifest import why_missing
from fasaco_edge.planners.stages import STAGES

# Size of struct timex of adjtimex(2), and positions of its members [bytes].
TIMEX_BYTES, MAXERROR_AT, STATUS_AT = 208, 24, 40
STA_UNSYNC = 0x40
TIME_ERROR = 5
# Memory that a daemon needs at most to plan a large building [MB].
WANTED_MB = 350
# Least limit on pixels without a warning: those of a map of 100 m x 100 m at 5 cm.
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
    smaller = limited_to_memory(context.config, limit).map
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


# Least free space [MB]: the ledger takes a few hundred kilobytes, the kernels fifty megabytes.
LEAST_MB = {"state": 20.0, "kernel cache": 100.0}


def disk(context: CheckContext) -> Finding:
    """Check the free space where the daemon writes."""
    least_mb = LEAST_MB | {"recordings": float(context.config.recording.least_free_mb)}
    folders = _folders(context)
    spaces = [_space(name, folder, least_mb[name]) for name, folder in folders.items()]
    lock = lock_file(folders["state"], context.config.robot.name)
    if why := why_no_lock(lock):
        spaces.append(fail(f"no progress is written: {why}", f"remove {lock}"))
    bad = worst(spaces)
    details = tuple(space.found for space in spaces)
    if bad.level is Level.OK:
        return ok("there is space in each folder", details)
    return replace(bad, details=details)


def _folders(context: CheckContext) -> dict[str, Path]:
    environ = context.environ
    folders = {
        "state": context.config.mission.state_folder(environ),
        "kernel cache": wanted_folder(environ),
    }
    return folders | ({"recordings": context.recordings} if context.recordings else {})


def _space(name: str, folder: Path, least_mb: float) -> Finding:
    if (file := file_in_place_of(folder)) is not None:
        return fail(f"{name}: {folder}: {file} is not a folder", "name another folder")
    try:
        there = folder
        while not there.exists():
            there = there.parent
        system = os.statvfs(there)
    except OSError as error:
        return warn(f"{name}: {folder}: {error.strerror}", "run doctor as root")
    free_mb = system.f_bavail * system.f_frsize / 1e6
    found = f"{name}: {folder}: {free_mb:,.0f} MB free"
    if system.f_flag & os.ST_RDONLY:
        return fail(f"{found}, read-only", f"mount {there} for writing")
    if system.f_files and not system.f_favail:
        return fail(f"{found}, but no more files fit", "delete files there")
    if free_mb < least_mb:
        to_do = f"free {least_mb:.0f} MB in {there}"
        return Finding(Level.FAIL if free_mb < 1 else Level.WARN, found, to_do)
    return ok(found)


def permissions(context: CheckContext) -> Finding:
    """Check that others cannot read or write the daemon's own files."""
    faults = [*_config_faults(context), *_state_faults(context)]
    if not faults:
        return ok("others may neither change the configuration nor the state")
    first = worst(faults)
    return replace(first, details=tuple(fault.found for fault in faults if fault is not first))


def _config_faults(context: CheckContext) -> list[Finding]:
    file = context.file
    if file is None:
        return []
    faults = []
    mode = file.stat().st_mode
    if mode & stat.S_IWOTH:
        found = f"{file}: all users of this computer may change it"
        faults.append(fail(found, f"chmod o-w {file}"))
    bus = context.config.bus
    if mode & stat.S_IROTH and any("#" in endpoint for endpoint in (*bus.listen, *bus.connect)):
        found = f"{file}: an endpoint carries settings (#...), which all users here can read"
        to_do = f"chmod o-r {file}, or use bus.security, whose secrets are files of their own"
        faults.append(warn(found, to_do))
    return faults


def _state_faults(context: CheckContext) -> list[Finding]:
    folder = context.config.mission.state_folder(context.environ)
    try:
        status = folder.stat()
    except FileNotFoundError:
        return []  # the daemon creates it
    except OSError as error:
        # The folder of a service with its own user may be inside a folder that only root can read.
        return [ok(f"{folder}: {error.strerror}")] if context.unit else []
    if status.st_mode & stat.S_IWOTH:
        found = f"{folder}: all users of this computer may change what counts as covered"
        return [fail(found, f"chmod o-w {folder}")]
    if context.unit is None and not os.access(folder, os.W_OK):
        return [fail(f"{folder}: this user cannot write there", f"chown {folder}")]
    return []


def kernels(context: CheckContext) -> Finding:
    """Check that the kernels are compiled, whole, and safe from other users."""
    folder, user = wanted_folder(context.environ), _user(context)
    command = _warmup(context)
    later = "the first plan waits for them, some minutes"
    try:
        owner = folder.stat().st_uid
    except FileNotFoundError:
        if why := why_not_trusted(folder, user):
            return _distrusted(why)
        found = f"not compiled for this version in {folder.parent}: {later}"
        return warn(found, command)
    except OSError as error:
        return warn(f"{folder}: {error.strerror}", "run doctor as root")
    user = owner if user is None else user
    details = [f"{folder}, of user {owner}"]
    if old := outdated(folder):
        details.append(f"folders of other versions: {len(old)}; {command} --prune removes them")
    if why := why_not_trusted(folder, user):
        return _distrusted(why, details)
    if missing := why_missing(folder, STAGES, user):
        return warn(f"{missing}: {later}", command, details)
    found = "all there and whole, for this code and processor"
    return ok(found, details=details)


def _distrusted(why: str, details: Sequence[str] = ()) -> Finding:
    found = (
        f"{why}: the daemon takes no kernels from there, and keeps its own in a temporary folder"
    )
    to_do = "let only the daemon's user and root write there, or set NUMBA_CACHE_DIR"
    return warn(found, to_do, details)


def _warmup(context: CheckContext) -> str:
    """Return the command that compiles the kernels into the daemon's folder, as its user."""
    if context.unit is None:
        return "fasaco-edge warmup"
    given = context.environ.get("NUMBA_CACHE_DIR")
    variable = f"-E NUMBA_CACHE_DIR={given} " if given else ""
    return context.unit.run_as(f"{variable}{Path(sys.executable).with_name('fasaco-edge')} warmup")


def _user(context: CheckContext) -> int | None:
    """Return the daemon's user; None if systemd will choose one at the start."""
    if context.unit is None:
        return os.geteuid()
    pid = context.unit.pid
    return None if pid is None else (context.root / "proc" / str(pid)).stat().st_uid
