"""What the service manager is told, on a socket as it makes one."""

from __future__ import annotations

import os
import resource
import socket
import threading
import time
from collections.abc import Iterator

import pytest

from fasaco_edge.daemon.notify import ServiceManager


@pytest.fixture(params=["path", "abstract"])
def listening(request, tmp_path) -> Iterator[tuple[socket.socket, str]]:
    name = str(tmp_path / "notify") if request.param == "path" else f"@fasaco-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(name.replace("@", "\0", 1) if name.startswith("@") else name)
        heard.settimeout(60.0)
        yield heard, name


def test_each_word_is_one_datagram(listening):
    heard, name = listening
    manager = ServiceManager({"NOTIFY_SOCKET": name})
    assert manager.is_present
    manager.status("waiting")
    manager.ready()
    manager.alive()
    manager.extend(1.5)
    manager.stopping()
    said = [heard.recv(4096) for _ in range(5)]
    words = [b"READY=1", b"WATCHDOG=1", b"EXTEND_TIMEOUT_USEC=1500000", b"STOPPING=1"]
    assert said == [b"STATUS=waiting", *words]


def test_a_process_without_descriptors_still_feeds_the_watchdog(listening):
    heard, name = listening
    manager = ServiceManager({"NOTIFY_SOCKET": name})
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, before[1]))
    try:
        manager.alive()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    assert heard.recv(4096) == b"WATCHDOG=1"


def test_a_status_is_one_line_and_sent_once(listening):
    heard, name = listening
    manager = ServiceManager({"NOTIFY_SOCKET": name})
    for text in ("two\nlines", "two\nlines", "another"):
        manager.status(text)
    assert [heard.recv(4096) for _ in range(2)] == [rb"STATUS=two\nlines", b"STATUS=another"]


def test_reloading_says_when(listening):
    heard, name = listening
    before = time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000
    ServiceManager({"NOTIFY_SOCKET": name}).reloading()
    first, second = heard.recv(4096).decode().splitlines()
    assert first == "RELOADING=1"
    assert before <= int(second.removeprefix("MONOTONIC_USEC=")) <= before + 5_000_000


def test_children_inherit_nothing_to_speak_with():
    environ = {"NOTIFY_SOCKET": "/x", "WATCHDOG_USEC": "1", "WATCHDOG_PID": "1", "HOME": "/"}
    ServiceManager(environ)
    assert environ == {"HOME": "/"}


@pytest.mark.parametrize(
    ("environ", "seconds"),
    [
        ({"WATCHDOG_USEC": "30000000"}, 30.0),
        ({"WATCHDOG_USEC": "30000000", "WATCHDOG_PID": str(os.getpid())}, 30.0),
        ({"WATCHDOG_USEC": "30000000", "WATCHDOG_PID": "1"}, 0.0),
        ({"WATCHDOG_USEC": "soon"}, 0.0),
        ({}, 0.0),
    ],
)
def test_only_the_watchdog_of_this_process_counts(environ, seconds):
    assert ServiceManager(environ).watchdog_s == seconds


def test_a_gone_manager_is_only_a_warning(tmp_path, caplog):
    manager = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "nobody")})
    manager.ready()
    assert "does not accept READY" in caplog.text


def test_a_status_that_was_not_received_is_sent_again(tmp_path):
    name = str(tmp_path / "notify")
    manager = ServiceManager({"NOTIFY_SOCKET": name})
    manager.status("waiting")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(name)
        heard.settimeout(60.0)
        manager.status("waiting")
        assert heard.recv(4096) == b"STATUS=waiting"


def test_a_busy_manager_receives_readiness(tmp_path):
    name = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(name)
        manager = ServiceManager({"NOTIFY_SOCKET": name})
        for _ in range(1000):  # it waits for nobody: the test would never end
            manager.alive()
        room = threading.Timer(0.2, lambda: [heard.recv(4096) for _ in range(5)])
        room.start()
        manager.ready()
        room.join()
        heard.settimeout(60.0)
        said = []
        while not said or said[-1] != b"READY=1":
            said.append(heard.recv(4096))


def test_without_a_manager_nothing_is_logged(caplog):
    manager = ServiceManager({})
    manager.ready()
    assert not manager.is_present
    assert caplog.text == ""
