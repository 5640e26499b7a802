"""A daemon for the tests of one file, and an outsider who talks to it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.daemon.outsider import Outsider
from tests.daemon.processes import Daemon, daemon_process


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with daemon_process(tmp_path_factory.mktemp("daemon")) as running:
        yield running


@pytest.fixture
def outsider(daemon: Daemon) -> Iterator[Outsider]:
    with Outsider(daemon.endpoint) as client:
        yield client
