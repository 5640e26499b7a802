"""What comes in broken costs that sample, and nothing else."""

from __future__ import annotations

import time

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.daemon.loop.inbox import ASK_FOR_MAP_S
from fasaco_edge.wire.topics import QOS
from tests.campaigns.fuzz_daemon import run_campaign
from tests.support.rooms import map_bytes, room, update_bytes

# The full campaign sends ten thousand: `python -m tests.campaigns.fuzz_daemon`.
SAMPLES = 600


def test_broken_samples_change_nothing(daemon):
    pid = daemon.pid
    figures = run_campaign(daemon, SAMPLES, seed=time.time_ns() % 1000)
    print(figures)
    assert daemon.pid == pid
    assert figures["counted"]["map_update"] == figures["sent"]["map_update"] == SAMPLES // 3
    assert figures["counted"]["pose"] == figures["sent"]["pose"] == SAMPLES // 3
    assert figures["rss_mb_after"] < figures["rss_mb_before"] + 50


def test_a_deleted_key_is_no_message(outsider):
    """Zenoh has DELETE beside PUT: it carries no payload."""
    total = outsider.ask_status()["errors"]["total"]
    outsider.session.delete(f"{outsider.prefix}/map")
    outsider.session.delete(f"{outsider.prefix}/pose")
    outsider.wait_status(lambda status: status["errors"]["total"] == total + 2)


def test_an_update_that_lacks_its_map_asks_for_it(daemon, outsider):
    """Who publishes the map latched need not do anything; the newest one comes again."""
    with open_bus(BusSettings(connect=(daemon.endpoint,))) as mapper:
        prefix = outsider.prefix
        latched = mapper.publisher(f"{prefix}/map", "nav_msgs/msg/OccupancyGrid", QOS["map"])
        before = (outsider.ask_status()["map"] or {"revision": 0})["revision"]
        latched.put(map_bytes(room(3.0, 3.0)))
        outsider.wait_status(lambda status: (status["map"] or {}).get("revision") == before + 1)
        time.sleep(ASK_FOR_MAP_S)  # it was asked for by a test before, perhaps
        outsider.put("map_update", update_bytes(room(9.0, 9.0), 5.0, 5.0, 6.0, 6.0))
        outsider.wait_status(lambda status: status["map"]["revision"] == before + 2)
