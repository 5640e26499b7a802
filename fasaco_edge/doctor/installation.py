"""Checks of the daemon's files on this computer: space for them, permissions, compiled kernels."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fasaco_edge.daemon.ledger.file import lock_file, why_no_lock
from fasaco_edge.doctor.finding import CheckContext, Finding, Level, fail, ok, warn, worst
from fasaco_edge.host.files import why_not_trusted
from fasaco_edge.kernels.folder import outdated, wanted_folder
from fasaco_edge.kernels.manifest import why_missing
from fasaco_edge.planners.stages import STAGES

# Least free space [MB]: the ledger takes a few hundred kilobytes, the kernels fifty megabytes.
LEAST_MB = {"state": 20.0, "kernel cache": 100.0}


def disk(context: CheckContext) -> Finding:
    """Check the free space where the daemon writes."""
    least_mb = LEAST_MB | {"recordings": float(context.config.recording.least_free_mb)}
    folders = _folders(context)
    rooms = [_room(name, folder, least_mb[name]) for name, folder in folders.items()]
    lock = lock_file(folders["state"], context.config.robot.name)
    if why := why_no_lock(lock):
        rooms.append(fail(f"no progress is written: {why}", f"remove {lock}"))
    bad = worst(rooms)
    details = tuple(room.found for room in rooms)
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


def _room(name: str, folder: Path, least_mb: float) -> Finding:
    try:
        there = folder
        while not there.exists():
            there = there.parent
        room = os.statvfs(there)
    except OSError as error:
        return warn(f"{name}: {folder}: {error.strerror}", "run doctor as root")
    free_mb = room.f_bavail * room.f_frsize / 1e6
    found = f"{name}: {folder}: {free_mb:,.0f} MB free"
    if room.f_flag & os.ST_RDONLY:
        return fail(f"{found}, read-only", f"mount {there} for writing")
    if room.f_files and not room.f_favail:
        return fail(f"{found}, but no file more", "delete files there")
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
        return []  # the daemon makes it
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
