"""The folder of compiled kernels: its name and its place, and whether it may be used.

The folder is named after a hash of all kernel sources, the compilers and the processor: changed
kernels never use old code, and all installations of the same sources share the folder.

Compiled kernels are code. They are loaded only from a folder to which only root and this user can
write, and only if each file is as it was when it was compiled (``kernels.manifest``). If the wanted
folder cannot be used, a folder in memory or among the temporary files is used; if that
cannot be used either, each process compiles its own kernels.
"""

from __future__ import annotations

import hashlib
import logging
import os
import platform
import re
import secrets
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from importlib import metadata
from pathlib import Path

from fasaco_edge.host.files import why_not_trusted

LOG = logging.getLogger(__name__)

KERNELS = Path(__file__).parent
KERNEL_SOURCES = sorted(KERNELS.rglob("*.py"))
COMPILERS = ("numba", "llvmlite")
# Required free space: twice the size of the code of all kernels [MB].
NEEDED_MB = 100
_FOLDER = re.compile(r"kernels-[0-9a-f]{12}$")
# Keys of /proc/cpuinfo, see proc(5): model of the processor, and its features. Another version of
# the Linux kernel lists more or fewer features, but none that the processor lacks.
_PROCESSOR = ("model name", "CPU implementer", "CPU part", "CPU variant", "Features", "flags")
_INSTRUCTIONS = re.compile(r"(avx|v?aes|abm|adx|amx|bmi|f16c|fma|gfni|movbe|popcnt|s?sse|sha)")
_WARNED: set[str] = set()


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
    """Return a hash of the sources, the compilers and the processor, 12 hex digits."""
    compilers = [f"{name} {version_of(name)}" for name in COMPILERS]
    words = [sources_digest(), sys.version, *compilers, processor()]
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:12]


def processor(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """Return the processor that numba compiles for, as far as known without loading numba."""
    given = [os.environ.get(name, "") for name in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")]
    try:
        lines = cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    # Each kind of core counts once.
    found = set()
    for key, _, value in (line.partition(":") for line in lines):
        if (name := key.strip()) in _PROCESSOR:
            words = value.split()
            found.add(" ".join(filter(_INSTRUCTIONS.match, words) if name == "flags" else words))
    return "\n".join([platform.machine(), *given, *sorted(found)])


def wanted_folder(environ: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for compiled kernels, if it can be used.

    It is in the user's cache, or in ``NUMBA_CACHE_DIR``, where set (a systemd CacheDirectory, say).
    A user without a home gets the temporary folder that also replaces an unusable one.
    """
    name, given = f"kernels-{code_digest()}", environ.get("NUMBA_CACHE_DIR")
    if not given:
        # A relative path would name another folder in each working folder; so would a ``~`` that
        # expanduser keeps for a user without a home, as in a container.
        homes = environ.get("XDG_CACHE_HOME", ""), os.path.expanduser("~/.cache")
        home = next(filter(os.path.isabs, homes), None)
        if home is None:
            return _temporary(name)
        given = f"{home}/fasaco-edge"
    return Path(os.path.abspath(given)) / name


def temporary_folder() -> Path:
    """Return the first temporary folder in which no other user can replace our files, if any."""
    try:
        names = [os.path.abspath(tempfile.gettempdir()), "/tmp", "/var/tmp"]
    except FileNotFoundError:  # nothing can be written anywhere
        names = ["/tmp"]
    folders = map(Path, filter(os.path.isdir, names))
    safe = (folder for folder in folders if not why_not_trusted(unguessable(folder)))
    return next(safe, Path(names[0]))


def unguessable(folder: Path) -> Path:
    """Return a path in a folder where no other user can have put a file."""
    return folder / secrets.token_hex(16)


def _temporary(name: str) -> Path:
    """Return this user's folder directly in a sticky one, where no other user can move it."""
    return temporary_folder() / f"fasaco-edge-{os.geteuid()}-{name}"


def places() -> Iterator[Path]:
    """Yield the wanted folder, and its replacement: a service's own folder in memory, if given."""
    yield (wanted := wanted_folder())
    given = os.environ.get("RUNTIME_DIRECTORY", "").partition(":")[0]
    yield Path(given) / wanted.name if given else _temporary(wanted.name)


def why_not_writable(folder: Path) -> str:
    """Return why kernels cannot be compiled into a folder, existing or not; "" if they can."""
    if why := why_not_trusted(folder):
        return why
    # Not Path.exists, which raises transient errors of the disk.
    while not os.path.exists(folder) and folder != folder.parent:
        folder = folder.parent
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


def warn_of(why: str, folder: Path | None) -> None:
    """Log once why the wanted folder is not used, and where kernels are instead."""
    if why and why not in _WARNED:
        _WARNED.add(why)
        kept = f"kept in {folder}" if folder else "not kept, each process compiles its own"
        LOG.warning("%s: compiled kernels are %s", why, kept)


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
    """Remove outdated folders; return their number and their size [MB]."""
    gone, size = 0, 0
    for other in outdated(folder):
        held = sum(file.lstat().st_size for file in other.rglob("*") if file.is_file())
        shutil.rmtree(other, ignore_errors=True)
        if not os.path.exists(other):
            gone, size = gone + 1, size + held
    return gone, round(size / 1e6, 1)
