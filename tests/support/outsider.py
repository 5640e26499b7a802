"""Foreign program on the bus: plain Zenoh and payloads by rosbags, without code of this project.

``python -m tests.support.outsider ENDPOINT`` subscribes to everything; a test then freezes it.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import zenoh
import zenoh.ext

from tests.support.processes import Daemon, daemon_process
from tests.support.waiting import until

# Time limit [s]; only a very busy machine needs most of it.
TIMEOUT_S = 150.0

MAP = "nav_msgs/msg/OccupancyGrid"
MAP_UPDATE = "map_msgs/msg/OccupancyGridUpdate"
POSE = "geometry_msgs/msg/PoseStamped"
# Part of the attachment of the empty path that a daemon publishes first.
BEGINS = b'"revision":0,"map_stamp_ns"'
SCHEMAS = {"map": MAP, "map_update": MAP_UPDATE, "pose": POSE, "priority": MAP}


@dataclass(frozen=True)
class Heard:
    """A sample or an answer."""

    payload: bytes
    encoding: str
    attachment: bytes | None

    def json(self) -> Any:
        """Return the payload's document."""
        return json.loads(self.payload)


class Collector:
    """The samples of one key, in order of arrival.

    Args:
        begins: include the empty path that a daemon publishes first.
    """

    def __init__(self, *, begins: bool = False) -> None:
        self._begins = begins
        self.heard: list[Heard] = []
        self._came = threading.Condition()

    def __call__(self, sample: zenoh.Sample) -> None:
        """Take a sample in, on a Zenoh thread."""
        heard = _heard(sample)
        if not self._begins and BEGINS in (heard.attachment or b""):
            return
        with self._came:
            self.heard.append(heard)
            self._came.notify_all()

    def wait(self, holds: Callable[[Heard], bool], since: int = 0) -> Heard:
        """Return the first sample from number ``since`` on for which ``holds``."""
        deadline = time.monotonic() + TIMEOUT_S
        with self._came:
            while True:
                for heard in self.heard[since:]:
                    if holds(heard):
                        return heard
                left = deadline - time.monotonic()
                assert left > 0, f"not received; the last sample was {self.heard[-1:]}"
                self._came.wait(left)


class Outsider:
    """A client session; close it before the daemon ends."""

    def __init__(
        self, endpoint: str, robot: str = "robot", transport: Mapping[str, Any] | None = None
    ) -> None:
        self.prefix = f"fasaco/@v1/{robot}"
        self.session = open_client(endpoint, transport)
        # The daemon opens its port shortly before it subscribes.
        until(self.alive, TIMEOUT_S, why=lambda: f"no {robot} at {endpoint}")
        self.status = self.listen("status")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.session.close()  # type: ignore[no-untyped-call]

    def listen(self, name: str, *, late: bool = True, begins: bool = False) -> Collector:
        """Subscribe.

        Args:
            name: the last chunk of the key.
            late: also get the last sample published before.
            begins: see ``Collector``.
        """
        receiver = Collector(begins=begins)
        key = f"{self.prefix}/{name}"
        if late:
            history = zenoh.ext.HistoryConfig(max_samples=1, detect_late_publishers=True)
            zenoh.ext.declare_advanced_subscriber(self.session, key, receiver, history=history)
        else:
            self.session.declare_subscriber(key, receiver)
        return receiver

    def put(self, name: str, payload: bytes, schema: str | None = None) -> None:
        """Publish; ``schema``: None for that of the native contract, "" for none."""
        schema = SCHEMAS[name] if schema is None else schema
        encoding = zenoh.Encoding(f"application/cdr;{schema}") if schema else None
        block = zenoh.CongestionControl.BLOCK
        self.session.put(
            f"{self.prefix}/{name}", payload, encoding=encoding, congestion_control=block
        )

    def get(self, name: str, timeout_s: float = 60.0) -> list[zenoh.Reply]:
        """Query; return all replies."""
        return list(self.session.get(f"{self.prefix}/{name}", timeout=timeout_s))

    def ask(self, name: str) -> Heard:
        """Query; check that there is one reply, and return it."""
        replies = [reply.ok for reply in self.get(name)]
        assert len(replies) == 1, replies
        assert replies[0] is not None
        return _heard(replies[0])

    def ask_status(self) -> dict[str, Any]:
        """Return the newest status, once there is one."""
        self.status.wait(lambda heard: True)
        document: dict[str, Any] = self.ask("@rpc/status").json()
        return document

    def wait_status(self, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Return the first status from now on for which ``holds``."""
        since = len(self.status.heard)
        if holds(newest := self.ask_status()):
            return newest
        document: dict[str, Any] = self.status.wait(lambda h: holds(h.json()), since).json()
        return document

    def alive(self, timeout_s: float = 2.0) -> bool:
        """Return whether the daemon's liveliness token exists."""
        replies = self.session.liveliness().get(f"{self.prefix}/alive", timeout=timeout_s)
        return any(reply.ok is not None for reply in replies)


@contextmanager
def joined_daemon(folder: Path, *words: str, **sections: Any) -> Iterator[tuple[Daemon, Outsider]]:
    """Run a daemon, see ``daemon_process``, and an outsider on its bus."""
    with (
        daemon_process(folder, *words, **sections) as daemon,
        Outsider(daemon.endpoint) as outsider,
    ):
        yield daemon, outsider


def open_client(endpoint: str, transport: Mapping[str, Any] | None = None) -> zenoh.Session:
    """Open a client session once a peer listens at the endpoint.

    ``transport``: the section of Zenoh's configuration, with the client's certificate.
    """
    config = zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": "client",
                "connect": {"endpoints": [endpoint], "timeout_ms": 0},
                "scouting": {"multicast": {"enabled": False}},
                "transport": {"shared_memory": {"enabled": False}, **(transport or {})},
            }
        )
    )
    deadline = time.monotonic() + TIMEOUT_S
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError:
            assert time.monotonic() < deadline, f"nobody listens at {endpoint}"
            time.sleep(0.05)


def _heard(sample: zenoh.Sample) -> Heard:
    attachment = sample.attachment
    return Heard(
        sample.payload.to_bytes(),
        str(sample.encoding),
        None if attachment is None else attachment.to_bytes(),
    )


def main() -> None:
    """Listen until killed; print "listening" after the first status."""
    with Outsider(sys.argv[1]) as outsider:
        for name in ("path", "coverage", "pheromone", "status"):
            outsider.listen(name, late=name != "pheromone")
        outsider.ask_status()
        print("listening", flush=True)
        while True:
            time.sleep(1.0)


if __name__ == "__main__":
    main()
