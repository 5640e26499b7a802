"""Decorators that compile a function on its first call, or load its code from numba's cache.

numba keeps code where ``KernelLocator`` says (``NUMBA_CACHE_LOCATOR_CLASSES``): all of it in one
folder (``kernels.folder``), which is compared with its manifest before the first kernel is loaded.
One process writes there, the one that compiles (``planners.compiling``). Any other process that
needs a kernel for further types compiles it for itself alone; that code is removed with the
process.

Import numba from here alone: a file in the working folder could change its settings otherwise.
"""

from __future__ import annotations

import functools
import logging
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, cast

from fasaco_edge.host.processes import ctrl_c_waits
from fasaco_edge.kernels.folder import (
    KERNELS,
    kernel_module,
    warn_of,
)
from fasaco_edge.kernels.manifest import (
    MANIFEST,
    UnsoundError,
    chosen_folder,
    read_manifest,
)
from fasaco_edge.kernels.scratch import scratch_folder

# numba takes settings from .numba_config.yaml in the working folder, which others may write, unless
# it finds no reader of YAML when it is imported.
warnings.filterwarnings("ignore", "A Numba config file is found")
_yaml = sys.modules.get("yaml")
sys.modules["yaml"] = None  # type: ignore[assignment]
try:
    import numba
    from llvmlite.binding import parse_bitcode
    from numba.core import event
    from numba.core.compiler_lock import global_compiler_lock
    from numba.extending import typeof_impl
finally:
    del sys.modules["yaml"]
    if _yaml is not None:
        sys.modules["yaml"] = _yaml

if TYPE_CHECKING:
    from numba.core.codegen import CPUCodeLibrary
    from numba.core.dispatcher import Dispatcher

LOG = logging.getLogger(__name__)

Kernel = TypeVar("Kernel", bound=Callable[..., object])


class _Kept:
    """Where this process loads its kernels from.

    Attributes:
        folder: folder of the kernels; None if none can be used.
        before_each: called before each kernel is compiled into the folder, with the number compiled
            before. None: this process does not compile into it.
        kernels: all kernels that are kept.
    """

    def __init__(self) -> None:
        self.folder, why = chosen_folder()
        warn_of(why, self.folder)
        self.before_each: Callable[[int], None] | None = None
        self.kernels: list[Dispatcher] = []
        self._packed: list[tuple[CPUCodeLibrary, bytes]] = []
        self._has_compiled = False
        self._is_sound = False
        self._why, self._seen = "", (0, 0)
        self._looking = threading.Lock()

    def look(self) -> None:
        """Load from the folder if it fits its manifest; check again once the manifest changes."""
        with self._looking:
            if self._is_sound or self.folder is None or self.before_each is not None:
                return
            if (seen := _mark_of(self.folder)) == self._seen:
                return
            self._seen, self._why = seen, ""
            try:
                read_manifest(self.folder, waiting=self._say_waiting)
                self._is_sound = True
            except UnsoundError as why:
                self._why = str(why)
            for kernel in self.kernels:
                _keep(kernel, KernelLocator if self._is_sound else ScratchLocator)

    def pack(self) -> None:
        """Keep the bitcode of loaded kernels as bytes; the caller holds the compiler's lock."""
        if self._has_compiled:
            return
        for library in [it.library for one in self.kernels for it in one.overloads.values()]:
            # Private to numba: a release without it only takes more memory.
            if (module := getattr(library, "_shared_module", None)) is not None:
                self._packed.append((library, module.as_bitcode()))
                library._shared_module = None

    def unpack(self) -> None:
        """Parse the bitcode again before a function is compiled that may call these kernels."""
        self._has_compiled = True
        while self._packed:
            library, bitcode = self._packed.pop()
            library._shared_module = parse_bitcode(bitcode)

    def log_compiling(self, kernel: Dispatcher) -> None:
        """Log that a kernel is compiled and not kept; the first time, also log why."""
        if why := self._why:
            LOG.warning("%s: %s: kernels are compiled for this process alone", self.folder, why)
            self._why = ""
        LOG.debug("%s is compiled for this process alone", kernel)

    def _say_waiting(self) -> None:
        LOG.warning("waiting for kernels that are compiled in %s", self.folder)


def _mark_of(folder: Path) -> tuple[int, int]:
    """Return a mark that differs once a folder has another manifest."""
    try:
        status = os.stat(folder / MANIFEST, follow_symlinks=False)
    except OSError:
        return -1, -1
    return status.st_ino, status.st_mtime_ns


class KernelLocator:
    """Where numba keeps the code of a kernel; see ``NUMBA_CACHE_LOCATOR_CLASSES``."""

    def __init__(self, function: Callable[..., object], file: str) -> None:
        line = function.__code__.co_firstlineno
        self._name = f"{kernel_module(Path(file))}-{line}"

    @classmethod
    def from_function(cls, function: Callable[..., object], file: str) -> KernelLocator:
        """Return the locator for a function of a file."""
        return cls(function, file)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(_KEPT.folder)

    def ensure_cache_path(self) -> None:
        """Do nothing: if this process writes to the folder, it exists."""

    def get_source_stamp(self) -> str:
        """Return a constant as the stamp of sources: the folder's name depends on all of them."""
        return ""

    def get_disambiguator(self) -> str:
        """Return the part of file names that distinguishes functions of one name."""
        return self._name


class ScratchLocator(KernelLocator):
    """Where numba keeps what this process alone compiles."""

    def get_cache_path(self) -> str:
        """Return the folder of this process."""
        return scratch_folder()


@contextmanager
def _located_by(locator: type[KernelLocator]) -> Iterator[None]:
    """Use this locator for functions that are decorated during the block."""
    before = numba.config.CACHE_LOCATOR_CLASSES
    numba.config.CACHE_LOCATOR_CLASSES = f"{__name__}.{locator.__name__}"
    try:
        yield
    finally:
        numba.config.CACHE_LOCATOR_CLASSES = before


def _keep(kernel: Dispatcher, locator: type[KernelLocator]) -> None:
    with _located_by(locator):
        kernel.enable_caching()


class _Compiling(event.Listener):  # type: ignore[misc]
    """Called for each kernel that numba does not find in its cache, before it is compiled."""

    def __init__(self) -> None:
        self._compiled = 0

    def on_start(self, event: event.Event) -> None:
        """Compile without keeping the code, unless this process compiles into the folder."""
        kernel = event.data["dispatcher"]
        _KEPT.unpack()
        if _KEPT.before_each is not None:
            _KEPT.before_each(self._compiled)
        elif kernel in _KEPT.kernels:
            _KEPT.log_compiling(kernel)
            _keep(kernel, ScratchLocator)

    def on_end(self, event: event.Event) -> None:
        """Count the kernel."""
        self._compiled += 1


class _Locking(event.Listener):  # type: ignore[misc]
    """Called around each call of the compiler, to load a kernel or to compile it."""

    def __init__(self) -> None:
        self._thread = threading.local()

    def on_start(self, event: event.Event) -> None:
        """Check the folder, and let Ctrl-C wait.

        LLVM calls Python back with machine code: an interrupt there loses the code, or crashes.
        """
        held = ExitStack()
        held.enter_context(ctrl_c_waits())
        self._held().append(held)
        _KEPT.look()

    def on_end(self, event: event.Event) -> None:
        """Raise the KeyboardInterrupt that came meanwhile."""
        self._held().pop().close()

    def _held(self) -> list[ExitStack]:
        if not hasattr(self._thread, "held"):
            self._thread.held = []
        return cast(list[ExitStack], self._thread.held)


_KEPT = _Kept()


@functools.cache
def _listen() -> None:
    event.register("numba:compile", _Compiling())
    event.register("numba:compiler_lock", _Locking())


def pack_loaded() -> None:
    """Take less memory for the kernels loaded so far: 40 MB less in a mission.

    numba keeps the parsed bitcode of each kernel that it loads, to link it into functions that are
    compiled later. A mission compiles none, because the warm-up has loaded all kernels. So this
    function keeps the bitcode as bytes. If a function is compiled after all, say for other types,
    all bitcode is first parsed again, in a quarter of a second.
    """
    with global_compiler_lock:
        _KEPT.pack()


def compile_into(folder: Path, before_each: Callable[[int], None]) -> None:
    """Have kernels that are compiled from now on kept in a folder, whose lock this process holds.

    Args:
        folder: the folder; call this before kernels are imported.
        before_each: called before each kernel is compiled, with the number compiled so far.
    """
    assert not _KEPT.kernels, "kernels have another folder already"
    _KEPT.folder, _KEPT.before_each = folder, before_each


class InnerKernel:
    """A kernel that only kernels call: without an entry from Python it compiles a quarter faster.

    Without that entry, a call of its machine code from Python would crash the process.
    """

    def __init__(self, compiled: Callable[..., object]) -> None:
        self.compiled = compiled

    def __call__(self, *_: object) -> object:
        """Refuse the call.

        Raises:
            TypeError: always.
        """
        raise TypeError(f"{self.compiled.__name__} is an inner kernel: only kernels can call it")


@typeof_impl.register(InnerKernel)  # type: ignore[untyped-decorator]
def _type_of_inner(inner: InnerKernel, _: object) -> object:
    """Return the type by which kernels call it."""
    return numba.typeof(inner.compiled)


def _compiled(function: Kernel, **options: bool) -> Kernel:
    # The folder's name is a hash of these files alone; the values in a closure are not in it.
    is_ours = KERNELS in Path(function.__code__.co_filename).parents
    is_kept = is_ours and not function.__closure__ and _KEPT.folder is not None
    with _located_by(KernelLocator):
        compiled = numba.njit(cache=is_kept, nogil=True, no_cfunc_wrapper=True, **options)(function)
    if is_kept and not numba.config.DISABLE_JIT:
        _KEPT.kernels.append(compiled)
        # Only once a kernel is decorated: numba takes its lock while it decorates, too.
        _listen()
    return cast(Kernel, compiled)


def _inner(compiled: Kernel) -> Kernel:
    return compiled if numba.config.DISABLE_JIT else cast(Kernel, InnerKernel(compiled))


def kernel(function: Kernel) -> Kernel:
    """Compile ``function`` on its first call; it runs without the interpreter lock.

    Without an entry point from C, which nothing needs, kernels compile a fifth faster.
    """
    return _compiled(function)


def lean_kernel(function: Kernel) -> Kernel:
    """Compile a kernel that allocates no array, neither itself nor in the kernels it calls.

    Without reference counts on the arrays that are passed on, a loop of small functions runs four
    times as fast.
    """
    return _compiled(function, _nrt=False)


def inner_kernel(function: Kernel) -> Kernel:
    """Compile a kernel that only kernels call, see ``InnerKernel``."""
    return _inner(_compiled(function, no_cpython_wrapper=True))


def lean_inner_kernel(function: Kernel) -> Kernel:
    """Compile an inner kernel that allocates no array, see ``lean_kernel``."""
    return _inner(_compiled(function, no_cpython_wrapper=True, _nrt=False))


def inlined(function: Kernel) -> Kernel:
    """Compile a small inner kernel without allocations into each kernel that calls it."""
    options = {"nogil": True, "forceinline": True, "no_cfunc_wrapper": True, "_nrt": False}
    return _inner(cast(Kernel, numba.njit(no_cpython_wrapper=True, **options)(function)))


@inlined
def as_value(number: int) -> int:
    """Return a constant as a value of its type, to call a large kernel with.

    In ``f(0)`` numba gives the constant a type of its own, and compiles ``f``, with all kernels
    that it calls, once for each constant.
    """
    return number + 0
