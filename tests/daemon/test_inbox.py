"""From samples to events: what a broken map, or too many updates, must not cost."""

from __future__ import annotations

import gc
import json
import weakref

import numpy as np
import pytest

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.queries import QueryReply, Question
from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.daemon.loop.answers import Commands
from fasaco_edge.daemon.loop.inbox import (
    MOST_POSES,
    Inbox,
    Received,
    make_mailbox,
    poster,
    take_batch,
)
from fasaco_edge.daemon.loop.mission_runner import HeldEvents
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.mission.events import (
    BatteryReceived,
    MapReceived,
    PatchesLost,
    PatchReceived,
    PoseReceived,
)
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_PRIORITY_BYTES
from fasaco_edge.wire.messages.battery import BatteryState, encode_battery
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.schemas import POSE_STAMPED
from fasaco_edge.wire.topics import QUEUE_LENGTHS
from tests.support.outsider import TIMEOUT_S, open_client
from tests.support.processes import free_endpoint
from tests.support.rooms import map_bytes, pillared_room, pose_bytes, update_bytes

MAP = map_bytes(pillared_room())
f32 = np.float32
MAX_PIXELS = 1_000_000
UPDATE = update_bytes(pillared_room(), 1.0, 1.0, 2.0, 2.0)


class Arrivals:
    def __init__(self, bus):
        self.mailbox = make_mailbox(MAX_PIXELS, map_spacing_s=0.0)
        self.inbox = Inbox(bus, Keys(), self.mailbox, PoseDecoder(POSE_STAMPED, None), MAX_PIXELS)
        self.clock = 0.0

    def post(self, kind, payload):
        self.clock += 1.0
        sample = Sample(f"fasaco/@v1/robot/{kind}", payload)
        self.mailbox.post(kind, Received(kind, sample, self.clock))

    def events(self):
        return self.inbox.decode(take_batch(self.mailbox, 0.0))

    def decode(self):
        events, faults = self.events()
        return [type(event) for event in events], faults


@pytest.fixture
def arrivals():
    with open_bus(BusSettings("peer", (), (free_endpoint(),))) as bus:
        yield Arrivals(bus)


def test_a_map_does_not_wait_for_a_thousand_poses(arrivals):
    for _ in range(1000):
        arrivals.post("pose", pose_bytes(1.0, 1.0))
    arrivals.post("map", MAP)
    taken = [arrivals.decode()[0]]
    assert taken[0] == [MapReceived, *[PoseReceived] * MOST_POSES]
    while taken[-1]:
        taken.append(arrivals.decode()[0])
    assert sum(map(len, taken)) == 1001, "none is lost"


def test_battery_messages_are_held_until_there_is_a_mission(arrivals):
    for level in (0.5, 0.4):
        arrivals.post("battery", encode_battery(BatteryState(level, "discharging", "", 7)))
    arrivals.post("battery", b"no battery")
    events, faults = arrivals.events()
    assert events == [BatteryReceived(level, "discharging", 7) for level in map(f32, (0.5, 0.4))]
    assert [type(fault) for fault in faults] == [MalformedMessage]
    held = HeldEvents()
    assert held.take([*events, *events]) == []
    assert held.events == events[-1:]


def test_priorities_are_held_until_there_is_a_mission(arrivals):
    for stamp_ns in (7, 8):
        arrivals.post("priority", map_bytes(pillared_room(), stamp_ns))
    arrivals.post("priority", b"no grid")
    events, faults = arrivals.events()
    # Of two that wait the queue holds one: its memory is that of the longest.
    assert [event.grid.stamp_ns for event in events] == [8]
    assert [type(fault) for fault in faults] == [MalformedMessage]
    held = HeldEvents()
    assert held.take([*events, *events]) == []
    assert held.events == events


def test_oversized_priorities_are_dropped_on_arrival(arrivals):
    post = poster(arrivals.mailbox, "priority", MAX_PIXELS)
    post(Sample("fasaco/@v1/robot/priority", bytes(MAX_PRIORITY_BYTES + 1)))
    assert arrivals.decode()[0] == []
    post(Sample("fasaco/@v1/robot/priority", bytes(MAX_PRIORITY_BYTES + 1)))
    (fault,) = arrivals.decode()[1]
    assert "a priority message of 1048577 bytes was dropped: it may have at most 1048576" in str(
        fault
    )


def test_a_command_follows_its_poses_in_cycles_of_usual_size(arrivals):
    for _ in range(70):
        arrivals.post("pose", pose_bytes(1.0, 1.0))
    arrivals.mailbox.post("command", object.__new__(Question))
    batches = [take_batch(arrivals.mailbox, 0.0) for _ in range(3)]
    assert [len(batch.samples) for batch in batches] == [
        MOST_POSES,
        MOST_POSES,
        70 - 2 * MOST_POSES,
    ]
    assert [len(batch.questions) for batch in batches] == [0, 0, 1]


LOST = PatchesLost, *[PatchReceived] * 256
MAPPED, PATCH, JUNK, POSE = ("map", MAP), ("map_update", UPDATE), ("map", b"junk"), pose_bytes(1, 1)
FLOOD = [PATCH] * 300


@pytest.mark.parametrize(
    ("posted", "types", "faulty"),
    [
        ([PATCH, MAPPED], [MapReceived], 0),
        ([MAPPED, MAPPED, PATCH, PATCH], [MapReceived, PatchReceived, PatchReceived], 0),
        # Updates have no revision: one that went missing unseen would leave the map wrong.
        ([MAPPED, PATCH, JUNK], [MapReceived, PatchReceived], 1),
        ([PATCH, JUNK, PATCH], [PatchReceived, PatchReceived], 1),
        (FLOOD, LOST, 0),
        ([MAPPED, *FLOOD], [MapReceived, *LOST], 0),
        ([*FLOOD, MAPPED, PATCH], [MapReceived, PatchReceived], 0),
        ([("map_update", b""), ("pose", b""), ("pose", b""), ("pose", POSE)], [PoseReceived], 3),
    ],
)
def test_broken_and_lost_samples_keep_the_others_in_order(arrivals, posted, types, faulty):
    for kind, payload in posted:
        arrivals.post(kind, payload)
    events, faults = arrivals.decode()
    assert events == list(types)
    assert [type(fault) for fault in faults] == [MalformedMessage] * faulty


def test_maps_of_two_frames_that_come_together_are_both_taken(arrivals):
    """A latched map comes once, and which of the frames counts is not known here."""
    arrivals.post("map", map_bytes(pillared_room(), frame="odom"))
    arrivals.post("map", MAP)
    arrivals.post("map", map_bytes(pillared_room(), frame="odom", stamp_ns=7))
    events, faults = arrivals.events()
    maps = [(event.grid.frame, event.grid.stamp_ns) for event in events]
    assert maps == [("map", 1), ("odom", 7)]
    assert faults == []


def test_a_map_leaves_the_updates_of_another_frame_alone(arrivals):
    arrivals.post("map_update", UPDATE)
    arrivals.post("map_update", update_bytes(pillared_room(), 1.0, 1.0, 2.0, 2.0, frame="odom"))
    arrivals.post("map", map_bytes(pillared_room(), frame="odom"))
    events, faults = arrivals.events()
    assert [type(event) for event in events] == [MapReceived, PatchReceived]
    assert (events[1].patch.frame, faults) == ("map", [])


def test_a_thread_that_failed_ends_the_daemon(arrivals):
    arrivals.mailbox.post("failed", RuntimeError("planner"))
    with pytest.raises(RuntimeError, match="planner"):
        take_batch(arrivals.mailbox, 0.0)


@pytest.mark.parametrize("kind", ["map", "map_update", "pose"])
def test_a_broken_sample_is_held_by_nothing(arrivals, kind):
    """Its error is let go, and with it the payload, before garbage is collected."""
    gc.disable()
    try:
        arrivals.post(kind, MAP[:-1])
        faults = arrivals.events()[1]
        error = weakref.ref(faults[0])
        del faults
        assert error() is None
    finally:
        gc.enable()


def test_a_command_that_others_push_out_is_answered(arrivals):
    endpoint, most = free_endpoint(), QUEUE_LENGTHS["command"]
    key = "fasaco/@v1/robot/@rpc/mission"
    with open_bus(BusSettings("peer", (), (endpoint,))) as bus:
        Commands(bus, Keys(), arrivals.mailbox)
        session = open_client(endpoint)
        try:
            asked = [session.get(key, timeout=TIMEOUT_S) for _ in range(most + 1)]
            (reply,) = asked[0]
            assert reply.err is not None
            assert json.loads(reply.err.payload.to_bytes())["code"] == "not_now"
            for _ in range(most):
                (question,) = take_batch(arrivals.mailbox, 10.0).questions
                question.answer(QueryReply(b"{}"))
            assert [one.ok is not None for replies in asked[1:] for one in replies] == [True] * most
        finally:
            session.close()
