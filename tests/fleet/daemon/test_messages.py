"""What a robot says to its fleet: read back as it was, and refused beyond any limit."""

from __future__ import annotations

import base64
import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.config import DaemonConfig, FleetConfig
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.daemon.loop.inbox import CycleInput, Inbox, Received, make_mailbox, take_batch
from fasaco_edge.errors import FleetError, MalformedMessage
from fasaco_edge.fleet.daemon.exchange import TILES, FleetReceiver, FleetSender
from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.fleet.mission.message import path_ahead
from fasaco_edge.fleet.mission.shared import MOST_ROBOTS
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.mission.events import MapReceived, Part
from fasaco_edge.wire.documents.fleet import CellTile, FleetMember, FleetPart, decode_member
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import (
    MAX_FLEET_PARTS,
    MAX_FLEET_POINTS,
    MAX_FLEET_TILES,
    MAX_JSON_BYTES,
)
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.schemas import POSE_STAMPED
from fasaco_edge.wire.topics import FLEET
from tests.fleet.mission.fleets import FleetRobot
from tests.mission import world
from tests.mission.world import CELL, Drive, building, pose_at
from tests.mission.world import CONFIG as WORLD
from tests.support.outsider import TIMEOUT_S
from tests.support.processes import free_endpoint
from tests.wire.schemas import check

TILE = CellTile(-1, 2, bytes(range(256)) * 2)
MEMBER = FleetMember(1, "hall", 0.3, "map", "covering", 1.5, -2.0, 1.2, 7, 3, 500, (TILE,))
MEMBER = structs.replace(
    MEMBER,
    ground=(TILE,),
    by="r2",
    parts=(FleetPart("r1", 3, -4, -1.5, 1.2), FleetPart("r2", 0, 9, 0.0, 2.0)),
    radius_m=0.2,
    ahead=((1.5, -2.0), (1.5, -1.75)),
    waits_for="r3",
    kept=(TILE,),
)
CONFIG = DaemonConfig(robot=RobotConfig(name="r1"), fleet=FleetConfig("hall"))


def said(**members):
    return json.dumps(json.loads(encode_json(MEMBER)) | members).encode()


def heard(payload, robot="r2"):
    receiver = FleetReceiver(CONFIG)
    return receiver.event(Sample(f"fasaco/@v1/{robot}/fleet", payload))


def test_a_fleet_message_is_read_back_and_matches_its_schema():
    payload = encode_json(MEMBER)
    assert decode_member(payload, "hall") == MEMBER
    check("fleet.json", json.loads(payload))
    assert decode_member(payload, "yard") is None


@pytest.mark.parametrize(
    "members",
    [
        {"x": float("nan")},
        {"y": float("inf")},
        {"x": 1e9},
        {"cell_m": 0.0},
        {"cell_m": 5e-324},
        {"cell_m": 1e200},
        {"step_s": 0.0},
        {"epoch": 0},
        {"division": 2**31},
        {"frame": "m" * 300},
        {"state": 5},
        {"state": ""},
        {"swept": [[0, 0, "AAAA"]]},
        {"ground": [[0, 0, "AAAA"]]},
        {"radius_m": -0.1},
        {"ahead": [[0.0, 1e9]]},
        {"ahead": [[0.0, 0.0]] * (MAX_FLEET_POINTS + 1)},
        {"parts": [["r1", 0, 0, 0.0, 0.0]]},
        {"origin": [0.0, 1e9, 0.0]},
        {"origin": [0.0, 0.0, 361.0]},
        {"parts": [["r1", 0, 2**30 + 1, 0.0, 1.0]]},
        {"parts": [["r1", 0, 0, 1e300, 1.0]]},
        {"parts": [["r1", 0, 0, 0.0, 1.0]] * (MAX_FLEET_PARTS + 1)},
        {"swept": [[2**24 + 1, 0, "A" * 682 + "=="]]},
        {"swept": [[0, 0, "A" * 682 + "=="]] * (MAX_FLEET_TILES + 1)},
    ],
    ids=str,
)
def test_a_value_beyond_a_limit_is_refused_with_the_robots_name(members):
    with pytest.raises(MalformedMessage, match=r"^r2: fleet: "):
        heard(said(**members))


@given(st.binary(max_size=60))
def test_other_bytes_are_refused(payload):
    with pytest.raises(MalformedMessage):
        decode_member(payload, "hall")


def test_a_division_has_a_part_for_this_robot_and_each_known_one():
    assert MAX_FLEET_PARTS == 1 + MOST_ROBOTS


def test_an_oversized_message_is_refused_unread():
    with pytest.raises(MalformedMessage, match="at most"):
        decode_member(b" " * (MAX_JSON_BYTES + 1), "hall")


def test_another_version_is_recognised_in_an_unreadable_message():
    with pytest.raises(FleetError, match="version 2, not 1"):
        decode_member(b'{"version": 2, "fleet": "hall"}', "hall")
    assert heard(said(version=2)).misfit == "its messages are of version 2, not 1"
    # The status names it with each member.
    with pytest.raises(MalformedMessage, match="version"):
        decode_member(b'{"version": ' + b"9" * 4000 + b', "fleet": "hall"}', "hall")


@pytest.mark.parametrize(
    ("frame", "members", "misfit"),
    [
        ("", {}, ""),
        ("", {"cell_m": 0.5}, "its cells are 0.5 m wide, here they are 0.276 m"),
        ("", {"lattice_deg": 12.5}, "its cells lie at 12.5 degrees to the map frame, here at 0"),
        ("house", {"frame": "map"}, "its frame is 'map', that of this fleet is 'house'"),
        # Their maps may lie at any angle to each other, and so may their cells.
        ("house", {"frame": "house", "lattice_deg": 20.0, "origin": [1.0, 2.0, 30.0]}, ""),
    ],
)
def test_a_robot_that_does_not_fit_is_left_out_with_the_reason(frame, members, misfit):
    config = structs.replace(CONFIG, fleet=FleetConfig("hall", frame=frame))
    payload = said(**{"cell_m": CONFIG.cell_m} | members)
    event = FleetReceiver(config).event(Sample("fasaco/@v1/r2/fleet", payload))
    assert event.misfit == misfit
    assert misfit or event.frame == ("" if frame else "map")


class Listener:
    def __init__(self):
        self.payloads, self.heard = [], []

    def put(self, payload):
        self.payloads.append(payload)
        self.heard.append(decode_member(payload, "hall"))


def test_a_robot_sends_pace_and_all_tiles_after_it_forgets_cells():
    robot, listener = FleetRobot("r1", (0, 0), ["." * 12] * 4), Listener()
    ledger, sender = robot.mission.covered.current, FleetSender(listener, CONFIG)
    for row in range(TILES):
        ledger.visit((64 * row, 0))
    robot.mission.company.step_s = 7.5
    for now in (0.0, 1.0, 2.0):
        robot.mission.covered.shared.record_forgotten()
        sender.publish(robot.mission, now)
    assert [said.step_s for said in listener.heard] == [7.5] * 3
    assert [len(said.swept) for said in listener.heard] == [TILES] * 3


@pytest.mark.parametrize("cell_m", [0.005, 0.028, CELL])
def test_a_robot_sends_its_next_metres_for_any_cell_size(cell_m, monkeypatch):
    monkeypatch.setattr(world, "CELL", cell_m)
    footprint = Footprint(cell_m=cell_m, robot_radius_m=cell_m / 2)
    drive = Drive((0, 0), config=replace(WORLD, footprint=footprint), kind=FleetKind("r1"))
    drive.mission.covered.shared.begin_epoch(1)
    drive.tell(MapReceived(building("." * 600)), pose_at(0, 0))
    drive.plan()
    line, listener = path_ahead(drive.mission), Listener()
    FleetSender(listener, CONFIG).publish(drive.mission, 0.0)
    told = np.array(listener.heard[-1].ahead)
    assert told[-1] == pytest.approx(line[-1], abs=1e-3)
    assert told[0] == pytest.approx(line[0], abs=1e-3)
    steps = np.hypot(*np.diff(told, axis=0).T)
    assert steps.max() < max(1.1 * cell_m, 0.06)
    assert steps.min() > 0.0


@pytest.mark.parametrize("northing_m", [5_500_000, 9_999_000])
def test_robots_on_a_map_in_utm_divide_its_cells(northing_m):
    corner = round(northing_m / CELL), round(500_000 / CELL)
    ends = {"r1": corner, "r2": (corner[0] + 3, corner[1] + 11)}
    drives, subscriptions = {}, {}
    for name, cell in ends.items():
        drives[name] = Drive(cell, config=WORLD, kind=FleetKind(name))
        drives[name].mission.covered.shared.begin_epoch(1)
        drives[name].tell(MapReceived(building(*["." * 12] * 4, at=corner)), pose_at(*cell))
        drives[name].plan()
        subscriptions[name] = FleetReceiver(structs.replace(CONFIG, robot=RobotConfig(name=name)))
    for now in range(4):
        for name, drive in drives.items():
            listener = Listener()
            FleetSender(listener, CONFIG).publish(drive.mission, float(now))
            (payload,) = listener.payloads
            sample = Sample(f"fasaco/@v1/{name}/fleet", payload)
            for other in drives.keys() - {name}:
                event = subscriptions[other].event(sample)
                assert event.misfit == ""
                drives[other].tell(event, pose_at(*ends[other]), after=1.0)
                if drives[other].request is not None:
                    drives[other].plan()
    parts = [drive.mission.company.parts for drive in drives.values()]
    assert parts[0] == parts[1]
    assert [part.robot for part in parts[0]] == ["r1", "r2"]


def test_a_division_comes_with_its_parts_or_without():
    heard_now = heard(said())
    assert heard_now.by == "r2"
    assert heard_now.parts[0] == Part("r1", (3, -4), -1.5, 1.2)
    assert heard_now.ground == heard_now.kept == (((-1, 2), TILE.cells),)
    older = json.loads(said())
    for member in ("ground", "by", "parts", "radius_m", "ahead", "waits_for", "kept"):
        del older[member]
    older.pop("lattice_deg", None)
    assert heard(json.dumps(older).encode()).parts == ()
    assert heard(json.dumps(older).encode()).kept is None


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
