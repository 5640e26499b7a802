"""The feed of a live view on the bus."""

from __future__ import annotations

import pytest

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.client.feed import Feed
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topics import PHEROMONE
from tests.support.processes import free_endpoint
from tests.support.waiting import until


@pytest.fixture
def endpoint():
    return free_endpoint()


@pytest.mark.parametrize("early", [True, False])
def test_the_field_is_listened_to_only_while_it_is_shown(endpoint, early):
    """Also where somebody asks for it before the bus is joined."""
    with Feed(BusSettings("client", (endpoint,), ()), Keys()) as feed:
        if early:
            feed.want(PHEROMONE, True)
        with open_bus(BusSettings("peer", (), (endpoint,))) as bus:
            field = bus.advertise(Keys(), PHEROMONE)
            for _ in range(3):
                feed.want(PHEROMONE, True)
                until(field.has_listeners)
                field.put(b"field")
                until(lambda: ("pheromone", b"field") in payloads(feed))
                feed.want(PHEROMONE, False)
                until(lambda: not field.has_listeners())


def payloads(feed):
    return [(topic, getattr(item, "payload", b"")) for topic, item in feed.take(0.0)]
