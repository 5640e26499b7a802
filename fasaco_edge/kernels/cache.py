"""Where the compiled code of the kernels is kept, and whether all of it is there.

numba keys its cache by the source file of the outermost function, so a caller keeps the old code
of a callee that changed in another file; and by its own version, not by that of llvmlite. The
folder is therefore named after a hash of all kernel sources and of what compiles them: changed
kernels never meet old code. Within the folder numba tells processors apart, by name and features:
code of another one that was copied here is not run, but compiled anew.
"""

import hashlib
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path

KERNELS = Path(__file__).parent
KERNEL_SOURCES = sorted(KERNELS.glob("*.py"))
COMPILERS = ("numba", "llvmlite")
_FOLDER = re.compile(r"kernels-[0-9a-f]{12}")


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


def candidates(environ: Mapping[str, str] = os.environ) -> tuple[Path, Path]:
    """Return the folder for compiled kernels, and the one to take where that cannot be had.

    The first is in the user's cache, or in ``NUMBA_CACHE_DIR``, where set (a systemd
    CacheDirectory, say).
    """
    name = f"kernels-{code_digest()}"
    given = environ.get("NUMBA_CACHE_DIR")
    home = environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    base = Path(given) if given else Path(home) / "fasaco-edge"
    if base.name.startswith("kernels-"):
        # Handed down by a process that set it below: not a folder within the folder.
        base = base.parent
    # Straight in the sticky temporary folder, where nobody else can move it away.
    return base / name, Path(tempfile.gettempdir()) / f"fasaco-edge-{os.getuid()}-{name}"


def cache_folder() -> Path:
    """Return the folder for compiled kernels, made where it was not there."""
    wanted, temporary = candidates()
    for folder in (wanted, temporary):
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError:
            continue
        if _is_ours(folder):
            return folder
    return wanted


def usable_folder() -> Path:
    """Return the folder that kernels come from as things are; nothing is made."""
    wanted, temporary = candidates()
    return next((folder for folder in (wanted, temporary) if _is_ours(folder)), wanted)


def _is_ours(folder: Path) -> bool:
    """Tell whether it may be used: a cache is code, one made by another user is not trusted."""
    try:
        return folder.stat().st_uid == os.getuid() and os.access(folder, os.W_OK)
    except OSError:
        return False


def note_complete(folder: Path) -> None:
    """Note that all kernels are there now; where nothing can be written, nothing is noted."""
    files = sorted(folder.glob("*/*.nb[ci]"))
    note = {
        "processor": processor(),
        "files": {str(file.relative_to(folder)): file.stat().st_size for file in files},
    }
    text, place = json.dumps(note), _note_of(folder)
    try:
        if not place.is_file() or place.read_text(encoding="utf-8") != text:
            partial = place.with_suffix(f".{os.getpid()}")
            partial.write_text(text, encoding="utf-8")
            partial.replace(place)
    except OSError:
        pass


def missing_from(folder: Path) -> str:
    """Return why kernels would be compiled that come from ``folder``; "" where none would."""
    try:
        note = json.loads(_note_of(folder).read_text(encoding="utf-8"))
        compiled_for, files = note["processor"], dict(note["files"])
    except FileNotFoundError:
        return "they were never all compiled for this installation"
    except OSError as error:
        return f"it cannot be read: {error.strerror}"
    except (ValueError, LookupError, TypeError):
        return "what is noted there cannot be read"
    changed = [name for name, size in files.items() if _size(folder / name) != size]
    if changed:
        return f"{changed[0]} has changed, or is gone"
    if compiled_for != processor():
        return f"they were compiled for another processor, {compiled_for.partition(' ')[0]}"
    return ""


def _size(file: Path) -> int | None:
    try:
        return file.stat().st_size
    except OSError:
        return None


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
        and other.stat().st_uid == os.getuid()
    )


def prune(folder: Path) -> tuple[int, float]:
    """Remove what is outdated; return how many folders that were, and how much they held [MB]."""
    gone, size = 0, 0
    for other in outdated(folder):
        held = sum(file.stat().st_size for file in other.glob("*/*") if file.is_file())
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


def _note_of(folder: Path) -> Path:
    """Return the note's place: an installation elsewhere has code of its own in the folder."""
    place = hashlib.sha256(str(KERNELS).encode()).hexdigest()[:12]
    return folder / f"complete-{place}.json"
