"""Tests of what has changed: ``make quick`` runs them.

``python -m tests.quick [FILE ...]`` prints the test files that have changed since the last commit,
and those that import a module that has; or those of the files named. Where these are few, tests
that import what imports the module are added. Campaigns and benchmarks run by themselves.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[1]
LEFT_OUT = {"campaigns", "benchmarks"}
# Fewer test files than this say too little of a change.
FEW = 4


def changed() -> list[str]:
    """Return the files that have changed since the last commit, new ones too."""
    commands = "diff --name-only HEAD", "ls-files --others --exclude-standard"
    return [
        name
        for command in commands
        for name in subprocess.run(
            ["git", *command.split()], cwd=ROOT, check=True, capture_output=True, text=True
        ).stdout.splitlines()
    ]


def affected_by(files: Iterable[str]) -> list[str]:
    """Return the test files that have to run after a change of some files, sorted."""
    imports = {module: _imports(file) for module, file in _modules()}
    seen = {_module(Path(name)) for name in files if name.endswith(".py")} & imports.keys()
    newest = set(seen)
    while newest and sum(map(_is_test, seen)) < FEW:
        newest = {module for module, names in imports.items() if names & newest} - seen
        seen |= newest
    return sorted(str(Path(*module.split("."))) + ".py" for module in seen if _is_test(module))


def _modules() -> Iterable[tuple[str, Path]]:
    for folder in ("fasaco_edge", "tests"):
        for file in (ROOT / folder).rglob("*.py"):
            path = file.relative_to(ROOT)
            if path.parts[1] not in LEFT_OUT:
                yield _module(path), file


def _module(path: Path) -> str:
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


def _is_test(module: str) -> bool:
    return module.startswith("tests.") and module.rpartition(".")[2].startswith("test_")


def _imports(file: Path) -> set[str]:
    """Return the modules that a file imports, and names in them, which may be modules."""
    found = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found.update(f"{node.module}.{name.name}" for name in node.names)
        elif isinstance(node, ast.Import):
            found.update(name.name for name in node.names)
    return found


if __name__ == "__main__":
    sys.stdout.writelines(f"{name}\n" for name in affected_by(sys.argv[1:] or changed()))
