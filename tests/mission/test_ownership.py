"""Each state of the mission has one owner: what an object holds is assigned by its own methods."""

import ast
import re
from pathlib import Path

import pytest

import fasaco_edge.mission

SOURCES = sorted(Path(fasaco_edge.mission.__path__[0]).rglob("*.py"))
# What a method may assign to: its object, a private part of it, and what it has just made.
OWN = re.compile(r"self(\._\w+)?|run|ledger|floor")


def foreign_assignments(source: str) -> list[str]:
    """The assignments to attributes of other objects, as ``line: target``."""
    found = []
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Assign(targets=targets):
                pass
            case ast.AugAssign(target=target) | ast.AnnAssign(target=target):
                targets = [target]
            case _:
                continue
        for target in targets:
            for part in ast.walk(target):
                if isinstance(part, ast.Attribute) and isinstance(part.ctx, ast.Store):
                    owner = ast.unparse(part.value)
                    if not OWN.fullmatch(owner) and part.attr != "writeable":
                        found.append(f"{part.lineno}: {ast.unparse(part)}")
    return found


def test_assignments_to_members_of_others_are_found():
    assert foreign_assignments("self.route.path = 1") == ["1: self.route.path"]
    assert foreign_assignments("a, parts.now = 1, 2") == ["1: parts.now"]
    assert foreign_assignments("route.plans += 1") == ["1: route.plans"]
    assert foreign_assignments("self.path = self._run.ending = 1") == []


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_state_is_assigned_only_by_its_owner(path):
    assert foreign_assignments(path.read_text(encoding="utf-8")) == []
