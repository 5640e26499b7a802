"""A bus of one process, which others join."""

import pytest

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from tests.support.processes import free_endpoint


@pytest.fixture
def endpoint():
    return free_endpoint()


@pytest.fixture
def bus(endpoint):
    with open_bus(BusSettings("peer", (), (endpoint,))) as session:
        yield session
