"""How kernels are compiled, and where the compiled code is kept.

numba keys its cache by the source file of the outermost function, so a caller
keeps the old code of a callee that changed in another file. The cache folder
is therefore named after a hash of all kernel sources: changed kernels never
meet old code.
"""

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Kernel = TypeVar("Kernel", bound=Callable[..., object])

KERNEL_SOURCES = sorted(Path(__file__).parent.glob("*.py"))


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
        # Handed down by a process that set it below: not a folder within the folder.
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


CACHE_FOLDER = cache_folder()
if "numba" not in sys.modules:
    os.environ["NUMBA_CACHE_DIR"] = str(CACHE_FOLDER)

import numba  # noqa: E402  (reads NUMBA_CACHE_DIR once, at import)

numba.config.CACHE_DIR = str(CACHE_FOLDER)  # where numba was imported before us

# Nothing calls kernels from C: without that way in they are compiled a fifth faster.
_compile = numba.njit(cache=True, nogil=True, no_cfunc_wrapper=True)


def kernel(function: Kernel) -> Kernel:
    """Compile ``function`` on its first call; it runs without the interpreter lock."""
    compiled: Kernel = _compile(function)
    return compiled


# Innermost loops allocate nothing. Without reference counts on the arrays they
# hand on, a loop of small functions runs four times as fast.
_compile_lean = numba.njit(cache=True, nogil=True, no_cfunc_wrapper=True, _nrt=False)
_compile_into = numba.njit(nogil=True, forceinline=True, no_cfunc_wrapper=True, _nrt=False)


def lean_kernel(function: Kernel) -> Kernel:
    """Compile a kernel that allocates no array, nor does anything it calls."""
    compiled: Kernel = _compile_lean(function)
    return compiled


def inlined(function: Kernel) -> Kernel:
    """Compile a small function without allocations into each kernel that calls it."""
    compiled: Kernel = _compile_into(function)
    return compiled
