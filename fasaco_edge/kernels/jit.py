"""Compilation of kernels, and the cache of compiled code.

numba's own cache is not used. It keeps an index beside the code of each function, which several
processes write: two that compile at once can leave one that leads to the code of other types; it
unpickles before anything is checked; and it is not written through. Here each piece of code is a
file by itself, named after function, types and processor, and sealed, so no process changes what
another one reads. ``kernels.cache`` has the folder of the files.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, cast

from fasaco_edge.kernels.cache import (
    KERNEL_SUFFIX,
    KERNELS,
    cache_folder,
    kernel_module,
    note_complete,
)
from fasaco_edge.kernels.sealed import UnsoundFileError, read_sealed, write_sealed

# numba takes settings from .numba_config.yaml in the working folder, which may be anybody's: at
# import, unless there is no reader of YAML, and before it compiles, unless no file has that name.
warnings.filterwarnings("ignore", "A Numba config file is found")
_yaml = sys.modules.get("yaml")
sys.modules["yaml"] = None  # type: ignore[assignment]
try:
    import numba
    from numba.core.compiler import CompileResult
    from numba.core.serialize import dumps
finally:
    del sys.modules["yaml"]
    if _yaml is not None:
        sys.modules["yaml"] = _yaml
numba.core.config._config_fname = os.devnull

if TYPE_CHECKING:
    from numba.core.codegen import CPUCodegen
    from numba.core.cpu import CPUContext
    from numba.core.dispatcher import Dispatcher

LOG = logging.getLogger(__name__)

Kernel = TypeVar("Kernel", bound=Callable[..., object])

CACHE_FOLDER = cache_folder()


class CacheFaults:
    """Faults of the cache that this process met; each kind is logged once as a warning.

    Attributes:
        failure: why a file could not be written; "" while all could be.
    """

    def __init__(self) -> None:
        self.failure = ""
        self._logged: set[str] = set()

    def cannot_load(self, file: Path, why: object) -> None:
        """Log that a file is damaged or cannot be rebuilt."""
        self._log("load", f"{file}: the compiled kernel {why}: it is compiled again")

    def cannot_keep(self, file: Path, error: OSError) -> None:
        """Log that nothing is kept."""
        self.failure = f"{file.parent} cannot be written: {error.strerror}"
        self._log("keep", f"{self.failure}: each process compiles its kernels anew")

    def _log(self, about: str, text: str) -> None:
        LOG.log(logging.DEBUG if about in self._logged else logging.WARNING, "%s", text)
        self._logged.add(about)


FAULTS = CacheFaults()
# Names of the files that this process has loaded or written.
_USED: set[str] = set()


class _KernelCache:
    """The code of one function, for numba: takes the place of ``numba.core.caching.Cache``."""

    def __init__(self, function: Callable[..., object], folder: Path) -> None:
        self.cache_path = str(folder)
        self._folder = folder
        code = function.__code__
        self._name = f"{kernel_module(Path(code.co_filename))}.{function.__qualname__}"
        self._line = code.co_firstlineno

    def load_overload(self, signature: object, target: CPUContext) -> object:
        """Return the result of compiling for ``signature``; None where it is missing or damaged.

        Whatever goes wrong here is only a reason to compile.
        """
        target.refresh()
        file = self._file(signature, target.codegen())
        if not os.path.lexists(file):
            return None
        try:
            kept_for, parts = pickle.loads(read_sealed(file))
            if kept_for != signature:
                return None
            result: object = CompileResult._rebuild(target, *parts)
        except UnsoundFileError as why:
            FAULTS.cannot_load(file, why)
            return None
        except Exception as error:
            # The file is sound, but numba cannot rebuild it.
            FAULTS.cannot_load(file, f"cannot be used ({type(error).__name__}: {error})")
            return None
        _USED.add(file.name)
        return result

    def save_overload(self, signature: object, result: CompileResult) -> None:
        """Keep what was compiled for ``signature``, where that can be."""
        if result.lifted or result.library.has_dynamic_globals:
            return
        file = self._file(signature, result.codegen)
        try:
            write_sealed(file, dumps((signature, result._reduce())))
        except OSError as error:
            FAULTS.cannot_keep(file, error)
        else:
            _USED.add(file.name)

    def flush(self) -> None:
        """Do nothing: code that is compiled again replaces its file."""

    def _file(self, signature: object, codegen: CPUCodegen) -> Path:
        words = [str(self._line), str(signature), *codegen.magic_tuple()]
        digest = hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]
        return self._folder / f"{self._name}-{digest}{KERNEL_SUFFIX}"


def _compiled(function: Kernel, compiler: Callable[[Kernel], Dispatcher]) -> Kernel:
    """Return ``function`` as a dispatcher that loads or compiles it on its first call."""
    compiled = compiler(function)
    # The folder's name is a hash of these files alone, and says nothing of closures.
    is_ours = KERNELS in Path(function.__code__.co_filename).parents
    is_named = is_ours and not function.__closure__
    if is_named and CACHE_FOLDER is not None and not numba.config.DISABLE_JIT:
        compiled._cache = _KernelCache(function, CACHE_FOLDER)  # type: ignore[attr-defined]
    return cast(Kernel, compiled)


# Nothing calls kernels from C: without that entry point they compile a fifth faster.
_compile = numba.njit(nogil=True, no_cfunc_wrapper=True)


def kernel(function: Kernel) -> Kernel:
    """Compile ``function`` on its first call; it runs without the interpreter lock."""
    return _compiled(function, _compile)


# Innermost loops allocate nothing. Without reference counts on the arrays they pass on, a
# loop of small functions runs four times as fast.
_compile_lean = numba.njit(nogil=True, no_cfunc_wrapper=True, _nrt=False)
_compile_into = numba.njit(nogil=True, forceinline=True, no_cfunc_wrapper=True, _nrt=False)


def lean_kernel(function: Kernel) -> Kernel:
    """Compile a kernel that allocates no array, nor does anything it calls."""
    return _compiled(function, _compile_lean)


def inlined(function: Kernel) -> Kernel:
    """Compile a small function without allocations into each kernel that calls it."""
    compiled: Kernel = _compile_into(function)
    return compiled


def note_all_compiled() -> None:
    """Record that every kernel has been compiled or loaded by now."""
    if not numba.config.DISABLE_JIT and CACHE_FOLDER is not None and not FAULTS.failure:
        note_complete(CACHE_FOLDER, _USED)
