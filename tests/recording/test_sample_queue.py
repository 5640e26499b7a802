"""The queue keeps order while it can, memory always."""

from __future__ import annotations

import threading

from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.recording.write.process import (
    BASE_BYTES,
    BEHIND_SAMPLES,
    COPIES,
    LEAST_QUEUE_BYTES,
    QUEUE_BYTES,
    RunClock,
    SampleQueue,
    afforded_bytes,
)
from tests.support.service_manager import UNIT, unit_limit

TOPICS = ["map", "map_update", "pose", "path", "coverage", "pheromone", "status"]


def queue_of(capacity: int) -> SampleQueue:
    def stamp(topic: str, sample: Sample) -> Arrival:
        number = int(sample.key)
        return Arrival(topic, sample, number, number)

    return SampleQueue(capacity, stamp)


def sample(number: int = 0, size: int = 10) -> Sample:
    return Sample(str(number), bytes(size))


def test_behind_the_newest_pose_wins_and_every_path_stays():
    queue = queue_of(1_000_000)
    for number in range(BEHIND_SAMPLES):
        queue.post("path", sample(number))
    for number in range(50):
        queue.post("pose", sample(number))
    taken = queue.take(0.0)
    assert [one.wall_ns for one in taken if one.topic == "path"] == list(range(BEHIND_SAMPLES))
    assert [one.wall_ns for one in taken if one.topic == "pose"] == [49]
    assert queue.lost == {"pose": 49}


def test_behind_a_full_map_clears_the_patches_of_the_one_before():
    queue = queue_of(100)
    queue.post("map", sample(0, 30))
    queue.post("map_update", sample(1, 20))
    queue.post("map", sample(2, 40))
    assert [one.wall_ns for one in queue.take(0.0)] == [2]
    assert queue.lost == {"map": 1, "map_update": 1}


@given(st.lists(st.tuples(st.sampled_from(TOPICS), st.integers(0, 400)), max_size=300))
def test_memory_is_bounded_and_nothing_vanishes_uncounted(posts):
    queue = queue_of(1000)
    for topic, size in posts:
        queue.post(topic, sample(size=size))
    taken = queue.take(0.0)
    assert sum(len(one.sample.payload) for one in taken) <= 1000
    assert len(taken) + queue.lost.total() == len(posts)


def test_no_sample_is_stamped_earlier_than_the_one_before_it():
    """Whatever the threads are that samples come on."""
    queue = SampleQueue(10**9, RunClock().arrival)
    together = threading.Barrier(4)

    def post():
        together.wait()
        for _ in range(2000):
            queue.post("path", sample())

    threads = [threading.Thread(target=post) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    stamps = [one.at_ns for one in queue.take(0.0)]
    assert len(stamps) == 8000
    assert stamps == sorted(stamps)


def test_the_unit_has_what_the_recorder_needs():
    unit = UNIT.with_name("fasaco-edge-recorder.service")
    high, most = unit_limit("MemoryHigh", unit), unit_limit("MemoryMax", unit)
    assert BASE_BYTES + COPIES * QUEUE_BYTES <= high <= most / 1.07
    assert afforded_bytes(most) == QUEUE_BYTES == afforded_bytes(None)


@given(st.integers(0, 1 << 31))
def test_queued_samples_fit_into_the_memory_limit(limit):
    capacity = afforded_bytes(limit)
    assert LEAST_QUEUE_BYTES <= capacity <= QUEUE_BYTES
    assert capacity == LEAST_QUEUE_BYTES or BASE_BYTES + COPIES * capacity <= limit
