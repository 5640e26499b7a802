"""Where compiled kernels are kept, and whether all of them are there.

numba keys its cache by the source file of the outermost function, so a caller
keeps the old code of a callee that changed in another file. The cache folder
is therefore named after a hash of all kernel sources: changed kernels never
meet old code. Nothing here needs numba, which takes 60 MB.
"""

import contextlib
import hashlib
import os
import platform
import re
import tempfile
from importlib import metadata
from pathlib import Path

KERNEL_SOURCES = sorted(Path(__file__).parent.glob("*.py"))
# Once every kernel is compiled, holds for what.
MARK = "complete"
# Lines of /proc/cpuinfo that say what code runs here; of x86-64, of aarch64.
CPU = re.compile(r"^(?:model name|flags|Features|CPU implementer|CPU part)\s*:.*$", re.MULTILINE)


def sources_digest() -> str:
    """Return a hash of every kernel source file, 12 hex digits."""
    digest = hashlib.sha256()
    for source in KERNEL_SOURCES:
        digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


def cache_folder() -> Path:
    """Return the folder for compiled kernels: the user's cache, or a temporary one.

    ``NUMBA_CACHE_DIR``, where set (a systemd CacheDirectory, say), takes the
    place of the user's cache folder.
    """
    name = f"kernels-{sources_digest()}"
    given = os.environ.get("NUMBA_CACHE_DIR")
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    base = Path(given) if given else Path(home) / "fasaco-edge"
    if base.name.startswith("kernels-"):
        # Handed down by a process that set it, see ``kernels.jit``: not a folder within the folder.
        base = base.parent
    # Straight in the sticky temporary folder, where nobody else can move it away.
    temporary = Path(tempfile.gettempdir()) / f"fasaco-edge-{os.getuid()}-{name}"
    for folder in (base / name, temporary):
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError:
            continue
        # A cache is code that will be run: one made by another user is not trusted.
        if folder.stat().st_uid == os.getuid() and os.access(folder, os.W_OK):
            return folder
    return base / name


def mark_complete(folder: Path) -> None:
    """Note that every kernel is in ``folder``, compiled for this very machine and these files."""
    # Without the mark they are only loaded once more to find that out.
    with contextlib.suppress(OSError):
        (folder / MARK).write_text(_made_for(), encoding="utf-8")


def is_complete(folder: Path) -> bool:
    """Tell whether every kernel was compiled into ``folder``, and none has to be again."""
    try:
        return (folder / MARK).read_text(encoding="utf-8") == _made_for()
    except (OSError, UnicodeDecodeError):
        return False


def _made_for() -> str:
    """Return all that decides whether numba takes a compiled kernel, or compiles it again."""
    try:
        cpus = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        cpus = platform.machine()
    cpu = sorted(set(CPU.findall(cpus)))
    files = [
        (str(source), source.stat().st_mtime_ns, source.stat().st_size) for source in KERNEL_SOURCES
    ]
    versions = [metadata.version(name) for name in ("numba", "llvmlite", "numpy")]
    settings = sorted(f"{k}={v}" for k, v in os.environ.items() if k.startswith("NUMBA_CPU"))
    words = [platform.python_version(), *versions, *cpu, *map(str, files), *settings]
    return hashlib.sha256("\n".join(words).encode()).hexdigest()
