"""The mission's inputs in a recording, byte for byte, beside their drawings.

Samples are gathered for almost a second, and then written as one blob, without Rerun's batching:
``kill -9`` loses at most that second. Each part begins with all samples in force, so that it can be
read without earlier parts.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from dataclasses import replace
from typing import Final

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.recording import entities
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.samples import Numbered, SampleEncoder
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST, digest
from fasaco_edge.wire.documents.rooms import Rooms
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.messages.paths import decode_path
from fasaco_edge.wire.topics import RECORDED_INPUTS

# Topics whose samples have an effect only on arrival; samples of all others stay in force.
TRANSIENT: Final = ("pose", "command", "turns")
PERIOD_NS = 900_000_000
STATUS_PERIOD_NS = round(1e9 * entities.STATUS_PERIOD_S)
WAITING_BYTES = 4_000_000
# Limit on the kept samples of static transforms: each node publishes its transforms once.
MOST_STATIC = 64
# Limit on the updates since the last map; beyond it a part begins without the map [bytes].
IN_FORCE_BYTES = 8_000_000


class InputLog:
    """Writes samples into a writer; only the writer's thread calls it.

    Inputs are written in full, paths as a digest. A status or a message about rooms is written when
    its content changes, else once in ``STATUS_PERIOD_NS`` to show progress, and at the end.
    """

    def __init__(self, writer: RecordingWriter, run: int) -> None:
        self._writer = writer
        self._encoder = SampleEncoder(run)
        self._in_force = _InForce()
        self._part = 0
        self._lost = 0
        self._next_ns = 0
        # For status and rooms: content and time of the last written sample, and the newest sample
        # since.
        self._kept: dict[str, tuple[object, int]] = {}
        self._late: dict[str, Arrival] = {}
        self._now_ns = (0, 0)
        self._period_ns: float = STATUS_PERIOD_NS

    def add(self, arrival: Arrival) -> None:
        """Take a sample; ignore a topic that is not recorded."""
        self._now_ns = arrival.at_ns, arrival.wall_ns
        if arrival.topic == "path":
            arrival = _path_digest(arrival)
        elif arrival.topic not in RECORDED_INPUTS and not self._is_due(arrival):
            return
        self._in_force.note(self._encoder.add(arrival))
        if self._encoder.waiting_bytes > WAITING_BYTES:
            self.write()

    def note_lost(self, lost: Counter[str]) -> None:
        """Note the total number of lost samples of each topic."""
        count = sum(lost[topic] for topic in RECORDED_INPUTS)
        self._encoder.skip(count - self._lost)
        self._lost = count

    def write_if_due(self, now_ns: int) -> None:
        """Write the gathered samples about once a second; ``now_ns``: monotonic [ns]."""
        if now_ns >= self._next_ns:
            self._next_ns = now_ns + PERIOD_NS
            self.write()

    def finish(self) -> None:
        """Write the remaining samples; a part that has just begun gets a batch in any case."""
        at_ns, wall_ns = self._now_ns
        for late in self._late.values():
            # The times of samples have to increase.
            self._in_force.note(self._encoder.add(replace(late, at_ns=at_ns, wall_ns=wall_ns)))
        part = self._writer.part_number
        self.write(in_any_case=part > 1 and part != self._part)

    def write(self, *, in_any_case: bool = False) -> None:
        """Write the gathered samples; ``in_any_case``: a batch even without samples."""
        if self._part != self._writer.part_number:
            self._part = self._writer.part_number
            self._encoder.restart(self._in_force.samples())
        batch = self._encoder.take(in_any_case=in_any_case)
        if batch and not self._writer.write_blob(batch):
            # Samples may refer only to written ones: the next batch starts anew.
            self._part = 0

    def _is_due(self, arrival: Arrival) -> bool:
        """Return whether status or rooms have new content, or their last written sample is old."""
        topic = arrival.topic
        if topic not in ("status", "rooms"):
            return False
        try:
            if topic == "status":
                status = decode_tolerant(arrival.sample.payload, Status)
                # In the time of the robot, which may be simulated faster than life.
                self._period_ns = STATUS_PERIOD_NS / known_settings(status.config).pace
                news = _status_news(status)
            else:
                news = _rooms_news(arrival)
        except MalformedMessage:
            return False
        before, kept_ns = self._kept.get(topic, (None, 0))
        if news == before and arrival.at_ns - kept_ns < self._period_ns:
            self._late[topic] = arrival
            return False
        self._kept[topic] = news, arrival.at_ns
        self._late.pop(topic, None)
        return True


def _status_news(status: Status) -> object:
    return (
        # The first status with a map shows that the mission has begun.
        *(status.state, status.map is not None, status.version, status.config),
        sorted(status.errors.by_code),
        [trouble.code for trouble in status.troubles],
        status.ledger.fault,
        status.recorder and status.recorder.state,
    )


def _rooms_news(arrival: Arrival) -> object:
    found = decode_tolerant(arrival.sample.payload, Rooms)
    return found.frame, found.revision


def _path_digest(arrival: Arrival) -> Arrival:
    """Return the digest of a path, whose many points are not an input of the mission."""
    payload = arrival.sample.payload
    with contextlib.suppress(MalformedMessage):
        payload = decode_path(payload).xy.tobytes()
    before = arrival.sample
    sample = Sample(before.key, digest(payload), before.schema, before.attachment)
    return replace(arrival, topic=PATH_DIGEST, sample=sample)


class _InForce:
    """The samples in force: the map, its updates, the newest sample of each other latched topic.

    Several nodes publish static transforms: each different message is in force.
    """

    def __init__(self) -> None:
        self._newest: dict[str, Numbered] = {}
        self._static: dict[bytes, Numbered] = {}
        self._updates: list[Numbered] = []
        self._updates_bytes = 0

    def note(self, numbered: Numbered) -> None:
        topic = numbered.arrival.topic
        if topic == "map":
            self._updates, self._updates_bytes = [], 0
        if topic == "tf_static":
            self._static[numbered.arrival.sample.payload] = numbered
            while len(self._static) > MOST_STATIC:
                del self._static[next(iter(self._static))]
        elif topic != "map_update":
            self._newest[topic] = numbered
        elif "map" in self._newest:
            self._updates.append(numbered)
            self._updates_bytes += len(numbered.arrival.sample.payload)
            if self._updates_bytes > IN_FORCE_BYTES:
                # Without its updates the map would be wrong.
                del self._newest["map"]
                self._updates, self._updates_bytes = [], 0

    def samples(self) -> list[Numbered]:
        newest = [numbered for topic, numbered in self._newest.items() if topic not in TRANSIENT]
        held = (*newest, *self._static.values(), *self._updates)
        return sorted(held, key=lambda numbered: numbered.number)
