"""The inbox keeps order while it can, memory always."""

from __future__ import annotations

import threading

from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.bus.session import Sample
from fasaco_edge.recording.inbox import BEHIND_SAMPLES, Inbox

TOPICS = ["map", "map_update", "pose", "path", "coverage", "pheromone", "status"]


def arrival(topic: str, number: int = 0, size: int = 10) -> Arrival:
    return Arrival(topic, Sample(topic, bytes(size)), number, number)


def test_arrivals_come_out_in_order():
    inbox = Inbox(10_000)
    for number in range(20):
        inbox.post(arrival(TOPICS[number % 7], number))
    assert [one.wall_ns for one in inbox.take(0.0)] == list(range(20))
    assert inbox.take(0.0) == []
    assert not inbox.lost


def test_behind_the_newest_pose_wins_and_every_path_stays():
    inbox = Inbox(1_000_000)
    for number in range(BEHIND_SAMPLES):
        inbox.post(arrival("path", number))
    for number in range(50):
        inbox.post(arrival("pose", number))
    taken = inbox.take(0.0)
    assert [one.wall_ns for one in taken if one.topic == "path"] == list(range(BEHIND_SAMPLES))
    assert [one.wall_ns for one in taken if one.topic == "pose"] == [49]
    assert inbox.lost == {"pose": 49}


def test_behind_a_full_map_clears_the_patches_of_the_one_before():
    inbox = Inbox(100)
    inbox.post(arrival("map", 0, 30))
    inbox.post(arrival("map_update", 1, 20))
    inbox.post(arrival("map", 2, 40))
    assert [one.wall_ns for one in inbox.take(0.0)] == [2]
    assert inbox.lost == {"map": 1, "map_update": 1}


@given(st.lists(st.tuples(st.sampled_from(TOPICS), st.integers(0, 400)), max_size=300))
def test_memory_is_bounded_and_nothing_vanishes_uncounted(posts):
    inbox = Inbox(1000)
    for topic, size in posts:
        inbox.post(arrival(topic, size=size))
    taken = inbox.take(0.0)
    assert sum(len(one.sample.payload) for one in taken) <= 1000
    assert len(taken) + inbox.lost.total() == len(posts)


def test_a_waiting_reader_wakes():
    inbox = Inbox(100)
    threading.Timer(0.05, inbox.post, [arrival("pose")]).start()
    assert len(inbox.take(5.0)) == 1
