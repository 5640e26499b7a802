"""Compiled kernels: whether the first plan has to wait for them."""

from __future__ import annotations

import os

from fasaco_edge.daemon.checks.finding import Finding, Level, Patient
from fasaco_edge.kernels.cache import candidates, missing_from, outdated


def kernels(patient: Patient) -> Finding:
    """Tell whether the kernels are there, for this code and processor, and whose they are."""
    folder = candidates(patient.environ)[0]
    given = patient.environ.get("NUMBA_CACHE_DIR")
    command = f"NUMBA_CACHE_DIR={given} fasaco-edge warmup" if given else "fasaco-edge warmup"
    later = "the first plan waits for them, up to a minute"
    try:
        owner = folder.stat().st_uid
    except FileNotFoundError:
        found = f"not compiled for this version in {folder.parent}: {later}"
        return Finding(Level.WARN, found, command)
    except OSError as error:
        return Finding(Level.WARN, f"{folder}: {error.strerror}", "run doctor as root")
    user = _user(patient)
    details = [f"{folder}, of user {owner}"]
    if old := outdated(folder):
        details.append(f"folders of other versions: {len(old)}; {command} --prune removes them")
    if user is not None and owner != user:
        found = f"{folder} is of user {owner}, the daemon is {user}: it does not trust it"
        return Finding(Level.WARN, found, f"chown -R {user} {folder}", tuple(details))
    if missing := missing_from(folder):
        return Finding(Level.WARN, f"{missing}: {later}", command, tuple(details))
    return Finding(Level.OK, "all compiled, for this code and processor", details=tuple(details))


def _user(patient: Patient) -> int | None:
    """Return the user the daemon runs as; None where systemd would choose one, and chown."""
    if patient.unit is None:
        return os.getuid()
    pid = patient.unit.pid
    return None if pid is None else (patient.root / "proc" / str(pid)).stat().st_uid
