"""Our session beside plain Zenoh: what leaves here arrives there, and the other way round."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Queue

import pytest
import zenoh
import zenoh.ext

from fasaco_edge.bus import queries
from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.queries import QueryReply
from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topics import QOS
from tests.support.outsider import Collector, open_client
from tests.support.senders import Sender
from tests.support.waiting import until

KEY = "test/@v1/key"
SCHEMA = "nav_msgs/msg/Path"
TIMEOUT_S = 60.0


@pytest.fixture
def client(bus, endpoint):
    session = open_client(endpoint)
    yield session
    session.close()


@pytest.fixture
def samples():
    return Queue()


def history():
    return zenoh.ext.HistoryConfig(max_samples=1, detect_late_publishers=True)


def test_a_map_and_its_updates_come_as_they_were_sent(bus, endpoint):
    """An update that came before its map would be lost; by default each key has its own thread."""
    heard = []
    both = topics.MAP, topics.MAP_UPDATE
    keys = [Keys().of(topic) for topic in both]
    for topic in both:
        bus.listen(Keys(), topic, lambda sample: heard.append((sample.key, sample.payload)))
    with open_bus(BusSettings("client", (endpoint,))) as mapper:
        senders = [Sender(mapper, topic) for topic in both]
        # Once both are heard what is sent is, too.
        until(lambda: [sender.put(b"first") for sender in senders] and len(set(heard)) == 2)
        sent = [(key, b"%d" % number) for number in range(400) for key in keys]
        for place, (_, payload) in enumerate(sent):
            senders[place % 2].put(payload)
        until(lambda: heard[-1] == sent[-1])
    assert heard[-len(sent) :] == sent


@pytest.mark.parametrize("latched", [False, True])
def test_a_sample_comes_in_with_type_and_attachment(bus, client, samples, latched):
    bus.subscribe(KEY, samples.put, latched)
    cdr = zenoh.Encoding.APPLICATION_CDR
    client.put(KEY, b"one", encoding=cdr.with_schema(SCHEMA), attachment=b"attached")
    assert samples.get(timeout=TIMEOUT_S) == Sample(KEY, b"one", SCHEMA, b"attached")
    # As under ROS 2: no encoding at all.
    client.put(KEY, b"two")
    assert samples.get(timeout=TIMEOUT_S) == Sample(KEY, b"two", "", b"")
    client.put(KEY, b"three", encoding=cdr)
    assert samples.get(timeout=TIMEOUT_S) == Sample(KEY, b"three", "", b"")


@pytest.mark.parametrize("name", QOS)
def test_a_sample_travels_as_its_key_says(bus, client, name):
    came, qos = Queue(), QOS[name]
    client.declare_subscriber(KEY, came.put)
    publisher = bus.publisher(KEY, qos=qos)
    until(publisher.has_listeners)
    publisher.put(b"payload")
    sample = came.get(timeout=TIMEOUT_S)
    assert sample.priority == getattr(zenoh.Priority, qos.priority.upper())
    assert sample.congestion_control == getattr(zenoh.CongestionControl, qos.congestion.upper())
    assert sample.express == qos.express


def test_it_knows_whether_anybody_listens(bus, client):
    for latched in (False, True):
        publisher = bus.publisher(f"{KEY}/{latched}", qos=QOS["path" if latched else "pose"])
        assert not publisher.has_listeners()
        subscriber = client.declare_subscriber(f"{KEY}/{latched}", Collector())
        until(publisher.has_listeners)
        subscriber.undeclare()
        until(lambda publisher=publisher: not publisher.has_listeners())


def test_answers_of_others_come_in_whole(bus, client):
    def answer(query):
        if str(query.selector).endswith("?bad"):
            query.reply_err(b"no", encoding="application/json")
        else:
            cdr = zenoh.Encoding.APPLICATION_CDR.with_schema(SCHEMA)
            query.reply(KEY, b"yes", encoding=cdr, attachment=b"attached")

    client.declare_queryable(KEY, answer)
    until(lambda: bus.get(KEY))
    assert bus.get(KEY) == [QueryReply(b"yes", SCHEMA, b"attached")]
    assert bus.get(f"{KEY}?bad") == [QueryReply(b"no", is_error=True)]
    assert bus.get("test/@v1/nobody", timeout_s=0.5) == []


@pytest.mark.parametrize("mode", ["peer", "router"])
def test_a_session_joins_if_the_port_is_taken(endpoint, samples, mode):
    settings = BusSettings(mode, (), (endpoint,))
    with open_bus(settings) as first, open_bus(settings) as second:
        first.subscribe(KEY, samples.put)
        publisher = second.publisher(KEY)
        until(publisher.has_listeners)
        publisher.put(b"from the second")
        assert samples.get(timeout=TIMEOUT_S).payload == b"from the second"


@pytest.mark.parametrize("mode", ["peer", "router"])
def test_a_joined_session_listens_once_the_other_is_gone(endpoint, samples, mode):
    settings = BusSettings(mode, (), (endpoint,))
    first = open_bus(settings)
    with open_bus(settings) as second, open_bus(settings) as third:
        second.subscribe(KEY, samples.put)
        first.close()

        def is_reached():
            for one in (second, third):
                one.keep_in_touch(time.monotonic())
            with suppress(BusUnavailable), open_bus(BusSettings("client", (endpoint,))) as other:
                publisher = other.publisher(KEY)
                until(publisher.has_listeners)
                publisher.put(b"to the second")
                return True

        until(is_reached)
        assert samples.get(timeout=TIMEOUT_S).payload == b"to the second"
        until(lambda: third.keep_in_touch(time.monotonic()))


@pytest.mark.parametrize(
    "settings",
    [
        BusSettings("client", ("tcp/127.0.0.1:1",)),
        BusSettings("client", ("tcp/127.0.0.1",)),
        BusSettings("client", ("nonsense",)),
        BusSettings("client", ("carrier-pigeon/127.0.0.1:7447",)),
        BusSettings("peer", (), ("tcp/127.0.0.1:notaport",)),
        BusSettings("peer", (), ("tcp/192.0.2.1:7447",)),
        BusSettings("nonsense"),
    ],
)
def test_an_endpoint_without_a_listener_is_an_error_at_once(settings):
    started = time.monotonic()
    with pytest.raises(BusUnavailable) as caught:
        open_bus(settings)
    assert time.monotonic() - started < TIMEOUT_S
    assert str(caught.value)
    assert "\n" not in str(caught.value)
    assert ".rs:" not in str(caught.value)


@contextmanager
def subscriber(endpoint):
    code = f"""
import time
from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
with open_bus(BusSettings("client", ({endpoint!r},))) as bus:
    bus.subscribe({KEY!r}, lambda sample: print(sample.payload[:4].decode(), flush=True))
    print("listening", flush=True)
    time.sleep(60)
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout.readline() == b"listening\n"
            yield process
        finally:
            process.kill()


def test_a_resumed_subscriber_gets_the_last_sample_it_missed(bus, endpoint):
    """A full link drops maps; the subscriber asks whether it has the newest."""
    code = f"""
import time
from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
with open_bus(BusSettings("client", ({endpoint!r},))) as bus:
    bus.subscribe({KEY!r}, lambda sample: print(int(sample.payload[:4]), flush=True), latched=True)
    time.sleep(60)
"""
    publisher = bus.publisher(KEY, qos=QOS["map"])
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as listener:
        try:
            publisher.put(_numbered(0))
            assert int(listener.stdout.readline()) == 0
            listener.send_signal(signal.SIGSTOP)
            for number in range(1, 64):
                publisher.put(_numbered(number))
            time.sleep(1.5)
            listener.send_signal(signal.SIGCONT)
            came = list(iter(lambda: int(listener.stdout.readline()), 63))
            assert len(came) < 60  # some were dropped: else this shows nothing
        finally:
            listener.kill()


@pytest.mark.parametrize("name", ["coverage", "pheromone", "directions"])
def test_a_burst_of_samples_waits_for_a_busy_subscriber(endpoint, name):
    """Cohorts come one on the other: where only two could wait, the last were dropped."""
    small = BusSettings("peer", (), (f"{endpoint}#so_sndbuf=65536",))
    with open_bus(small) as bus, subscriber(f"{endpoint}#so_rcvbuf=65536") as busy:
        publisher = bus.publisher(KEY, qos=QOS[name])
        until(publisher.has_listeners)
        busy.send_signal(signal.SIGSTOP)
        until(lambda: "T (stopped)" in Path(f"/proc/{busy.pid}/status").read_text())
        for number in range(16):
            publisher.put(_numbered(number)[:30_000])
        busy.send_signal(signal.SIGCONT)
        came = [int(busy.stdout.readline())]
        while len(came) < 16 and came[-1] < 16:
            publisher.put(_numbered(16)[:4])  # the end, of what was not dropped
            came.append(int(busy.stdout.readline()))
        assert came == list(range(16))


def test_a_frozen_subscriber_does_not_hold_the_end_of_a_session(endpoint):
    """Zenoh alone tries for ten seconds to get rid of what is queued, and fails then."""
    bus = open_bus(BusSettings("peer", (), (endpoint,)))
    publisher = bus.publisher(KEY, qos=QOS["path"])
    with subscriber(endpoint) as listener:
        until(publisher.has_listeners)
        listener.send_signal(signal.SIGSTOP)
        for _ in range(30):
            publisher.put(bytes(1_000_000))
        started = time.monotonic()
        bus.close()
        assert time.monotonic() - started < 8.0


def _numbered(number):
    return b"%04d" % number + bytes(1_000_000)


def test_a_process_that_closes_its_session_ends(endpoint):
    """Without close() a process with a subscription may hang at its exit."""
    code = f"""
from fasaco_edge.wire.topics import QOS
from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
with open_bus(BusSettings("peer", (), ({endpoint!r},))) as bus:
    bus.subscribe({KEY!r}, lambda sample: None, latched=True)
    bus.serve({KEY!r}, lambda asked: None)
    bus.publisher({KEY!r}, qos=QOS["path"]).put(b"")
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_a_token_list_is_kept_up_to_date(bus, endpoint):
    def told():
        roll.ask(0.0)
        return roll.there()

    with open_bus(BusSettings("client", (endpoint,))) as other:
        before = other.token(f"{KEY}/a")
        roll = bus.token_list(f"{KEY}/*")
        until(lambda: told() == {f"{KEY}/a"})
        other.token(f"{KEY}/b")
        until(lambda: told() == {f"{KEY}/a", f"{KEY}/b"})
        other.withdraw(before)
        until(lambda: told() == {f"{KEY}/b"})
    until(lambda: told() == set())


def test_a_token_list_never_misses_who_is_there(bus, endpoint):
    """Whatever else is asked and comes and goes at the same time."""
    with open_bus(BusSettings("client", (endpoint,))) as other:
        bus.token(f"{KEY}/here")
        roll = other.token_list(f"{KEY}/*")
        until(lambda: roll.ask(0.0) or roll.version)
        for number in range(200):
            passing = other.token(f"{KEY}/{number}")
            version = roll.version
            until(lambda version=version: roll.ask(0.0) or roll.version > version)
            assert f"{KEY}/here" in roll.there()
            other.withdraw(passing)


def test_a_token_list_asks_again_where_no_answer_comes(bus, monkeypatch):
    bus.token(f"{KEY}/here")
    roll = bus.token_list(f"{KEY}/*")
    ask = queries.ask_for_tokens
    for is_asked in (False, True):
        monkeypatch.setattr(queries, "ask_for_tokens", lambda *_, said=is_asked: said)
        monkeypatch.setattr(queries, "LOST_S", 0.05)
        roll.ask(0.0)
        monkeypatch.setattr(queries, "ask_for_tokens", ask)
        version = roll.version
        until(lambda version=version: roll.ask(0.0) or roll.version > version)
    assert roll.there() == {f"{KEY}/here"}


def test_a_token_list_keeps_tokens_of_a_partial_answer(bus, monkeypatch):
    token = bus.token(f"{KEY}/here")
    roll = bus.token_list(f"{KEY}/*")
    until(lambda: roll.ask(0.0) or roll.version)
    with monkeypatch.context() as patched:
        patched.setattr(
            queries, "ask_for_tokens", lambda *asked: asked[3]([f"{KEY}/new"], False) or True
        )
        roll.ask(0.0)
        assert roll.there() == {f"{KEY}/here", f"{KEY}/new"}
    until(lambda: roll.ask(0.0) or roll.there() == {f"{KEY}/here"})
    bus.withdraw(token)


def test_a_token_list_has_a_bound(bus, endpoint, monkeypatch):
    monkeypatch.setattr(queries, "MOST_TOKENS", 100)
    roll = bus.token_list(f"{KEY}/*")
    with open_bus(BusSettings("client", (endpoint,))) as flood:
        for number in range(300):
            flood.token(f"{KEY}/flood-{number}")
        until(lambda: roll.ask(0.0) or len(roll.there()) == 100)
    until(lambda: roll.ask(0.0) or not roll.there())
