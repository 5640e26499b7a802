"""Senseless events into a living daemon behind a router, and what it publishes meanwhile.

Mapper, viewer, router and daemon have a process or a session of their own. All that the daemon says
is decoded, and checked against its schema. What it does not say is looked at from outside: whether
it lives, its log, its memory. Whether a path is right is judged in ``senseless_mission``.
"""

from __future__ import annotations

import json
import re
import shutil
import signal
import time
from collections import Counter, deque
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
import yaml
import zenoh
import zenoh.ext

from fasaco_edge.host.processes import own_mb, peak_mb
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.maps import decode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path
from fasaco_edge.wire.messages.pheromone import decode_pheromone
from tests.campaigns import raw_messages
from tests.campaigns.senseless import SILENT, Event, pixels_of
from tests.support.processes import Daemon, daemon_process, free_endpoint
from tests.support.router import router_process
from tests.support.service_manager import Manager
from tests.wire.schemas import check

PREFIX = "fasaco/@v1/robot"
ROS = {"map": "map", "tf": "tf", "tf_static": "tf_static"}
UNIT = Path(__file__).parents[2] / "deploy" / "fasaco-edge.service"
# Of the loop's turns, so many may take over 100 ms.
LATE_SHARE = 0.001
# So long an answer, a state, a daemon or a router is waited for, on the slowest machine [s].
PATIENCE_S = 150.0
# How a session looks for a router that has gone [ms].
SOON = {"period_init_ms": 100, "period_max_ms": 500}
# An honest mapper says its map again every so many poses.
MAP_AGAIN_EVERY = 50
# Puts between two looks at what came.
LOOK_EVERY = 100


class BrokenPromiseError(AssertionError):
    """The daemon did, or said, what it never may."""


def unit_memory_mb() -> float:
    """Return what the service may have at most [MB]."""
    (limit,) = re.findall(r"^MemoryMax=(\d+)M$", UNIT.read_text(), re.MULTILINE)
    return int(limit) * 1.048576


class Judge:
    """Looks at all that comes.

    Attributes:
        counts: of what was looked at.
        walk: the newest path, float64 (n, 2) [m]; the honest robot drives it.
        status: the newest one.
    """

    def __init__(self) -> None:
        self.counts = Counter[str]()
        self.walk = np.empty((0, 2))
        self.driven = 0
        self.status: dict[str, Any] = {}
        self._heard: deque[tuple[str, bytes, bytes | None]] = deque()

    def hear(self, name: str, sample: zenoh.Sample) -> None:
        """Note a sample, on a Zenoh thread."""
        beside = sample.attachment
        payload = sample.payload.to_bytes()
        attachment = None if beside is None else beside.to_bytes()
        self._heard.append((name, payload, attachment))

    def forget(self) -> None:
        """Forget what came from a daemon that is gone."""
        self._heard.clear()

    def look(self) -> None:
        """Look at all that came since the last time."""
        while self._heard:
            name, payload, beside = self._heard.popleft()
            self.counts[f"heard: {name}"] += 1
            if name == "status":
                self._see_status(json.loads(payload))
            elif name == "path":
                check("path_attachment.json", json.loads(beside or b"{}"))
                self.walk, self.driven = decode_path(payload).xy, 0
            elif name == "coverage":
                decode_occupancy_grid(payload)
            elif name == "pheromone":
                decode_pheromone(payload)
            else:
                check("mission.json", json.loads(payload))

    def _see_status(self, status: dict[str, Any]) -> None:
        check("status.json", status)
        self.status = status
        coverage = status["coverage"]
        if coverage is not None:
            chain = [0, coverage["recovered"], coverage["covered"], coverage["coverable"]]
            promise(chain == sorted(chain), f"coverage {coverage}")
            whole = coverage["covered"] + coverage["remaining"] == coverage["coverable"]
            promise(whole, f"coverage {coverage}")


class Campaign:
    """A daemon, and everybody who talks to it.

    Attributes:
        counts: events by kind, answers, and what was judged.
        loop: turns of the loop over all lives, how many were late, and the worst figures [ms].
        recovered_s: how long each return to an honest state took [s].
    """

    def __init__(self, folder: Path, pace_hz: float) -> None:
        self.judge = Judge()
        self.counts = Counter[str]()
        self.loop = {"turns": 0, "late": 0, "p50": 0.0, "p99": 0.0, "p99_9": 0.0, "max": 0.0}
        self.stalls: list[tuple[float, str]] = []
        self.memory = {"most_resident_mb": 0.0, "peak_mb": 0.0}
        self.recovered_s: list[float] = []
        self._folder = folder
        self._endpoint = free_endpoint()
        self._period_s, self._due = 1.0 / pace_hz, time.monotonic()
        self._router, self._lives, self._sessions = ExitStack(), ExitStack(), ExitStack()
        self._daemon: Daemon
        self._puts = 0
        self._recent: deque[str] = deque(maxlen=12)
        self._longest_ms = 0.0
        self._answers: deque[tuple[str, Any]] = deque()

    def __enter__(self) -> Self:
        self._router.enter_context(router_process(self._endpoint))
        self._viewer = self._session()
        for name in ("path", "status", "coverage", "pheromone", "command"):
            hear = partial(self.judge.hear, name)
            self._viewer.declare_subscriber(f"{PREFIX}/{name}", hear)
        self._sessions.callback(self._viewer.close)
        self._mapper: zenoh.Session | None = None
        self._masks: Any = zenoh.ext.declare_advanced_publisher(
            self._viewer,
            f"{PREFIX}/keep_out_mask",
            encoding=zenoh.Encoding(f"application/cdr;{schemas.OCCUPANCY_GRID}"),
            cache=zenoh.ext.CacheConfig(max_samples=1),
            publisher_detection=True,
        )
        self._another_mapper(stays=False)
        self._start({"mode": "client", "fresh": False, "sections": {}})
        return self

    def __exit__(self, *_: object) -> None:
        # In this order: who is connected goes before what it is connected to.
        for stack in (self._sessions, self._lives, self._router):
            stack.close()

    def perform(self, event: Event) -> Event:
        """Do what an event says; return it as it was done, with the place of each pose."""
        name = event["do"]
        self._recent.append(name)
        match name:
            case "wait":
                time.sleep(event["s"])
            case "checkpoint":
                self._check(event["map"])
            case "restart":
                self._restart(event)
            case "reload":
                self._reload(event["sections"])
            case "publisher":
                self._another_mapper(stays=event["stays"])
            case "mask":
                self._put_mask(event)
            case "command":
                self._ask("mission", event["document"])
            case "ask":
                self._ask(event["name"], parameters=event["parameters"])
            case "drive":
                event = self._driven(event)
                self._put("pose", event)
            case _:
                self._put(name, event)
        if name not in SILENT:
            self.counts[name] += 1
            self._keep_pace()
        self._puts += 1
        if self._puts % LOOK_EVERY == 0:
            self.look()
        return event

    def look(self) -> None:
        """Look at what came and was answered, and whether the daemon lives."""
        self._look_at_process()
        self.judge.look()
        while self._answers:
            self._see_answer(*self._answers.popleft())
        told = self.judge.status.get("loop_ms", {})
        if (told.get("max") or 0.0) > self._longest_ms:
            self._longest_ms = told["max"]
            about = self.judge.status["map"]
            self.stalls.append((told["max"], f"{' '.join(self._recent)}; map {about}"))
            self.stalls = sorted(self.stalls, reverse=True)[:8]

    # Messages.

    def _put(self, name: str, event: Event) -> None:
        key, payload, schema = f"{PREFIX}/{name}", b"", ""
        match name:
            case "map":
                payload = raw_messages.occupancy_grid(event, pixels_of(event))
                if event["topic"] == "map":
                    self._map.put(payload)
                    return
                key = ROS["map"]
            case "update":
                key, schema = f"{PREFIX}/map_update", schemas.OCCUPANCY_GRID_UPDATE
                payload = raw_messages.update(event)
            case "pose":
                payload = raw_messages.pose(event)
                schema = raw_messages.POSE_SCHEMAS[event["type"]]
            case "tf":
                key = ROS["tf_static" if event["static"] else "tf"]
                payload = raw_messages.transform(event)
        encoding = zenoh.Encoding(f"application/cdr;{schema}") if schema else None
        block = zenoh.CongestionControl.BLOCK
        assert self._mapper is not None
        self._mapper.put(key, payload, encoding=encoding, congestion_control=block)

    def _put_mask(self, event: Event) -> None:
        self._masks.put(raw_messages.occupancy_grid(event, pixels_of(event)))

    def _driven(self, event: Event) -> Event:
        """Return the pose of a robot that has driven to the next cell of its path."""
        judge = self.judge
        if "x" in event:
            return event
        if len(judge.walk):
            judge.driven = min(judge.driven + 1, len(judge.walk) - 1)
            x, y = judge.walk[judge.driven].tolist()
        else:
            x, y = 1.0, 1.0
        place = {"x": x + event["off"], "y": y, "yaw": 0.0, "frame": "map", "stamp": 1}
        return {**event, **place, "type": "PoseStamped"}

    def _ask(self, name: str, document: object = None, parameters: str = "") -> None:
        """Ask; the answer is looked at when it comes."""
        key = f"{PREFIX}/@rpc/{name}"
        payload = None if document is None else json.dumps(document).encode()

        def note(reply: zenoh.Reply) -> None:
            answer = reply.ok or reply.err
            if answer is not None:
                came = (reply.ok is not None, answer.payload.to_bytes(), str(answer.encoding))
                self._answers.append((str(reply.ok.key_expr) if reply.ok else name, came))

        selector = f"{key}?{parameters}" if parameters else key
        self._viewer.get(selector, note, payload=payload, timeout=5.0)

    def _see_answer(self, key: str, came: tuple[bool, bytes, str]) -> None:
        is_good, payload, encoding = came
        if not is_good:
            document = json.loads(payload)
            if "code" in document:
                check("error.json", document)
                self.counts[f"answer: {document['code']}"] += 1
            return
        name = key.rpartition("/")[2]
        if "cdr" in encoding:
            decode = {"path": decode_path, "coverage": decode_occupancy_grid}
            decode.get(name, decode_pheromone)(payload)
        else:
            check({"mission": "reply.json"}.get(name, f"{name}.json"), json.loads(payload))
        self.counts["answer: good"] += 1

    def _keep_pace(self) -> None:
        """Wait where events come faster than they should."""
        self._due = max(self._due + self._period_s, time.monotonic() - 0.2)
        ahead_s = self._due - time.monotonic()
        if ahead_s > 0.005:
            time.sleep(ahead_s)

    # Processes and sessions.

    def _session(self) -> zenoh.Session:
        config = {
            "mode": "client",
            "connect": {"endpoints": [self._endpoint], "timeout_ms": 20_000, "retry": SOON},
            "scouting": {"multicast": {"enabled": False}},
            "timestamping": {"enabled": True},
        }
        return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))

    def _another_mapper(self, *, stays: bool) -> None:
        """Let another mapper publish; the one before stays, with its latched map, or goes."""
        session = self._session()
        self._map: Any = zenoh.ext.declare_advanced_publisher(
            session,
            f"{PREFIX}/map",
            encoding=zenoh.Encoding(f"application/cdr;{schemas.OCCUPANCY_GRID}"),
            congestion_control=zenoh.CongestionControl.BLOCK,
            cache=zenoh.ext.CacheConfig(max_samples=1),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(
                heartbeat=None, sporadic_heartbeat=None
            ),
            publisher_detection=True,
        )
        mappers = self._mappers = getattr(self, "_mappers", [])
        mappers.append((session, self._map))
        # At most two whose maps stand.
        while len(mappers) > (2 if stays else 1):
            mappers.pop(0)[0].close()
        if self._mapper is None:
            self._sessions.callback(lambda: [each.close() for each, _ in self._mappers])
        self._mapper = session

    def _start(self, event: Event) -> None:
        sections = {name: dict(section) for name, section in event["sections"].items()}
        robot = {"tool_width_m": 0.3, "radius_m": 0.18} | sections.pop("robot", {})
        mission = {"lost_pose_s": 3.0} | sections.pop("mission", {})
        mission["keep_out_topic"] = bool(event.get("masks"))
        maps = {"free_at_most": 25} | sections.pop("map", {})
        notes = self._folder / f"life{self.counts['lives']}"
        notes.mkdir()
        manager = Manager(notes)
        self._lives.callback(manager.close)
        self._daemon = self._lives.enter_context(
            daemon_process(
                self._folder,
                *(["--fresh"] if event["fresh"] else []),
                env={"NOTIFY_SOCKET": manager.address},
                executed=True,
                bus={"mode": event["mode"], "listen": [], "connect": [self._endpoint]},
                robot=robot,
                mission=mission,
                map=maps,
                **sections,
            )
        )
        self.judge.walk = np.empty((0, 2))
        self._longest_ms = 0.0
        self._wait("the daemon is there", lambda: self._asked_status() is not None)
        self.counts["lives"] += 1

    def _restart(self, event: Event) -> None:
        """End the daemon, and start another one where the maps that are latched stand."""
        self._end_life(kill=event["kill"])
        self._start(event)

    def _end_life(self, *, kill: bool) -> None:
        self.look()
        self._note_loop()
        if kill:
            self._daemon.process.send_signal(signal.SIGKILL)
            self._daemon.process.wait()
        self._lives.close()
        self._lives = ExitStack()
        self.judge.look()
        for file in (*self._folder.glob("daemon*.log"), *self._folder.glob("daemon*.yaml")):
            promise("Traceback" not in file.read_text(errors="replace"), f"traceback in {file}")
            file.unlink()

    def end(self) -> None:
        """End the last life, in order."""
        self._end_life(kill=False)

    def revive(self) -> None:
        """Go on with another daemon, which knows nothing, after something was found."""
        with suppress(AssertionError):
            self._lives.close()
        self._lives = ExitStack()
        for file in self._folder.glob("daemon*"):
            file.unlink()
        shutil.rmtree(self._folder / "state", ignore_errors=True)
        self._answers.clear()
        self.judge.forget()
        self._another_mapper(stays=False)
        self._start({"mode": "client", "fresh": True, "sections": {}})

    def _reload(self, sections: Event) -> None:
        file = self._daemon.log.with_suffix(".yaml")
        before = yaml.safe_load(file.read_text())
        after = {**before, **{key: before.get(key, {}) | part for key, part in sections.items()}}
        file.write_text(yaml.safe_dump(after))
        self._daemon.process.send_signal(signal.SIGHUP)

    # What has to hold.

    def _asked_status(self) -> dict[str, Any] | None:
        """Return the status as the daemon replies when asked; None without a reply."""
        self._look_at_process()
        for reply in self._viewer.get(f"{PREFIX}/@rpc/status", timeout=2.0):
            if reply.ok is not None:
                status: dict[str, Any] = json.loads(reply.ok.payload.to_bytes())
                check("status.json", status)
                return status
        return None

    def _check(self, event: Event) -> None:
        """Be an honest robot for once; look how soon the daemon is honest, too."""
        self.look()
        self.memory["most_resident_mb"] = max(
            self.memory["most_resident_mb"], own_mb(self._daemon.pid)
        )
        started = time.monotonic()
        self._put_mask(event | {"kind": "free"})
        for command in ("reset", "start"):
            self._ask("mission", {"command": command, "discard": True})
        # One mapper: of two whose maps stand, the daemon has the one it was given last.
        while len(self._mappers) > 1:
            self._mappers.pop(0)[0].close()
        places = 0

        def honest() -> bool:
            nonlocal places
            if places % MAP_AGAIN_EVERY == 0:
                self._put("map", event | {"topic": "map"})
            places += 1
            place = {"x": 1.0 + 0.01 * (places % 5), "y": 1.0, "yaw": 0.0, "stamp": 1}
            self._put("pose", place | {"type": "PoseStamped", "frame": event["frame"]})
            status = self._asked_status()
            if status is None or status["map"] is None or status["pose"] is None:
                return False
            is_taken = status["map"]["stamp_ns"] == event["stamp"]
            settled = status["state"] in ("planning", "covering", "returning", "done", "blocked")
            return is_taken and settled and abs(status["pose"]["x"] - 1.0) < 0.1

        self._wait("an honest map and pose lead to an honest state", honest)
        self.recovered_s.append(time.monotonic() - started)
        self._note_memory()

    def _wait(self, what: str, holds: Any) -> None:
        deadline = time.monotonic() + PATIENCE_S
        while not holds():
            self.judge.look()
            told = ("state", "reason", "map", "pose", "errors")
            about = {key: self.judge.status.get(key) for key in told}
            promise(time.monotonic() < deadline, f"never: {what}; {about}")
            time.sleep(0.02)
        self._due = time.monotonic()

    def _look_at_process(self) -> None:
        code = self._daemon.process.poll()
        promise(code is None, f"the daemon ended with {code}: {self._daemon.log_text()[-3000:]}")

    def _note_memory(self) -> None:
        peak = peak_mb(self._daemon.pid)
        self.memory["peak_mb"] = max(self.memory["peak_mb"], peak)
        promise(peak < unit_memory_mb(), f"{peak:.0f} MB were resident")

    def _note_loop(self) -> None:
        """Add this life's turns to those of all."""
        self._note_memory()
        status = self._asked_status()
        for key, value in (status["loop_ms"] if status else {}).items():
            if key in ("turns", "late"):
                self.loop[key] += value
            else:
                self.loop[key] = max(self.loop[key], value or 0.0)


def promise(holds: bool, what: str) -> None:
    """Raise where something does not hold.

    Raises:
        BrokenPromiseError: it does not.
    """
    if not holds:
        raise BrokenPromiseError(what)
