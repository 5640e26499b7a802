"""What holds at a moment of a recording: each part begins with it, so that it can be read alone."""

from __future__ import annotations

import numpy as np

from fasaco_edge.recording import entities
from fasaco_edge.recording.sdk import rr, rrb
from fasaco_edge.recording.streams import send_blueprint


class Standing:
    """Static data, the newest of what is latched, name, properties, layout and times.

    Attributes:
        wall_ns: the time of what is logged next [ns].
    """

    def __init__(self, name: str, blueprint: rrb.Blueprint) -> None:
        self.wall_ns = 0
        self.blueprint = blueprint
        self.name = name
        self.properties: dict[str, str] = {}
        self.static: dict[str, tuple[rr.AsComponents, ...]] = {}
        self.sequences: dict[str, int] = {}
        self._latched: dict[str, rr.AsComponents] = {}
        self._missed_ns: dict[str, int] = {}

    def latch(self, entity: str, archetype: rr.AsComponents, *, missed: bool) -> None:
        """Keep what is in force from now on; ``missed``: it was not written."""
        self._latched[entity] = archetype
        if missed:
            self._missed_ns[entity] = self.wall_ns

    def begin(self, stream: rr.RecordingStream) -> None:
        """Begin a part with all that holds."""
        send_blueprint(stream, self.blueprint)
        self.send_description(stream)
        for entity, archetypes in self.static.items():
            stream.log(entity, *archetypes, static=True)
        self.send_latched(stream)

    def send_description(self, stream: rr.RecordingStream) -> None:
        """Write name and properties."""
        stream.send_recording_name(self.name)
        if self.properties:
            stream.send_property(entities.APPLICATION, rr.AnyValues(**self.properties))

    def send_latched(self, stream: rr.RecordingStream) -> None:
        """Write what is latched, what was missed at the time it came."""
        for entity, archetype in self._latched.items():
            # What came while nothing was written is in force since then.
            self._set_times(stream, self._missed_ns.get(entity, self.wall_ns))
            stream.log(entity, archetype)
        self._missed_ns.clear()
        self.set_times(stream)

    def set_times(self, stream: rr.RecordingStream) -> None:
        """Set the times of what is logged next."""
        self._set_times(stream, self.wall_ns)

    def _set_times(self, stream: rr.RecordingStream, wall_ns: int) -> None:
        stream.set_time(entities.WALL, timestamp=np.datetime64(wall_ns, "ns"))
        for timeline, number in self.sequences.items():
            stream.set_time(timeline, sequence=number)
