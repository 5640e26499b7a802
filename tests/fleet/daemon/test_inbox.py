"""Inbox of a daemon of a fleet: which messages of other robots reach the mission."""

from __future__ import annotations

import base64
import json

import msgspec

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.loop.inbox import (
    CycleInput,
    Inbox,
    Received,
    make_mailbox,
    take_batch,
)
from fasaco_edge.fleet.daemon.exchange import FleetReceiver
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_JSON_BYTES
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.schemas import POSE_STAMPED
from fasaco_edge.wire.topics import FLEET
from tests.support.outsider import TIMEOUT_S
from tests.support.processes import free_endpoint

MAX_PIXELS = 1_000_000


def test_an_oversized_fleet_message_is_dropped_on_arrival():
    config = msgspec.convert({"robot": {"name": "r1"}, "fleet": {"name": "hall"}}, DaemonConfig)
    keys, mailbox = config.keys(), make_mailbox(MAX_PIXELS)
    with open_bus(BusSettings("peer", (), (free_endpoint(),))) as bus:
        poses, receiver = PoseDecoder(POSE_STAMPED, None), FleetReceiver(config)
        inbox = Inbox(bus, keys, mailbox, poses, MAX_PIXELS, fleet=receiver)
        bus.publisher(Keys("r2").of(FLEET)).put(bytes(MAX_JSON_BYTES + 1))
        batch = take_batch(mailbox, TIMEOUT_S)
        assert batch.samples == []
        events, faults = inbox.decode(batch)
        assert events == []
        assert [str(fault) for fault in faults] == [
            "a fleet message of 1048577 bytes was dropped: it may have at most 1048576"
        ]


def test_fleet_messages_wait_for_the_mission():
    """A replay hears nothing of it: with it, cells at the edges of tiles would be others."""
    fleet = {"name": "hall", "frame": "house"}
    config = msgspec.convert({"robot": {"name": "r1"}, "fleet": fleet}, DaemonConfig)
    every, told = base64.b64encode(b"\xff" * 512).decode(), []
    for col in range(2):
        said = {"version": 1, "fleet": "hall", "cell_m": config.cell_m, "frame": "house"}
        said |= {"state": "covering", "x": 0.0, "y": 0.0, "step_s": 1.0, "epoch": 1, "division": 0}
        said |= {"open_cells": 9, "swept": [], "ground": [[0, col, every]]}
        payload = json.dumps(said | {"origin": [3.0, 0.0, 20.0]}).encode()
        told.append(Received("fleet", Sample("fasaco/@v1/r2/fleet", payload), 0.0))
    with open_bus(BusSettings("peer", (), (free_endpoint(),))) as bus:
        poses, receiver = PoseDecoder(POSE_STAMPED, None), FleetReceiver(config)
        inbox = Inbox(
            bus, config.keys(), make_mailbox(MAX_PIXELS), poses, MAX_PIXELS, fleet=receiver
        )
        assert inbox.decode(CycleInput(samples=told[:1]), has_mission=False) == ([], [])
        events, faults = inbox.decode(CycleInput(samples=told[1:]))
    assert events == [FleetReceiver(config).event(told[1].sample)]
    assert faults == []
