"""One lab for all tests that need a real systemd; without the means for one they are skipped."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.deploy import installed
from tests.deploy.lab import Lab, booted, why_not
from tests.deploy.service import Service


@pytest.fixture(scope="session")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A lab in which this checkout is installed, with the kernels compiled."""
    reason = why_not() or installed.why_not()
    if reason:
        pytest.skip(reason)
    shown = installed.binds(tmp_path_factory.mktemp("installed"))
    with booted(tmp_path_factory.mktemp("lab"), shown) as running:
        installed.warm(running)
        yield running


@pytest.fixture
def service(lab: Lab) -> Iterator[Service]:
    unit = Service(lab)
    yield unit
    unit.remove()
