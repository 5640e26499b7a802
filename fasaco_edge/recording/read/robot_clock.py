"""The robot's clock in a recording: simulated seconds for a simulated robot.

A recording holds the times at which the recorder received the samples. A simulated robot's clock
may run faster (`robot.time_scale` of its configuration), and on a busy computer slower than
configured: the stamps of the poses give its time. Before the first pose and after the last one,
both clocks run at the same rate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.client.phrases import scale_words
from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.settings import KnownSettings, known_settings
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.schemas import POSE_STAMPED

Seconds = NDArray[np.float64]
# If the second of two stamps is earlier than the first, or much later than expected, the simulation
# was restarted between them, and the recorder's clock counts there. Much later: by more than this
# many times the expected time plus a second.
MOST_TIMES = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class RobotClock:
    """Converts the recorder's times into the robot's seconds since the recording began.

    Attributes:
        began_ns: beginning of the recording, by the recorder's clock [ns].
        scale: simulated seconds per second, as configured; 1 for a real robot.
        recorder_s, robot_s: times of each pose by both clocks [s], float64 (n,), non-decreasing;
            a single 0 for a real robot, whose clock is the recorder's.
    """

    began_ns: int
    scale: float = 1.0
    recorder_s: Seconds = field(default_factory=lambda: np.zeros(1))
    robot_s: Seconds = field(default_factory=lambda: np.zeros(1))

    @classmethod
    def of(cls, statuses: Iterable[Arrival], poses: Iterable[Arrival], began_ns: int) -> RobotClock:
        """Return the clock of a recording; ``poses`` are read only for a simulated robot."""
        known = known_of(statuses)
        scale = known.robot.time_scale
        if scale == 1.0 or not 0.0 < scale < math.inf:
            return cls(began_ns)
        times = [(at_ns - began_ns, pose.stamp_ns) for at_ns, pose in poses_of(known, poses)]
        if not times:
            return cls(began_ns, scale)
        came_s, stamps_s = 1e-9 * np.array(sorted(times), np.int64).T
        return cls.by_stamps(began_ns, scale, came_s, stamps_s)

    @classmethod
    def by_stamps(
        cls, began_ns: int, scale: float, came_s: Seconds, stamps_s: Seconds
    ) -> RobotClock:
        """Return the clock given by arrival and stamp of each pose [s], float64 (n,), n >= 1."""
        passed_s, stamped_s = np.diff(came_s), np.diff(stamps_s)
        is_valid = (stamped_s >= 0.0) & (stamped_s <= MOST_TIMES * scale * (passed_s + 1.0))
        steps_s = np.where(is_valid, stamped_s, passed_s)
        return cls(began_ns, scale, came_s, came_s[0] + np.cumsum([0.0, *steps_s]))

    @property
    def words(self) -> str:
        """The simulation's speed in words; "" for a real robot."""
        return scale_words(self.scale)

    def seconds(self, at_ns: int) -> float:
        """Convert a time of the recorder [ns] to the robot's time since the beginning [s]."""
        return float(self.all_seconds(np.array([at_ns]))[0])

    def all_seconds(self, at_ns: NDArray[np.int64]) -> Seconds:
        """Convert times of the recorder (n,) [ns] as ``seconds`` does, float64 (n,)."""
        recorder_s: Seconds = 1e-9 * (at_ns - self.began_ns).astype(np.float64)
        return _converted(recorder_s, self.recorder_s, self.robot_s)

    def wall_ns(self, robot_s: float) -> int:
        """Convert the robot's time since the beginning [s] to the recorder's time [ns]."""
        (recorder_s,) = _converted(np.array([robot_s]), self.robot_s, self.recorder_s)
        return self.began_ns + round(1e9 * float(recorder_s))


def clock(seconds: float) -> str:
    """Return a time of a recording as minutes and seconds, or with hours."""
    tenths = round(seconds, 1)
    minutes, rest = divmod(abs(tenths), 60)
    hours, minutes = divmod(int(minutes), 60)
    text = f"{hours}:{minutes:02d}:{rest:04.1f}" if hours else f"{minutes}:{rest:04.1f}"
    return f"-{text}" if tenths < 0 else text


def known_of(statuses: Iterable[Arrival]) -> KnownSettings:
    """Return the settings in the first status that has any; the defaults if none has."""
    return next(filter(None, map(_settings, statuses)), KnownSettings())


def poses_of(known: KnownSettings, samples: Iterable[Arrival]) -> Iterator[tuple[int, StampedPose]]:
    """Yield the poses in samples, each with its arrival by the recorder's clock [ns]."""
    decoder = PoseDecoder(known.pose.schema or POSE_STAMPED)
    if frames := known.ros2.frames:
        decoder.follow((frames.map, frames.robot))
    for arrival in samples:
        sample, is_static = arrival.sample, arrival.topic == "tf_static"
        with suppress(FasacoError):
            pose = decoder.decode(sample.payload, sample.schema, is_static=is_static)
            if pose is not None:
                yield arrival.wall_ns, pose


def _settings(arrival: Arrival) -> KnownSettings | None:
    with suppress(FasacoError):
        if config := decode_tolerant(arrival.sample.payload, Status).config:
            return known_settings(config)
    return None


def _converted(at_s: Seconds, these: Seconds, those: Seconds) -> Seconds:
    """Convert times of one clock to the other; outside known times both run at the same rate."""
    before, after = np.minimum(at_s - these[0], 0.0), np.maximum(at_s - these[-1], 0.0)
    return np.asarray(np.interp(at_s, these, those) + before + after, np.float64)
