"""A daemon for the tests of one file, and an outsider who talks to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from fasaco_edge.daemon.ledger.file import LedgerFile
from tests.support.ledgers import lane
from tests.support.outsider import Outsider
from tests.support.processes import Daemon, daemon_process


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with daemon_process(tmp_path_factory.mktemp("daemon")) as running:
        yield running


@pytest.fixture
def outsider(daemon: Daemon) -> Iterator[Outsider]:
    with Outsider(daemon.endpoint) as client:
        yield client


@pytest.fixture
def written(tmp_path: Path) -> Path:
    file = LedgerFile(tmp_path, "robot")
    for length in (3, 4):
        file.write(lane(length))
    return tmp_path
