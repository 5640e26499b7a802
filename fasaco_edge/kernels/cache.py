"""Where the compiled code of the kernels is kept, and whether all of it is there.

The folder is named after a hash of all kernel sources and of what compiles them: changed kernels
never meet old code. In it lies one sealed file for each function, the types it is called with and
the processor; and for each processor a list of all that a mission needs, once that is there.

A cache is code. It is taken from a folder that nobody but root and this user could have written,
and each file in it is looked at (``kernels.sealed``) before it is used; what is not as it was
written counts as not there, and is compiled again. Where the user's cache will not do, a temporary
folder does, and where there is none either, nothing is kept.
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
from collections.abc import Callable, Iterator, Mapping
from importlib import metadata
from pathlib import Path

from fasaco_edge.host.durable import make_folder, sync_folder
from fasaco_edge.host.files import why_not_trusted
from fasaco_edge.kernels.sealed import UnsoundFileError, read_sealed, sweep, write_sealed

LOG = logging.getLogger(__name__)

KERNELS = Path(__file__).parent
KERNEL_SOURCES = sorted(KERNELS.rglob("*.py"))
COMPILERS = ("numba", "llvmlite")
# What the code of all kernels takes, twice over [MB].
ROOM_MB = 20
_FOLDER = re.compile(r"kernels-[0-9a-f]{12}$")
_NOTE = "complete-"
KERNEL_SUFFIX = ".kernel"
# Then the number of the process that made it, and what nobody foresees.
_FRESH = "fasaco-edge-of-"
_TOLD: set[str] = set()


def kernel_module(source: Path) -> str:
    """Return the name of a kernel source below ``fasaco_edge.kernels``, as ``ants.colony``."""
    return ".".join(source.relative_to(KERNELS).with_suffix("").parts)


def sources_digest() -> str:
    """Return a hash of every kernel source file, 12 hex digits: what the kernels compute."""
    digest = hashlib.sha256()
    for source in KERNEL_SOURCES:
        digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


def code_digest(version_of: Callable[[str], str] = metadata.version) -> str:
    """Return a hash of the sources and of what compiles them, 12 hex digits."""
    compilers = [f"{name} {version_of(name)}" for name in COMPILERS]
    words = [sources_digest(), sys.version, *compilers]
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:12]


def wanted_folder(environ: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for compiled kernels, where it will do.

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
            return _straight_in(Path(os.path.abspath(tempfile.gettempdir())), name)
        given = f"{home}/fasaco-edge"
    base = Path(os.path.abspath(given))
    if base.name.endswith(name):
        return base  # handed down by a process that has it
    return (base.parent if _FOLDER.match(base.name) else base) / name


def cache_folder() -> Path | None:
    """Return the folder for compiled kernels, made where it was not there.

    None where nothing can be kept. What is not as it was wished for is logged.
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
    if reasons and reasons[0] not in _TOLD:
        _TOLD.add(reasons[0])
        kept = f"kept in {folder}" if folder else "not kept, each process compiles them anew"
        LOG.warning("%s: compiled kernels are %s", reasons[0], kept)
    return folder


def _make(folder: Path) -> str:
    """Make it; return why it cannot be used then, "" if it can: somebody may have been faster."""
    try:
        make_folder(folder, mode=0o700)
    except OSError as error:
        return f"{folder} cannot be made: {error.strerror}"
    return why_not_trusted(folder)


def usable_folder() -> tuple[Path, str]:
    """Return the folder that kernels come from as things are, and why not the one wanted, if so.

    Nothing is made. Where none can be used it is the one wanted.
    """
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
    while not there.exists():
        there = there.parent
    why = _why_not_writable(there)
    # What is all there needs not be written.
    return why if why and missing_from(folder) else ""


def _why_not_writable(folder: Path) -> str:
    if not os.access(folder, os.W_OK):
        return f"{folder} cannot be written"
    try:
        room = os.statvfs(folder)
    except OSError as error:
        return f"{folder}: {error.strerror}"
    is_full = room.f_blocks > 0 and room.f_bavail * room.f_frsize < ROOM_MB * 1e6
    if is_full or (room.f_files > 0 and room.f_favail == 0):
        return f"{folder} has no room for {ROOM_MB} MB"
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
            yield _straight_in(base, wanted.name)


def _straight_in(base: Path, name: str) -> Path:
    """Return this user's folder in a sticky one, where nobody else can move it away."""
    return base / f"fasaco-edge-{os.geteuid()}-{name}"


def _temporary() -> list[Path]:
    """Return the temporary folders in which what is ours stays ours."""
    bases = dict.fromkeys((os.path.abspath(tempfile.gettempdir()), "/tmp", "/var/tmp"))
    return [base for base in map(Path, bases) if base.is_dir() and not why_not_trusted(base / "x")]


def _fresh_folder() -> Path | None:
    """Make a folder for this process and those that it starts, and that goes with it."""
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
    for left in base.glob(f"{_FRESH}*"):
        maker = left.name.removeprefix(_FRESH).partition("-")[0]
        with contextlib.suppress(OSError):  # somebody else may be doing it
            if left.lstat().st_uid == os.geteuid() and not Path("/proc", maker).exists():
                shutil.rmtree(left)


def _remove(folder: Path, maker: int) -> None:
    if os.getpid() == maker:
        shutil.rmtree(folder, ignore_errors=True)


def note_complete(folder: Path) -> None:
    """Note that all kernels are there now, where that is not noted yet.

    What cannot be used is removed; where nothing can be written, nothing is noted.
    """
    if not missing_from(folder):
        return
    ours = processor()
    try:
        files = [file.name for file in sweep(folder, f"*{KERNEL_SUFFIX}")]
        # The names are on the disk before the list of them.
        sync_folder(folder)
        note = json.dumps({"processor": ours, "files": files})
        write_sealed(_note_of(folder, ours), note.encode())
        sync_folder(folder)
    except OSError:
        pass


def missing_from(folder: Path, user: int | None = None) -> str:
    """Return why kernels would be compiled that come from ``folder``; "" where none would.

    Args:
        folder: where they are kept.
        user: who would load them; without it this process's.
    """
    if why := why_not_trusted(folder, user):
        return why
    place = _note_of(folder, processor())
    if not os.path.lexists(place):
        return _never(folder, user)
    try:
        note = json.loads(bytes(read_sealed(place, user)))
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
    """Return the folders beside ``folder`` that hold code of other kernels, and are ours."""
    beside = folder.parent.glob("kernels-*") if folder.parent.is_dir() else ()
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
    """Remove what is outdated; return how many folders that were, and how much they held [MB]."""
    gone, size = 0, 0
    for other in outdated(folder):
        held = sum(file.lstat().st_size for file in other.rglob("*") if file.is_file())
        shutil.rmtree(other, ignore_errors=True)
        if not other.exists():
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
