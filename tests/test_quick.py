"""``tests.quick``: which tests a change of some files runs."""

from __future__ import annotations

from tests.quick import FEW, affected_by


def test_a_module_runs_the_tests_that_import_it():
    chosen = affected_by(["fasaco_edge/wire/messages/poses.py", "README.md"])
    assert "tests/wire/test_round_trips.py" in chosen
    assert len(chosen) < 20


def test_a_module_without_tests_runs_those_of_its_users():
    chosen = affected_by(["fasaco_edge/mission/core/executive.py"])
    assert len(chosen) >= FEW
    assert all(name.startswith("tests/") for name in chosen)


def test_a_changed_test_runs_itself():
    assert affected_by(["tests/test_quick.py"]) == ["tests/test_quick.py"]


def test_without_a_changed_module_no_test_runs():
    assert affected_by(["README.md", "tests/test_gone.py"]) == []
