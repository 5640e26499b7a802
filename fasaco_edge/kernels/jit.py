"""Decorators that compile a function on its first call, or load its code from a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, cast

from fasaco_edge.kernels.code_files import KernelCache
from fasaco_edge.kernels.compiler import numba, take_constants_as_values
from fasaco_edge.kernels.release import KERNELS

if TYPE_CHECKING:
    from numba.core.dispatcher import Dispatcher

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def _compiled(function: Kernel, compiler: Callable[[Kernel], Dispatcher]) -> Kernel:
    """Return ``function`` as a dispatcher that loads or compiles it on its first call."""
    compiled = compiler(function)
    if not numba.config.DISABLE_JIT:
        take_constants_as_values(compiled)
    # The folder's name is a hash of these files alone, and says nothing of closures.
    is_ours = KERNELS in Path(function.__code__.co_filename).parents
    is_named = is_ours and not function.__closure__
    if is_named and not numba.config.DISABLE_JIT:
        compiled._cache = KernelCache(function)  # type: ignore[attr-defined]
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
    compiled = _compile_into(function)
    if not numba.config.DISABLE_JIT:
        take_constants_as_values(compiled)
    return cast(Kernel, compiled)
