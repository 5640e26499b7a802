"""Files of compiled code, one for each function and argument types; they replace numba's cache.

numba's own cache keeps an index beside the code of each function, which several processes write:
two that compile at once can leave one that leads to the code of other types; it unpickles before
anything is checked; and it is not written through. Here each piece of code is a file by itself,
named after function, types and processor, and sealed, so no process changes what another one reads.
``kernels.release`` has those that came with the installation, ``kernels.cache`` the folder of those
that were compiled here.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fasaco_edge.host.processes import ctrl_c_waits
from fasaco_edge.kernels import release
from fasaco_edge.kernels.cache import note_complete, own_folder
from fasaco_edge.kernels.compiler import (
    CompileResult,
    JITCodeLibrary,
    JITCPUCodegen,
    ModuleRef,
    dumps,
    know_runtime,
    numba,
    parse_assembly,
    parse_bitcode,
)
from fasaco_edge.kernels.release import ANY_PROCESSOR, KERNEL_SUFFIX, kernel_module
from fasaco_edge.kernels.sealed import (
    MissingFileError,
    UnsoundFileError,
    read_sealed,
    seal_of,
    write_sealed,
)

if TYPE_CHECKING:
    from numba.core.cpu import CPUContext

LOG = logging.getLogger(__name__)

_own_folder = functools.cache(own_folder)
# Chosen at once, so that processes which this one starts have the same; with kernels that came
# along only where one is missing there.
if release.why_unusable():
    _own_folder()


def kernel_folder() -> Path | None:
    """Return the folder that this process has its kernels from; None where none are kept."""
    return _own_folder() if release.why_unusable() else release.FOLDER


class CacheFaults:
    """Faults of the cache that this process met; each kind is logged once as a warning.

    Attributes:
        failure: why a file could not be written; "" while all could be.
        refused: files that were there, and could not be loaded.
        is_unlinked: whether code was compiled that calls other code, and is nothing without that.
    """

    def __init__(self) -> None:
        self.failure = ""
        self.refused: set[Path] = set()
        self.is_unlinked = False
        self._logged: set[str] = set()

    def cannot_load(self, file: Path, why: object) -> None:
        """Log that a file is damaged or cannot be rebuilt."""
        self.refused.add(file)
        self._log("load", f"{file}: the compiled kernel {why}: it is compiled again")

    def cannot_link(self, file: Path, why: object) -> None:
        """Log that what is compiled from now on is not kept."""
        self.is_unlinked = True
        self._log("link", f"{file}: the compiled kernel {why}: others that need it are not kept")

    def cannot_keep(self, file: Path, error: OSError) -> None:
        """Log that nothing is kept."""
        self.failure = f"{file.parent} cannot be written: {error.strerror}"
        self._log("keep", f"{self.failure}: each process compiles its own kernels")

    def _log(self, about: str, text: str) -> None:
        LOG.log(logging.DEBUG if about in self._logged else logging.WARNING, "%s", text)
        self._logged.add(about)


FAULTS = CacheFaults()
# Names of the files that this process has loaded or written.
_USED: set[str] = set()
# Called after each file that this process has written.
_AFTER_KEPT: list[Callable[[], None]] = []


class KernelCache:
    """The code of one function, for numba: takes the place of ``numba.core.caching.Cache``."""

    def __init__(self, function: Callable[..., object]) -> None:
        code = function.__code__
        self._name = f"{kernel_module(Path(code.co_filename))}.{function.__qualname__}"
        self._line = code.co_firstlineno

    @property
    def cache_path(self) -> str:
        """Where code comes from, for numba's statistics."""
        return str(kernel_folder())

    def load_overload(self, signature: object, target: CPUContext) -> object:
        """Return the result of compiling for ``signature``; None where it is missing or damaged.

        Whatever goes wrong here is only a reason to compile.
        """
        know_runtime()
        triple, *processor = target.codegen().magic_tuple()
        if not release.why_unusable():
            file = release.FOLDER / self._file_name(signature, triple, *ANY_PROCESSOR)
            if (result := _rebuilt(_KernelFile(file, signature), target)) is not None:
                return result
        if (folder := _own_folder()) is None:
            return None
        file = folder / self._file_name(signature, triple, *processor)
        result = _rebuilt(_KernelFile(file, signature), target)
        if result is not None:
            _USED.add(file.name)
        return result

    def save_overload(self, signature: object, result: CompileResult) -> None:
        """Keep what was compiled for ``signature``, where that can be."""
        if result.lifted or result.library.has_dynamic_globals or FAULTS.is_unlinked:
            return
        if (folder := _own_folder()) is None:
            return
        file = folder / self._file_name(signature, *result.codegen.magic_tuple())
        if file not in FAULTS.refused and _KernelFile(file, signature).is_there():
            # Another process was faster, and those that loaded its code read it again to link it.
            _USED.add(file.name)
            return
        try:
            # Without the annotated source, which is not used here: a fifth of all files, and
            # addresses in it, that differ from one process to the next.
            plain = result._replace(type_annotation="")
            write_sealed(file, dumps((signature, plain._reduce())))
        except OSError as error:
            FAULTS.cannot_keep(file, error)
        else:
            _USED.add(file.name)
            for call in _AFTER_KEPT:
                call()

    def flush(self) -> None:
        """Do nothing: code that is compiled again replaces its file."""

    def _file_name(self, signature: object, *target: str) -> str:
        words = [str(self._line), str(signature), *target]
        digest = hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]
        return f"{self._name}-{digest}{KERNEL_SUFFIX}"


class _KernelLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of a kernel; its bitcode is read where a kernel is compiled with it inside.

    numba parses the bitcode of all code that it loads, and keeps it: half the time that kernels
    take to load, and 5 MB, for nothing where none is compiled.
    """

    # What it was loaded from, and the seal that had.
    _origin: tuple[_KernelFile, bytes] | None = None
    _is_loaded = False

    @classmethod
    def _unserialize(
        cls, codegen: JITCPUCodegen, state: tuple[str, str, tuple[bytes, bytes]]
    ) -> _KernelLibrary:
        name, _, (machine_code, _) = state
        library = cls(codegen, name)
        library._is_loaded = True
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._finalize_final_module()
        return library

    def _finalize_specific(self) -> None:
        # LLVM calls back for the machine code: interrupted there, it goes on without, or crashes.
        with ctrl_c_waits():
            super()._finalize_specific()

    @functools.cached_property
    def _parsed(self) -> ModuleRef:
        assert self._origin is not None
        file, seal = self._origin
        try:
            found, ((_, _, (_, bitcode)), *_) = file.read()
            if found != seal:
                # Each process numbers functions in its own way: this code has other names.
                raise UnsoundFileError("was written again by another process")
        except UnsoundFileError as why:
            # Its machine code is here, and can be called as it is.
            FAULTS.cannot_link(file.path, why)
            return parse_assembly("")
        return parse_bitcode(bitcode)

    def _get_module_for_linking(self) -> ModuleRef:
        return super()._get_module_for_linking() if self._origin is None else self._parsed

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of ``name``, which loaded code has for sure."""
        if not self._is_loaded:
            return int(super().get_pointer_to_function(name))
        # numba's engine knows the names of what was parsed alone.
        return int(self._codegen._engine.get_function_address(name))


JITCPUCodegen._library_class = _KernelLibrary


class _KernelFile(NamedTuple):
    """A file with the code of a kernel for ``signature``."""

    path: Path
    signature: object

    def read(self) -> tuple[bytes, tuple[Any, ...]]:
        """Return its seal, and what numba made of the result of compiling.

        Raises:
            UnsoundFileError: it is gone, damaged, or of another signature.
        """
        payload = read_sealed(self.path)
        kept_for, parts = pickle.loads(payload)
        if kept_for != self.signature:
            raise MissingFileError("is for other types")
        return seal_of(payload), parts

    def is_there(self) -> bool:
        """Tell whether there is sound code in it."""
        try:
            return bool(self.read())
        except Exception:
            return False


def _rebuilt(file: _KernelFile, target: CPUContext) -> CompileResult | None:
    """Return the code in a file; None where there is none, or it cannot be used."""
    try:
        seal, parts = file.read()
        result = CompileResult._rebuild(target, *parts)
        result.library._origin = file, seal
    except MissingFileError:
        return None
    except UnsoundFileError as why:
        FAULTS.cannot_load(file.path, why)
        return None
    except Exception as error:
        # The file is sound, but numba cannot rebuild it.
        FAULTS.cannot_load(file.path, f"cannot be used ({type(error).__name__}: {error})")
        return None
    return result


def after_each_kept(call: Callable[[], None]) -> None:
    """Call ``call`` after each file that this process writes from now on, amid the compiling."""
    _AFTER_KEPT.append(call)


def note_all_compiled() -> None:
    """Record that every kernel has been compiled or loaded by now."""
    if numba.config.DISABLE_JIT or not release.why_unusable():
        return
    if FAULTS.failure or FAULTS.is_unlinked:
        return  # not all is kept
    if (folder := _own_folder()) is not None:
        note_complete(folder, _USED)
