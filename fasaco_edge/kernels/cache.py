"""The folder of compiled kernels: where it is, whether it may be used, whether it is complete.

It is named after a hash of all kernel sources and of the compiler: changed kernels never use old
code. It holds one sealed file for each function, argument types and processor; and for each
processor a list of all that a mission needs, once all of it is compiled.

A cache is code. It is used only from a folder that nobody but root and this user could have
written, and each file in it is checked (``kernels.sealed``) before use; a damaged one counts as
missing and is compiled again. Where the user's cache cannot be used, a temporary folder is; where
there is none either, nothing is kept. An installation that brings compiled kernels along
(``kernels.release``) needs no such folder.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import json
import logging
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Set
from importlib import metadata
from pathlib import Path

from fasaco_edge.host.durable import make_folder, sync_folder
from fasaco_edge.host.files import why_not_trusted
from fasaco_edge.kernels import release
from fasaco_edge.kernels.release import COMPILERS, KERNEL_SUFFIX, sources_digest
from fasaco_edge.kernels.sealed import (
    MissingFileError,
    UnsoundFileError,
    read_sealed,
    sweep,
    write_sealed,
)

LOG = logging.getLogger(__name__)

# Free space to have: twice the size of the code of all kernels [MB].
NEEDED_MB = 20
_FOLDER = re.compile(r"kernels-[0-9a-f]{12}$")
_NOTE = "complete-"
# Then the number of the process that made it, and random letters.
_FRESH = "fasaco-edge-of-"
_WARNED: set[str] = set()


def code_digest(version_of: Callable[[str], str] = metadata.version) -> str:
    """Return a hash of the sources and of what compiles them, 12 hex digits."""
    compilers = [f"{name} {version_of(name)}" for name in COMPILERS]
    words = [sources_digest(), sys.version, *compilers]
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:12]


def wanted_folder(environ: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for compiled kernels, if it can be used.

    It is in the user's cache, or in ``NUMBA_CACHE_DIR``, where set (a systemd CacheDirectory, say).
    A user without a home has the temporary folder that others fall back to.
    """
    name, given = _name(), environ.get("NUMBA_CACHE_DIR")
    if not given:
        # A relative one would be another in each working folder; so would a ``~`` that no home
        # stands for, which expanduser leaves as it is: a container's user has no home.
        homes = environ.get("XDG_CACHE_HOME", ""), os.path.expanduser("~/.cache")
        home = next(filter(os.path.isabs, homes), None)
        if home is None:
            return _directly_in(Path(os.path.abspath(tempfile.gettempdir())), name)
        given = f"{home}/fasaco-edge"
    base = Path(os.path.abspath(given))
    if base.name.endswith(name):
        return base  # handed down by a process that has it
    return (base.parent if _FOLDER.match(base.name) else base) / name


def cache_folder() -> Path | None:
    """Return the folder that kernels come from: the installation's, or else the user's own.

    It is made if it was missing; None if none can be used.
    """
    return own_folder() if release.why_unusable() else release.FOLDER


def own_folder() -> Path | None:
    """Return the user's folder for compiled kernels, made if it was missing; None if none can be.

    A folder other than the wanted one is logged with the reason.
    """
    reasons: list[str] = []
    folder: Path | None
    for folder in _places(wanted_folder()):
        why = why_unusable(folder) or _make(folder)
        if not why:
            break
        reasons.append(why)
    else:
        folder = _fresh_folder()
    if reasons and reasons[0] not in _WARNED:
        _WARNED.add(reasons[0])
        kept = f"kept in {folder}" if folder else "not kept, each process compiles its own"
        LOG.warning("%s: compiled kernels are %s", reasons[0], kept)
    return folder


def _make(folder: Path) -> str:
    """Make it; return why it cannot be used, "" if it can: another process may have made it."""
    try:
        make_folder(folder, mode=0o700)
    except OSError as error:
        return f"{folder} cannot be made: {error.strerror}"
    return why_not_trusted(folder)


def usable_folder() -> tuple[Path, str]:
    """Return the folder that kernels come from, and why that is not the wanted one, "" if it is.

    Nothing is made. Where none can be used it is the wanted one.
    """
    if not release.why_unusable():
        return release.FOLDER, ""
    wanted, reason = wanted_folder(), ""
    for folder in _places(wanted):
        why = why_unusable(folder)
        if not why:
            return folder, reason
        reason = reason or why
    return wanted, reason


def why_unusable(folder: Path) -> str:
    """Return why this process cannot have its kernels in ``folder``; "" if it can.

    The folder need not be there yet.
    """
    if why := why_not_trusted(folder):
        return why
    there = folder
    # Not Path.exists, which raises what the disk may say for a moment.
    while not os.path.exists(there) and there != there.parent:
        there = there.parent
    why = _why_not_writable(there)
    # A complete folder need not be written.
    return why if why and missing_from(folder) else ""


def _why_not_writable(folder: Path) -> str:
    if not os.access(folder, os.W_OK):
        return f"{folder} cannot be written"
    try:
        disk = os.statvfs(folder)
    except OSError as error:
        return f"{folder}: {error.strerror}"
    is_full = disk.f_blocks > 0 and disk.f_bavail * disk.f_frsize < NEEDED_MB * 1e6
    if is_full or (disk.f_files > 0 and disk.f_favail == 0):
        return f"{folder} has less than {NEEDED_MB} MB free"
    return ""


def _name() -> str:
    return f"kernels-{code_digest()}"


def _places(wanted: Path) -> Iterator[Path]:
    yield wanted
    # A service's own, in memory: where the disk is full.
    if given := os.environ.get("RUNTIME_DIRECTORY", "").partition(":")[0]:
        yield Path(given) / wanted.name
    for base in _temporary()[:1]:
        if wanted.parent != base:
            yield _directly_in(base, wanted.name)


def _directly_in(base: Path, name: str) -> Path:
    """Return this user's folder directly in a sticky one, where nobody else can move it."""
    return base / f"fasaco-edge-{os.geteuid()}-{name}"


def _temporary() -> list[Path]:
    """Return the temporary folders in which nobody else can replace our files."""
    names = dict.fromkeys((os.path.abspath(tempfile.gettempdir()), "/tmp", "/var/tmp"))
    bases = map(Path, filter(os.path.isdir, names))
    return [base for base in bases if not why_not_trusted(base / "x")]


def _fresh_folder() -> Path | None:
    """Make a folder for this process and its children, removed at its end."""
    for base in _temporary():
        if why_unusable(base / _name()):
            continue
        _clear(base)
        try:
            made = Path(tempfile.mkdtemp(prefix=f"{_FRESH}{os.getpid()}-", dir=base))
            (folder := made / _name()).mkdir(0o700)
        except OSError:
            continue
        # A process that is forked off is not the one to remove it.
        atexit.register(_remove, made, os.getpid())
        os.environ["NUMBA_CACHE_DIR"] = str(folder)
        return folder
    return None


def _clear(base: Path) -> None:
    """Remove the folders of processes that were killed."""
    for abandoned in base.glob(f"{_FRESH}*"):
        maker = abandoned.name.removeprefix(_FRESH).partition("-")[0]
        with contextlib.suppress(OSError):  # another process may be doing it
            if abandoned.lstat().st_uid == os.geteuid() and not Path("/proc", maker).exists():
                shutil.rmtree(abandoned)


def _remove(folder: Path, maker: int) -> None:
    if os.getpid() == maker:
        shutil.rmtree(folder, ignore_errors=True)


def note_complete(folder: Path, used: Set[str] = frozenset()) -> None:
    """Record that all kernels are compiled, unless that is recorded already.

    Damaged files are removed; where nothing can be written, nothing is recorded, which is logged.

    Args:
        folder: where they are kept.
        used: names of the files that this process has loaded or written. Where one of them is not
            sound any more, or cannot be read, nothing is recorded: another process may compile it.
    """
    if not missing_from(folder):
        return
    ours = processor()
    try:
        files = [file.name for file in sweep(folder, f"*{KERNEL_SUFFIX}")]
        if lost := sorted(used - set(files)):
            LOG.warning("%s could not be read again: not noted as complete", folder / lost[0])
            return
        # The names are on the disk before the list of them.
        sync_folder(folder)
        note = json.dumps({"processor": ours, "files": files})
        write_sealed(_note_of(folder, ours), note.encode())
        sync_folder(folder)
    except OSError as error:
        LOG.warning("%s cannot be noted as complete: %s", folder, error.strerror)


def missing_from(folder: Path, user: int | None = None) -> str:
    """Return why kernels in ``folder`` would be compiled again; "" where none would.

    Those of the installation are looked at once a process.

    Args:
        folder: where they are kept.
        user: who would load them; without it this process's.
    """
    if folder == release.FOLDER:
        return release.why_unusable(user)
    if why := why_not_trusted(folder, user):
        return why
    try:
        note = json.loads(bytes(read_sealed(_note_of(folder, processor()), user)))
    except MissingFileError:
        return _never(folder, user)
    except UnsoundFileError as why_not:
        return f"the list of them {why_not}"
    for name in note["files"]:
        try:
            read_sealed(folder / name, user)
        except UnsoundFileError as why_not:
            return f"{name} {why_not}"
    return ""


def _never(folder: Path, user: int | None) -> str:
    try:
        for other in sorted(folder.glob(f"{_NOTE}*")):
            compiled_for = json.loads(bytes(read_sealed(other, user)))["processor"]
            return f"they were compiled for another processor, {compiled_for.partition(' ')[0]}"
    except (OSError, UnsoundFileError):
        pass  # it makes no difference
    return "they were never all compiled for this version"


def outdated(folder: Path) -> list[Path]:
    """Return this user's folders beside ``folder`` that hold code of other kernels."""
    beside = folder.parent.glob("kernels-*") if os.path.isdir(folder.parent) else ()
    return sorted(
        other
        for other in beside
        if _FOLDER.fullmatch(other.name)
        and other != folder
        and not other.is_symlink()
        and other.is_dir()
        and other.stat().st_uid == os.geteuid()
    )


def prune(folder: Path) -> tuple[int, float]:
    """Remove outdated folders; return how many they were and how much they held [MB]."""
    gone, size = 0, 0
    for other in outdated(folder):
        held = sum(file.lstat().st_size for file in other.rglob("*") if file.is_file())
        shutil.rmtree(other, ignore_errors=True)
        if not os.path.exists(other):
            gone, size = gone + 1, size + held
    return gone, round(size / 1e6, 1)


def processor() -> str:
    """Return what numba compiles for: the processor's name and its features."""
    import llvmlite.binding as llvm  # noqa: PLC0415  (takes a fifth of a second)

    given = os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NUMBA_CPU_FEATURES")
    name = given[0] or llvm.get_host_cpu_name()
    features = given[1] if given[1] is not None else llvm.get_host_cpu_features().flatten()
    return f"{name} {features}"


def _note_of(folder: Path, compiled_for: str) -> Path:
    return folder / f"{_NOTE}{hashlib.sha256(compiled_for.encode()).hexdigest()[:12]}"
