"""numba, the compiler of kernels, imported and adapted: settings, runtime, types of constants.

Import numba from here alone: a file in the working folder could change its settings otherwise.
"""

from __future__ import annotations

import functools
import os
import sys
import warnings
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

# numba takes settings from .numba_config.yaml in the working folder, which may be anybody's: at
# import, unless there is no reader of YAML, and before it compiles, unless no file has that name.
warnings.filterwarnings("ignore", "A Numba config file is found")
_yaml = sys.modules.get("yaml")
sys.modules["yaml"] = None  # type: ignore[assignment]
try:
    import numba
    from llvmlite.binding import ModuleRef, add_symbol, parse_assembly, parse_bitcode
    from numba.core import environment
    from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
    from numba.core.compiler import CompileResult
    from numba.core.runtime import _nrt_python
    from numba.core.serialize import dumps
    from numba.core.types.misc import unliteral
finally:
    del sys.modules["yaml"]
    if _yaml is not None:
        sys.modules["yaml"] = _yaml
numba.core.config._config_fname = os.devnull

if TYPE_CHECKING:
    from numba.core.dispatcher import Dispatcher

__all__ = [
    "CompileResult",
    "JITCPUCodegen",
    "JITCodeLibrary",
    "ModuleRef",
    "dumps",
    "know_runtime",
    "numba",
    "parse_assembly",
    "parse_bitcode",
    "take_constants_as_values",
]


def _environment(module: str, constants: list[object], name: str) -> environment.Environment:
    """Return what a kernel of a file needs to have at hand of a function that it has inside.

    numba imports the function's module for that, as of its own arrays and linear algebra, which
    take 6 MB. Of what has no constants, machine code never looks into it.
    """
    if constants or module in sys.modules or environment.lookup_environment(name) is not None:
        return _full_environment(module, constants, name)
    found = environment.Environment({"__name__": module})
    found.env_name = name
    environment.Environment._memo[name] = found
    return found


_full_environment = environment._rebuild_env
environment._rebuild_env = _environment


@functools.cache
def know_runtime() -> None:
    """Let loaded code find numba's runtime.

    ``rtsys.initialize`` does that, too, and compiles what is compiled into kernels of it: that goes
    through 30 MB of the compiler. It is called where something is compiled.
    """
    for name, address in _nrt_python.c_helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def take_constants_as_values(compiled: Dispatcher) -> None:
    """Let a constant argument be a value of its type, where a kernel calls another one.

    numba types it as ``Literal[int](0)`` and compiles the callee, and all that it calls in turn,
    once for each combination of constants: eight times the gain of a move, two fifths of all code.
    """
    template_of = compiled.get_call_template

    def of_values(args: Iterable[object], kws: Mapping[str, object]) -> object:
        plain = {name: unliteral(of_type) for name, of_type in kws.items()}
        return template_of([unliteral(of_type) for of_type in args], plain)

    compiled.get_call_template = of_values  # type: ignore[assignment,method-assign]
