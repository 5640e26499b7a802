"""Who comes late hears what was said last, and what that costs does not grow with who has gone."""

from __future__ import annotations

import json
import threading
import time
from contextlib import contextmanager
from queue import Queue

import pytest
import zenoh
import zenoh.ext

from fasaco_edge.bus import latched, sample_order
from fasaco_edge.bus.sample_order import ASK_PERIOD_S, MOST_PUBLISHERS
from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.wire.topics import QOS
from tests.support.outsider import open_client
from tests.support.router import router_process
from tests.support.waiting import until

KEY = "test/@v1/key"
TIMEOUT_S = 20.0


@contextmanager
def publishing(endpoint, numbered=True, cache=1):
    text = {"mode": "client", "connect": {"endpoints": [endpoint]}}
    text["timestamping"] = {"enabled": True}
    counting = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None)
    with zenoh.open(zenoh.Config.from_json5(json.dumps(text))) as session:
        yield zenoh.ext.declare_advanced_publisher(
            session,
            KEY,
            # A busy computer drops megabytes that may not wait.
            congestion_control=zenoh.CongestionControl.BLOCK,
            cache=zenoh.ext.CacheConfig(max_samples=cache),
            sample_miss_detection=counting if numbered else None,
            publisher_detection=True,
        )


class Spy:
    def __init__(self, session):
        self._asked, self._lock = [], threading.Lock()
        callback = zenoh.handlers.Callback(self._take, indirect=False)
        self._queryable = session.declare_queryable(f"{KEY}/@adv/**", callback)

    def _take(self, query):
        with self._lock:
            self._asked.append((time.monotonic(), str(query.selector)))
        query.drop()

    def asked(self):
        with self._lock:
            return list(self._asked)

    def in_rounds(self, rounds):
        begun = len(self.asked())
        until(lambda: len(self.asked()) > begun)
        began = time.monotonic()
        time.sleep(rounds * ASK_PERIOD_S)
        return [selector for at, selector in self.asked() if at >= began]


def taken(samples, count):
    return [samples.get(timeout=TIMEOUT_S).payload for _ in range(count)]


def test_gone_publishers_get_no_more_queries(bus, endpoint):
    samples = Queue()
    bus.subscribe(KEY, samples.put, latched=True)
    client = open_client(endpoint)
    spy = Spy(client)
    for number in range(8):
        with publishing(endpoint) as publisher:
            publisher.put(b"%d" % number)
            assert taken(samples, 1) == [b"%d" % number]
    with publishing(endpoint) as publisher:
        publisher.put(b"last")
        assert taken(samples, 1) == [b"last"]
        questions = spy.in_rounds(3)
        # One a second for the one that is there; nine without this.
        assert 1 <= len(questions) <= 4, questions
        assert {question.partition("?")[2].split(";")[0] for question in questions} == {"_sn=1.."}
    client.close()


def test_to_ask_for_the_newest_leaves_no_questioner_behind(bus, endpoint):
    samples = Queue()
    subscription = bus.subscribe(KEY, samples.put, latched=True)
    client = open_client(endpoint)
    with publishing(endpoint) as publisher:
        publisher.put(b"newest")
        assert taken(samples, 1) == [b"newest"]
        spy = Spy(client)
        threads = threading.active_count()
        for _ in range(10):
            subscription.ask()
            assert taken(samples, 1) == [b"newest"]  # although it was heard before
        assert threading.active_count() <= threads + 1
        assert len(spy.in_rounds(3)) <= 4
    assert samples.empty()
    client.close()


@pytest.mark.parametrize("numbered", [True, False])
def test_samples_of_late_publishers_arrive_once(bus, endpoint, numbered):
    """One that published before it could be heard, and one after: in order, none twice."""
    samples = Queue()
    with publishing(endpoint, numbered) as early:
        early.put(b"old")
        early.put(b"before")
        bus.subscribe(KEY, samples.put, latched=True)
        (first,) = taken(samples, 1)
        if first == b"old":  # still on its way when the subscription began
            (first,) = taken(samples, 1)
        assert first == b"before"
        with publishing(endpoint, numbered) as late:
            late.put(b"late")
            assert taken(samples, 1) == [b"late"]
            early.put(b"after")
            assert taken(samples, 1) == [b"after"]
        time.sleep(1.5 * ASK_PERIOD_S)
    assert samples.empty()


def test_cached_and_live_samples_arrive_in_order(bus, endpoint):
    samples, stop = Queue(), threading.Event()
    with publishing(endpoint, cache=100) as publisher:

        def publish():
            for number in range(2000):
                publisher.put(b"%d" % number)
                if stop.wait(0.0005):
                    return

        thread = threading.Thread(target=publish)
        thread.start()
        time.sleep(0.1)
        bus.subscribe(KEY, samples.put, latched=True, history=100)
        thread.join()
        heard = [int(payload) for payload in taken(samples, 1)]
        while heard[-1] < 1999:
            heard += [int(payload) for payload in taken(samples, 1)]
    assert heard == list(range(heard[0], 2000))


@pytest.mark.parametrize("stays", [True, False])
def test_where_several_samples_count_a_lost_one_is_queried(bus, endpoint, monkeypatch, stays):
    """A full link drops samples; once their publisher is gone, they cannot be queried."""
    samples, lost, receive = Queue(), [], latched.LatchedSubscription._on_sample

    def lose(self, sample):
        if sample.payload.to_bytes() == b"1":
            lost.append(sample)
        else:
            receive(self, sample)

    monkeypatch.setattr(latched.LatchedSubscription, "_on_sample", lose)
    with publishing(endpoint, cache=10) as publisher:
        subscription = bus.subscribe(KEY, samples.put, latched=True, history=100)
        publisher.put(b"0")
        assert taken(samples, 1) == [b"0"]
        publishers = subscription._publishers
        until(lambda: len(publishers) == 1 and not publishers.is_asking)
        publisher.put(b"1")
        publisher.put(b"2")
        until(lambda: lost)
        if stays:
            assert taken(samples, 2) == [b"1", b"2"]
    assert stays or taken(samples, 1)[0] in (b"1", b"2")


def test_samples_held_for_a_missing_answer_are_bounded(bus, endpoint, monkeypatch):
    """A publisher that does not answer, and another one that sends megabytes meanwhile."""
    monkeypatch.setattr(latched, "ANSWER_S", 1000.0)
    asked, samples = [], Queue()
    with open_client(endpoint) as silent, publishing(endpoint, cache=100) as publisher:
        held = zenoh.handlers.Callback(asked.append, indirect=False)
        queryable = silent.declare_queryable(f"{KEY}/@adv/**", held)
        time.sleep(0.5)
        bus.subscribe(KEY, samples.put, latched=True, history=100)
        until(lambda: asked)
        size = sample_order.HELD_BYTES // 4
        for number in range(6):
            publisher.put(bytes([number]) * size)
        until(lambda: samples.qsize() >= 4)
        assert [payload[0] for payload in taken(samples, 4)] == [0, 1, 2, 3]
        for query in asked:
            query.drop()
        queryable.undeclare()


@pytest.mark.parametrize("numbered", [True, False])
def test_a_sample_older_than_the_answer_is_dropped(bus, endpoint, numbered):
    """The first sample bears the number 0, as that of a publisher that was started anew does."""
    samples, on_their_way = Queue(), Queue()
    client = open_client(endpoint)
    client.declare_subscriber(KEY, on_their_way.put)
    with publishing(endpoint, numbered) as publisher:
        time.sleep(0.3)
        publisher.put(b"old")
        publisher.put(b"before")
        late = [on_their_way.get(timeout=TIMEOUT_S) for _ in range(2)]
        subscription = bus.subscribe(KEY, samples.put, latched=True)
        assert taken(samples, 1) == [b"before"]
        for sample in late:
            subscription._on_sample(sample)
        assert samples.empty()
    client.close()


@pytest.mark.parametrize("numbered", [True, False])
def test_a_sample_received_before_its_token_arrives_once(bus, endpoint, numbered):
    """It publishes on a link that stands, before its token is looked for."""
    samples = Queue()
    subscription = bus.subscribe(KEY, samples.put, latched=True)
    with publishing(endpoint, numbered) as publisher:
        time.sleep(0.3)  # by then what it publishes reaches the subscriber at once
        publisher.put(b"one")
        assert taken(samples, 1) == [b"one"]
        until(lambda: subscription._publishers)
        time.sleep(1.5 * ASK_PERIOD_S)
        assert samples.empty()


@pytest.mark.parametrize("numbered", [True, False])
def test_cached_samples_arrive_before_newer_ones(bus, endpoint, numbered):
    with publishing(endpoint, numbered, cache=10) as publisher:
        for number in range(30):
            samples = Queue()
            publisher.put(b"%d" % number)
            bus.subscribe(KEY, samples.put, latched=True, history=10)
            publisher.put(b"%d and more" % number)
            heard = taken(samples, 1)
            while heard[-1] != b"%d and more" % number:
                heard += taken(samples, 1)
            assert heard[-2:] == [b"%d" % number, b"%d and more" % number]
            time.sleep(0.1)
            assert samples.empty()


def test_a_flood_of_publishers_gets_a_bounded_number_of_queries(bus, endpoint):
    samples = Queue()
    with publishing(endpoint) as honest:
        honest.put(b"one")
        subscription = bus.subscribe(KEY, samples.put, latched=True)
        assert taken(samples, 1) == [b"one"]
        client = open_client(endpoint)
        spy = Spy(client)
        tokens = [
            client.liveliness().declare_token(f"{KEY}/@adv/pub/{number:x}/1/_")
            for number in range(1, 301)
        ]
        until(lambda: len(subscription._publishers) == MOST_PUBLISHERS)
        questions = spy.in_rounds(2)
        assert len(questions) <= 3 * MOST_PUBLISHERS
        assert len(set(questions)) == MOST_PUBLISHERS, "each of them is asked"
        honest.put(b"two")
        assert taken(samples, 1) == [b"two"]
        assert tokens
        client.close()


def test_after_the_router_was_started_again_the_newest_is_there(endpoint):
    samples = Queue()
    with router_process(endpoint) as router:
        settings = BusSettings("client", (endpoint,))
        with open_bus(settings) as bus, open_bus(settings) as other:
            bus.subscribe(KEY, samples.put, latched=True)
            publisher = other.publisher(KEY, qos=QOS["map"])
            publisher.put(b"before")
            assert taken(samples, 1) == [b"before"]
            router.kill()
            router.wait()
            publisher.put(b"into the void")
            with router_process(endpoint):
                while taken(samples, 1) != [b"into the void"]:
                    pass
