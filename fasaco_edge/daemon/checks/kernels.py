"""Compiled kernels: whether the first plan has to wait for them."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from fasaco_edge.daemon.checks.finding import Finding, Level, Patient
from fasaco_edge.kernels.cache import missing_from, outdated, wanted_folder
from fasaco_edge.trust import why_not_trusted


def kernels(patient: Patient) -> Finding:
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


def _warmup(patient: Patient) -> str:
    """Return the command that compiles them into that folder, as the user who is to trust it."""
    if patient.unit is None:
        return "fasaco-edge warmup"
    given = patient.environ.get("NUMBA_CACHE_DIR")
    variable = f"-E NUMBA_CACHE_DIR={given} " if given else ""
    return patient.unit.run_as(f"{variable}{Path(sys.executable).with_name('fasaco-edge')} warmup")


def _user(patient: Patient) -> int | None:
    """Return the user the daemon runs as; None where systemd would choose one, and chown."""
    if patient.unit is None:
        return os.geteuid()
    pid = patient.unit.pid
    return None if pid is None else (patient.root / "proc" / str(pid)).stat().st_uid
