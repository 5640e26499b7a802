"""Installations of two small kernels, for the tests of their cache."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.kernels.installations import Installation


@pytest.fixture
def installed(tmp_path: Path) -> Installation:
    """One that has compiled nothing yet."""
    return Installation(tmp_path / "root", tmp_path / "cache")


@pytest.fixture(scope="session")
def _compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Installation:
    folder = tmp_path_factory.mktemp("compiled")
    installed = Installation(folder / "root", folder / "cache")
    assert installed.compile(umask=0o077).compiled == 2
    return installed


@pytest.fixture
def compiled(_compiled_once: Installation, tmp_path: Path) -> Installation:
    """One that has run before, and keeps what it compiled."""
    return _compiled_once.copy_to(tmp_path)
