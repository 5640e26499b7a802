"""Folders the daemon writes into, and files others must not.

Compiled kernels: whether the first plan has to wait for them.
"""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

from fasaco_edge.doctor.finding import CheckContext, Finding, Level, worst
from fasaco_edge.host.files import why_not_trusted
from fasaco_edge.kernels.cache import missing_from, outdated, wanted_folder

# The ledger takes some hundred kilobytes, the kernels ten megabytes.
LEAST_MB = {"state": 20.0, "kernel cache": 50.0}


def disk(patient: CheckContext) -> Finding:
    """Tell how much room there is where the daemon writes."""
    least_mb = LEAST_MB | {"recordings": float(patient.config.recording.least_free_mb)}
    rooms = [_room(name, folder, least_mb[name]) for name, folder in _folders(patient).items()]
    level = worst([room.level for room in rooms])
    bad = next((room for room in rooms if room.level is level), rooms[0])
    details = tuple(room.found for room in rooms)
    if level is Level.OK:
        return Finding(level, "there is room in each folder", details=details)
    return Finding(level, bad.found, bad.to_do, details)


def _folders(patient: CheckContext) -> dict[str, Path]:
    environ = patient.environ
    folders = {
        "state": patient.config.mission.state_folder(environ),
        "kernel cache": wanted_folder(environ),
    }
    return folders | ({"recordings": patient.recordings} if patient.recordings else {})


def _room(name: str, folder: Path, least_mb: float) -> Finding:
    try:
        there = folder
        while not there.exists():
            there = there.parent
        room = os.statvfs(there)
    except OSError as error:
        return Finding(Level.WARN, f"{name}: {folder}: {error.strerror}", "run doctor as root")
    free_mb = room.f_bavail * room.f_frsize / 1e6
    found = f"{name}: {folder}: {free_mb:,.0f} MB free"
    if room.f_flag & os.ST_RDONLY:
        return Finding(Level.FAIL, f"{found}, read-only", f"mount {there} for writing")
    if room.f_files and not room.f_favail:
        return Finding(Level.FAIL, f"{found}, but no file more", "delete files there")
    if free_mb < least_mb:
        to_do = f"make room for {least_mb:.0f} MB in {there}"
        return Finding(Level.FAIL if free_mb < 1 else Level.WARN, found, to_do)
    return Finding(Level.OK, found)


def permissions(patient: CheckContext) -> Finding:
    """Tell whether others may read or write what is the daemon's alone."""
    faults = [*_config_faults(patient), *_state_faults(patient)]
    if not faults:
        return Finding(Level.OK, "others may neither change the configuration nor the state")
    first = max(faults, key=lambda fault: list(Level).index(fault.level))
    details = tuple(fault.found for fault in faults if fault is not first)
    return Finding(first.level, first.found, first.to_do, details)


def _config_faults(patient: CheckContext) -> list[Finding]:
    file = patient.file
    if file is None:
        return []
    faults = []
    mode = file.stat().st_mode
    if mode & stat.S_IWOTH:
        found = f"{file}: everybody on this computer may change it"
        faults.append(Finding(Level.FAIL, found, f"chmod o-w {file}"))
    bus = patient.config.bus
    if mode & stat.S_IROTH and any("#" in endpoint for endpoint in (*bus.listen, *bus.connect)):
        found = f"{file}: an endpoint carries settings (#...), which everybody here can read"
        to_do = f"chmod o-r {file}, or use bus.security, whose secrets are files of their own"
        faults.append(Finding(Level.WARN, found, to_do))
    return faults


def _state_faults(patient: CheckContext) -> list[Finding]:
    folder = patient.config.mission.state_folder(patient.environ)
    try:
        status = folder.stat()
    except FileNotFoundError:
        return []  # the daemon makes it
    except OSError as error:
        # Of a service with a user of its own, in a folder that is root's alone.
        return [Finding(Level.OK, f"{folder}: {error.strerror}")] if patient.unit else []
    if status.st_mode & stat.S_IWOTH:
        found = f"{folder}: everybody on this computer may change what counts as covered"
        return [Finding(Level.FAIL, found, f"chmod o-w {folder}")]
    if patient.unit is None and not os.access(folder, os.W_OK):
        return [Finding(Level.FAIL, f"{folder}: this user cannot write there", f"chown {folder}")]
    return []


def kernels(patient: CheckContext) -> Finding:
    """Tell whether the kernels are there, whole, and where only the daemon could have put them."""
    folder, user = wanted_folder(patient.environ), _user(patient)
    command = _warmup(patient)
    later = "the first plan waits for them, up to a minute"
    try:
        owner = folder.stat().st_uid
    except FileNotFoundError:
        if why := why_not_trusted(folder, user):
            return _distrusted(why)
        found = f"not compiled for this version in {folder.parent}: {later}"
        return Finding(Level.WARN, found, command)
    except OSError as error:
        return Finding(Level.WARN, f"{folder}: {error.strerror}", "run doctor as root")
    user = owner if user is None else user
    details = [f"{folder}, of user {owner}"]
    if old := outdated(folder):
        details.append(f"folders of other versions: {len(old)}; {command} --prune removes them")
    if why := why_not_trusted(folder, user):
        return _distrusted(why, tuple(details))
    if missing := missing_from(folder, user):
        return Finding(Level.WARN, f"{missing}: {later}", command, tuple(details))
    found = "all there and whole, for this code and processor"
    return Finding(Level.OK, found, details=tuple(details))


def _distrusted(why: str, details: tuple[str, ...] = ()) -> Finding:
    found = (
        f"{why}: the daemon takes no kernels from there, and keeps its own in a temporary folder"
    )
    to_do = "let only the daemon's user and root write there, or set NUMBA_CACHE_DIR"
    return Finding(Level.WARN, found, to_do, details)


def _warmup(patient: CheckContext) -> str:
    """Return the command that compiles them into that folder, as the user who is to trust it."""
    if patient.unit is None:
        return "fasaco-edge warmup"
    given = patient.environ.get("NUMBA_CACHE_DIR")
    variable = f"-E NUMBA_CACHE_DIR={given} " if given else ""
    return patient.unit.run_as(f"{variable}{Path(sys.executable).with_name('fasaco-edge')} warmup")


def _user(patient: CheckContext) -> int | None:
    """Return the user the daemon runs as; None where systemd would choose one, and chown."""
    if patient.unit is None:
        return os.geteuid()
    pid = patient.unit.pid
    return None if pid is None else (patient.root / "proc" / str(pid)).stat().st_uid
