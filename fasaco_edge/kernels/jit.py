"""How kernels are compiled; ``kernels.cache`` says where the compiled code is kept."""

import os
import sys
import warnings
from collections.abc import Callable
from typing import TypeVar

from fasaco_edge.kernels.cache import cache_folder, note_complete

Kernel = TypeVar("Kernel", bound=Callable[..., object])

CACHE_FOLDER = cache_folder()
if "numba" not in sys.modules:
    os.environ["NUMBA_CACHE_DIR"] = str(CACHE_FOLDER)

# numba takes settings from .numba_config.yaml in the working folder, which may be anybody's: at
# import, unless there is no reader of YAML, and before it compiles, unless no file has that name.
warnings.filterwarnings("ignore", "A Numba config file is found")
_yaml = sys.modules.get("yaml")
sys.modules["yaml"] = None  # type: ignore[assignment]
try:
    import numba  # (reads NUMBA_CACHE_DIR once, at import)
finally:
    del sys.modules["yaml"]
    if _yaml is not None:
        sys.modules["yaml"] = _yaml
numba.core.config._config_fname = os.devnull

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


def note_all_compiled() -> None:
    """Note that every kernel has been compiled by now, or loaded."""
    if not numba.config.DISABLE_JIT:
        note_complete(CACHE_FOLDER)
