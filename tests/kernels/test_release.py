"""Kernels that came with the installation are used as they are, or not at all."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from fasaco_edge.kernels.release import FOR_ANY_PROCESSOR, MANIFEST
from tests.kernels.harm import NOBODY, altered, cut, needs_root
from tests.kernels.installations import ALL_LOADED, Installation, Told

MAKE = "from fasaco_edge.kernels import release\nprint(release.write_manifest(release.FOLDER))"


@pytest.fixture(scope="session")
def _released_once(tmp_path_factory: pytest.TempPathFactory) -> Installation:
    folder = tmp_path_factory.mktemp("released")
    made = Installation(folder / "root", folder / "made")
    assert made.tell(env=FOR_ANY_PROCESSOR).compiled == 2
    place = place_in(made)
    place.mkdir(parents=True, mode=0o755)
    for file in made.folder.glob("*.kernel"):
        shutil.copy(file, place)
    process = made.start(MAKE)
    assert process.communicate(timeout=100) == ("2\n", "")
    shutil.rmtree(made.cache)
    made.cache.mkdir()
    return made


@pytest.fixture
def released(_released_once: Installation, tmp_path: Path) -> Installation:
    """One that came with compiled kernels, and has compiled nothing itself."""
    return _released_once.copy_to(tmp_path)


def place_in(installed: Installation) -> Path:
    return installed.root / "fasaco_edge/_share/kernels"


def change(installed: Installation, *path: str, to: object) -> None:
    """Change one value of the manifest."""
    file = place_in(installed) / MANIFEST
    document = json.loads(file.read_text())
    inner = document
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = to
    file.write_text(json.dumps(document))


def first_kernel(installed: Installation) -> Path:
    return min(place_in(installed).glob("*.kernel"))


def assert_compiled_here(told: Told, why: str) -> None:
    (warning,) = told.warnings
    assert warning == f"compiled kernels of this installation are not used: {why}"
    assert (told.loaded, told.compiled) == (0, 2)


def test_nothing_is_compiled_and_nothing_is_kept(released):
    told = released.tell()
    assert told.missing == ""
    assert told.folder == str(place_in(released))
    assert (told.loaded, told.compiled, told.warnings) == ALL_LOADED
    assert not list(released.cache.iterdir())


def test_they_are_used_where_nothing_can_be_written(released):
    for folder in (released.cache, place_in(released)):
        folder.chmod(0o555)
    told = released.tell(env={"HOME": "/nonexistent", "NUMBA_CACHE_DIR": "/proc/none"})
    assert (told.loaded, told.compiled, told.warnings) == ALL_LOADED


def test_code_for_other_types_is_kept_in_the_users_folder(released):
    for loaded, compiled in ((0, 2), (1, 0)):
        told = released.tell("seven.tell(1.5)")
        assert (told.loaded, told.compiled, told.warnings) == (loaded, compiled, [])
    assert len(list(released.folder.glob("*.kernel"))) == 2


@pytest.mark.parametrize("what", ["sources", "machine", "python", "numba", "llvmlite"])
def test_kernels_for_something_else_are_not_used(released, what):
    document = json.loads((place_in(released) / MANIFEST).read_text())
    here = document["made_for"][what]
    change(released, "made_for", what, to="another")
    assert_compiled_here(released.tell(), f"they are for {what} another, here is {here}")
    assert released.tell().loaded == 1


@pytest.mark.parametrize("harm", [altered(0.5), altered(0), cut(0.5), cut(0)])
def test_a_damaged_file_is_told_and_none_of_them_is_used(released, harm: Callable[[Path], None]):
    file = first_kernel(released)
    harm(file)
    assert_compiled_here(released.tell(), f"{file} is damaged")


def test_a_file_that_is_gone_is_told(released):
    file = first_kernel(released)
    file.unlink()
    assert_compiled_here(released.tell(), f"{file}: No such file or directory")


@pytest.mark.parametrize("text", ["", "[]", "{", '{"made_for": {}}', '{"made_for": 1, "files": 2}'])
def test_a_damaged_manifest_is_told(released, text):
    file = place_in(released) / MANIFEST
    file.write_text(text)
    assert_compiled_here(released.tell(), f"{file} is damaged")


def test_a_digest_that_was_changed_is_told(released):
    file = first_kernel(released)
    change(released, "files", file.name, to="0" * 64)
    assert_compiled_here(released.tell(), f"{file} is damaged")


def test_what_others_may_write_is_not_used(released):
    place_in(released).chmod(0o777)
    why = f"{place_in(released)} may be written by everybody"
    assert_compiled_here(released.tell(), why)


@needs_root
def test_what_somebody_else_wrote_is_not_used(released):
    file = first_kernel(released)
    os.chown(file, NOBODY, NOBODY)
    assert_compiled_here(released.tell(), f"{file} belongs to user nobody")
