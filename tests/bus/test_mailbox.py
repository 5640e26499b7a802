"""The mailbox between Zenoh's threads and the loop."""

import threading
import time

from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.bus.mailbox import LatestSlot, Mailbox, Queue, Spacing


def mailbox(length=3):
    return Mailbox({"update": Queue(length)})


def test_updates_stay_in_order_and_come_after_their_map():
    box = mailbox()
    box.post("map", "base")
    box.post("update", 1)
    box.post("pose", "here")
    box.post("update", 2)
    assert box.take(0) == [("map", "base"), ("pose", "here"), ("update", 1), ("update", 2)]


def test_more_than_is_handed_out_at_once_waits_for_the_next_take():
    box = Mailbox({"pose": Queue(9, 30, at_once=2)}, size_of=len)
    for number in range(1, 6):
        box.post("pose", bytes(number))
    box.post("map", b"m")
    assert box.take(0) == [("map", b"m"), ("pose", bytes(1)), ("pose", bytes(2))]
    started = time.monotonic()
    assert [len(item) for _, item in box.take(60.0)] == [3, 4]
    assert [len(item) for _, item in box.take(60.0)] == [5]
    assert time.monotonic() - started < 30.0, "waited for another post"
    box.post("pose", bytes(30))
    assert [len(item) for _, item in box.take(0)] == [30], "their sizes are given back"
    assert box.take_lost("pose") == 0


def test_an_ordered_item_waits_for_earlier_items_only():
    box = Mailbox({"command": Queue(2, after="pose"), "pose": Queue(4, at_once=2)})
    for number in range(4):
        box.post("pose", number)
    box.post("command", "reset")
    box.post("pose", 4)
    assert box.take(0) == [("pose", 1), ("pose", 2)], "the first was lost"
    assert box.take(0) == [("pose", 3), ("pose", 4), ("command", "reset")]
    box.post("command", "pause")
    box.post("pose", 5)
    assert box.take(0) == [("pose", 5), ("command", "pause")]
    for number in range(3):
        box.post("command", number)
        box.post("pose", number)
    assert box.take(0) == [("pose", 0), ("pose", 1), ("command", 1), ("command", 2)]


def weighed(length, size):
    return Mailbox({"update": Queue(length, size)}, size_of=len)


@given(
    st.lists(st.lists(st.integers(0, 9), max_size=30), max_size=2),
    st.integers(1, 5),
    st.integers(0, 20),
)
def test_a_full_queue_drops_as_few_of_its_oldest_as_possible(takes, length, size):
    box = weighed(length, size)
    for sizes in takes:
        for number in sizes:
            box.post("update", bytes(number))
        kept = [len(item) for _, item in box.take(0)]
        fitting = [
            sizes[first:]
            for first in range(len(sizes) + 1)
            if first >= len(sizes) - 1
            or (sum(sizes[first:]) <= size and first >= len(sizes) - length)
        ]
        assert kept == fitting[0]
        assert box.take_lost("update") == len(sizes) - len(kept)


def test_a_post_wakes_the_waiting_reader():
    box, taken = mailbox(), []
    waiting = threading.Thread(target=lambda: taken.extend(box.take(30.0)))
    waiting.start()
    box.post("update", 1)
    waiting.join(10.0)
    assert not waiting.is_alive()
    assert taken == [("update", 1)]


def test_many_threads_lose_nothing_that_is_queued():
    box = mailbox(length=10_000)
    taken = []

    def post(name):
        for number in range(500):
            box.post("update", (name, number))

    threads = [threading.Thread(target=post, args=(name,)) for name in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        taken += box.take(0.01)
    for thread in threads:
        thread.join()
    taken += box.take(0)
    assert len(taken) == 2000
    for name in range(4):
        assert [number for _, (who, number) in taken if who == name] == list(range(500))


@given(st.lists(st.sampled_from(["map", "update", "pose", "take"]), max_size=40))
def test_a_take_returns_what_a_plain_list_would_keep(kinds):
    """The twin keeps everything posted and thinks about it only when it is taken."""
    box, posted = mailbox(length=4), []
    for number, kind in enumerate([*kinds, "take"]):
        if kind != "take":
            box.post(kind, number)
            posted.append((kind, number))
            continue
        newest = {name: item for name, item in posted if name != "update"}
        updates = [(name, item) for name, item in posted if name == "update"]
        taken = box.take(0)
        assert dict(taken[: len(newest)]) == newest
        assert taken[len(newest) :] == updates[-4:]
        assert box.take_lost("update") == max(len(updates) - 4, 0)
        posted = []


def test_a_slot_holds_the_newest():
    """A planner must not get a request that another has replaced."""
    slot = LatestSlot()
    assert slot.take(0) is None
    slot.put(1)
    slot.put(2)
    assert slot.take(0) == 2
    assert slot.take(0) is None


SPACING_S = 0.2


def spaced():
    return Mailbox(
        {"map": Queue(2), "update": Queue(9), "pose": Queue(9)},
        Spacing("map", SPACING_S, followers=("update",)),
    )


def test_a_flood_is_thinned_but_its_newest_item_is_taken():
    box, taken, began = spaced(), [], time.monotonic()
    flooding = threading.Event()

    def flood():
        for number in range(2000):
            box.post("map", number)
            time.sleep(0.0005)
        flooding.set()

    threading.Thread(target=flood).start()
    turns = 0
    while not (flooding.is_set() and taken[-1:] == [1999]):
        taken += [item for _, item in box.take(0.1)]
        turns += 1
        assert time.monotonic() - began < 300.0
    # At most two, the older and the newer, each time.
    takes = (time.monotonic() - began) / SPACING_S + 1
    assert len(taken) <= 2 * takes
    # Who waits is not woken by each of them.
    assert turns < 5 * takes


def test_held_topics_wait_until_released_and_others_do_not():
    box = spaced()
    box.hold()
    box.post("update", 1)
    box.post("map", "new")
    box.post("pose", "here")
    assert box.take(0.3) == [("pose", "here")]
    threading.Timer(0.1, box.release).start()
    assert box.take(60.0) == [("map", "new"), ("update", 1)]
    box.post("map", "newer")
    assert box.take(60.0) == [("map", "newer")]


def test_only_followers_of_a_map_wait_with_it():
    box = spaced()
    box.post("map", "old")
    assert box.take(0) == [("map", "old")]
    box.post("update", 1)
    assert box.take(0) == [("update", 1)]
    box.post("update", 2)
    box.post("map", "new")
    box.post("update", 3)
    box.post("pose", "here")
    assert box.take(0) == [("pose", "here")]
    # In its time, long before the wait is over.
    assert box.take(60.0) == [("map", "new"), ("update", 2), ("update", 3)]


def test_a_map_posted_during_a_take_keeps_its_spacing():
    box = spaced()
    box.post("map", "old")
    box.take(0)
    began = time.monotonic()
    threading.Timer(0.05, box.post, ("map", "new")).start()
    assert box.take(60.0) == [("map", "new")]
    assert SPACING_S - 0.05 < time.monotonic() - began < 30.0
