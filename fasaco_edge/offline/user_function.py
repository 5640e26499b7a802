"""User functions: a function in a file that the command line names, and its exceptions.

It is never looked up in a configuration or in the working folder, and runs with the user's own
rights. Imports no numba.
"""

from __future__ import annotations

import sys
import traceback
from pathlib import Path
from types import FunctionType, ModuleType

from fasaco_edge.errors import BadConfiguration, PlannerFailed
from fasaco_edge.host.files import check_plain

# Exceptions of the user's code: ``sys.exit()`` there must not look as if a plan had been made.
RAISED = (Exception, SystemExit, GeneratorExit)


def load_function(place: str) -> FunctionType:
    """Return the function at ``FILE.py:FUNCTION``; the file is executed.

    Raises:
        BadConfiguration: there is no such file or function.
        PlannerFailed: the file raised.
    """
    name, _, member = place.rpartition(":")
    file = Path(name).expanduser()
    try:
        check_plain(file)
        source = file.read_bytes()
    except OSError as error:
        raise BadConfiguration(
            f"--planner {place}: cannot read {file}: {error.strerror}"
        ) from error
    module = ModuleType("own_planner")
    module.__file__ = str(file)
    # Dataclasses look up the module of a class here.
    sys.modules[module.__name__] = module
    try:
        exec(compile(source, str(file), "exec"), module.__dict__)
    except RAISED as error:
        raise failure(error, place, str(file)) from error
    functions = {name: value for name, value in vars(module).items() if type(value) is FunctionType}
    if member not in functions:
        raise BadConfiguration(
            f"--planner {place}: {file} has no function {member!r}",
            hint=f"it has {', '.join(functions)}" if functions else "it has none at all",
        )
    return functions[member]


def name_of(function: FunctionType) -> str:
    """Return a planner's name in figures: file and function."""
    return f"{Path(function.__code__.co_filename).name}:{function.__name__}"


def failure(error: BaseException, name: str, file: str) -> PlannerFailed:
    """Return an exception as text for the user: lines of his own file, the innermost first.

    Args:
        error: the exception.
        name: name of the planner.
        file: the user's file.
    """
    if isinstance(error, SyntaxError) and error.filename == file:
        where = [f"{file}:{error.lineno}: {(error.text or '').strip()}"]
    else:
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if frame.filename == file]
        where = [f"{file}:{at.lineno}, in {at.name}: {at.line}" for at in reversed(own)]
    kind = type(error).__name__
    try:
        said = getattr(error, "msg", None) or str(error)
    except Exception:  # the user's exception class may itself fail
        said = "says nothing"
    # A recursion would give a thousand equal lines.
    lines = "".join(f"\n  {line}" for line in where[:5])
    return PlannerFailed(f"planner {name}: {kind}: {said}{lines}")
