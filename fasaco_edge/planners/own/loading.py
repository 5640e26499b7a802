"""Loading of a planner of the user's own by its place, and its exceptions as text.

A place is ``FILE.py:NAME``, or ``MODULE:NAME`` of a module that this interpreter can import. The
code runs with the rights of the process. This module imports no numba.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from fasaco_edge.errors import BadConfiguration, PlannerFailed
from fasaco_edge.host.files import check_plain
from fasaco_edge.text import shown

# Exceptions of the user's code. ``sys.exit()`` is included: it would look like a success.
RAISED = (Exception, SystemExit, GeneratorExit)
CALLED_WITH = "a planner is called with the problem alone, a class without arguments"
SHAPE = "FILE.py:NAME or MODULE:NAME"


@dataclass(frozen=True, slots=True)
class UserCode:
    """A planner of the user's own.

    Attributes:
        name: its name in figures.
        walk: takes a ``GridProblem`` and returns, or yields, cells (row, col) in order.
        file: the file that it is in; "" if unknown.
    """

    name: str
    walk: Callable[[Any], Iterable[Any]]
    file: str


def is_place(text: str) -> bool:
    """Return whether a text has the shape of a place."""
    source, _, name = text.rpartition(":")
    is_module = all(part.isidentifier() for part in source.split("."))
    return name.isidentifier() and (source.endswith(".py") or is_module)


def load(place: str) -> UserCode:
    """Return the planner at a place; its file is executed.

    Args:
        place: ``FILE.py:NAME`` or ``MODULE:NAME``.

    Raises:
        BadConfiguration: nothing, or no planner, is at this place.
        PlannerFailed: the file raised.
    """
    source, _, member = place.rpartition(":")
    said = f"--planner {place}"
    if not is_place(place):
        raise BadConfiguration(f"--planner must be {SHAPE}, got {shown(place)}")
    if source.endswith(".py"):
        module = _executed(Path(source).expanduser(), said, place)
    else:
        module = _imported(source, said, place)
    made_there = {
        name: value
        for name, value in vars(module).items()
        if callable(value) and getattr(value, "__module__", "") == module.__name__
    }
    if not hasattr(module, member):
        names = ", ".join(name for name in made_there if not name.startswith("_"))
        raise BadConfiguration(
            f"{said}: {module.__file__} has no {member!r}",
            hint=f"it has {names}" if names else "it has no function and no class at all",
        )
    name = f"{Path(source).name}:{member}"
    return user_code(getattr(module, member), name, said, str(module.__file__ or ""))


def user_code(planner: object, name: str = "", said: str = "planner", file: str = "") -> UserCode:
    """Return a planner from a function, an object with ``plan(problem)``, or its class.

    Args:
        planner: the object to check.
        name: its name in figures; "" for file and name.
        said: its name in messages.
        file: its file; "" to look it up.

    Raises:
        BadConfiguration: ``planner`` is none of these.
        PlannerFailed: an object of the class cannot be made.
    """
    of = planner if isinstance(planner, type) or hasattr(planner, "__code__") else type(planner)
    file = file or _file_of(of)
    name = name or f"{Path(file).name}:{getattr(of, '__name__', '')}"
    if isinstance(planner, type) and callable(getattr(planner, "plan", None)):
        try:
            planner = planner()
        except RAISED as error:
            raise failure(error, name, file) from error
    plan = getattr(planner, "plan", None)
    walk = plan if callable(plan) else planner
    if not callable(walk) or isinstance(walk, type):
        raise BadConfiguration(
            f"{said} must be a function, or a class with plan(self, problem), got {shown(planner)}",
            hint="it is called with the problem and returns cells (row, col) in order; a planner "
            "of the package is named by Search(planner=...)",
        )
    return UserCode(name, walk, file)


def _executed(file: Path, said: str, place: str) -> ModuleType:
    try:
        check_plain(file)
        source = file.read_bytes()
    except OSError as error:
        raise BadConfiguration(f"{said}: cannot read {file}: {error.strerror}") from error
    module = ModuleType("own_planner")
    module.__file__ = str(file)
    # Dataclasses look up the module of a class here.
    sys.modules[module.__name__] = module
    try:
        exec(compile(source, str(file), "exec"), module.__dict__)
    except RAISED as error:
        raise failure(error, place, str(file)) from error
    return module


def _imported(name: str, said: str, place: str) -> ModuleType:
    parts = name.split(".")
    file = ""
    try:
        for count in range(1, len(parts) + 1):
            # Looking up a part of the name imports the parts before it, which may fail.
            spec = importlib.util.find_spec(".".join(parts[:count]))
            if spec is None:
                raise _not_found(said, ".".join(parts[:count]))
            file = spec.origin or ""
        return importlib.import_module(name)
    except BadConfiguration:
        raise
    except RAISED as error:
        if isinstance(error, ModuleNotFoundError) and error.name in (name, parts[0]):
            raise _not_found(said, str(error.name)) from error
        raise failure(error, place, file) from error


def _not_found(said: str, name: str) -> BadConfiguration:
    return BadConfiguration(
        f"{said}: {sys.executable} finds no module {name!r}",
        hint=f"install it there, or name its folder in PYTHONPATH; ./{name}.py:NAME is a file",
    )


def _file_of(made: object) -> str:
    code = getattr(made, "__code__", None)
    if code is not None:
        return str(code.co_filename)
    module = sys.modules.get(getattr(made, "__module__", ""))
    return str(getattr(module, "__file__", None) or "")


def failure(error: BaseException, name: str, file: str) -> PlannerFailed:
    """Return an exception as text for the user: lines of the user's file, the innermost first.

    Args:
        error: the exception.
        name: name of the planner.
        file: the user's file.
    """
    if isinstance(error, SyntaxError) and error.filename == file:
        lines = f"\n  {file}:{error.lineno}: {(error.text or '').strip()}"
    else:
        lines = _lines_in(file, error)
    kind = type(error).__name__
    try:
        said = getattr(error, "msg", None) or str(error)
    except Exception:  # the user's exception class may itself fail
        said = "no message"
    return PlannerFailed(
        f"planner {name}: {kind}: {said}{lines}", hint=None if lines else CALLED_WITH
    )


def too_long(error: BaseException, name: str, file: str, most_s: float | None) -> PlannerFailed:
    """Return the error of a planner that took longer than ``most_s`` [s], with the place."""
    return PlannerFailed(
        f"planner {name}: no walk after {most_s:g} s, its budget{_lines_in(file, error)}",
        hint="let it end, or give it a larger budget: --budget, or budget_s of Search",
    )


def _lines_in(file: str, error: BaseException) -> str:
    """Return the lines of a file that an exception passed through, the innermost first."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if frame.filename == file]
    where = [f"{file}:{at.lineno}, in {at.name}: {at.line}" for at in reversed(own)]
    # A recursion would give a thousand equal lines.
    return "".join(f"\n  {line}" for line in where[:5])
