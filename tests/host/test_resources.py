"""Folders are found in a checkout and in an installed package, and nowhere else."""

import pytest

from fasaco_edge.host.resources import folder


def test_beside_the_package_in_a_checkout(tmp_path):
    (tmp_path / "pyproject.toml").touch()
    (tmp_path / "maps").mkdir()
    (tmp_path / "fasaco_edge" / "_share" / "maps").mkdir(parents=True)
    assert folder("maps", tmp_path / "fasaco_edge") == tmp_path / "maps"


def test_inside_an_installed_package_and_not_a_neighbours(tmp_path):
    (tmp_path / "maps").mkdir()
    inside = tmp_path / "fasaco_edge" / "_share" / "maps"
    inside.mkdir(parents=True)
    assert folder("maps", tmp_path / "fasaco_edge") == inside


def test_an_absent_resource_is_an_error(tmp_path):
    (tmp_path / "maps").mkdir()
    with pytest.raises(FileNotFoundError, match="no folder 'maps'"):
        folder("maps", tmp_path / "fasaco_edge")
