"""Noise of the simulated mapper: settings, and the error of its pose estimate."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Self

from numpy.random import Generator

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.rotation import composed, inverse

SHARES = ("specks", "leg_misses", "jumps")
NOWHERE = Pose2D(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class MapperNoise:
    """How far a mapper's maps and poses are from the truth.

    The defaults are about those of a scan matcher with a lidar of 12 mm, on pixels of 5 cm.

    Attributes:
        seed: of all noise.
        range_m: standard deviation of the scanner's ranges [m].
        specks: share of its rays that end in free space, before a wall.
        leg_misses: share of its rays that miss thin legs, of a few pixels.
        shift_m: largest offset of the map's pixels from the building's, along each axis.
        match_m, match_rad: standard deviation of the pose at which a scan is added, along each
            axis.
        drift_m, drift_rad: standard deviation of the drift of the pose, and of newly mapped parts,
            after a metre's way; after n metres it is sqrt(n) times as large.
        closes_loops: whether the drift is corrected, in the map too, when the robot returns to a
            place mapped long ago.
        jumps: share of scans that are added at a wrong pose; the pose of the next scan is right
            again.
        jump_m: error of such a pose [m].
        late_s: age of a pose when it is published [s].
    """

    seed: int = 0
    range_m: float = 0.012
    specks: float = 0.0005
    leg_misses: float = 0.5
    shift_m: float = 0.05
    match_m: float = 0.006
    match_rad: float = 0.002
    drift_m: float = 0.005
    drift_rad: float = 0.0015
    closes_loops: bool = True
    jumps: float = 0.0
    jump_m: float = 0.1
    late_s: float = 0.05

    @classmethod
    def none(cls) -> Self:
        """Return no noise: maps and poses equal building and robot."""
        return cls().times(0.0)

    def times(self, level: float) -> Self:
        """Return the noise with all amounts multiplied by a factor; shares up to 1."""
        amounts = {
            field.name: level * getattr(self, field.name)
            for field in fields(self)
            if field.name not in ("seed", "closes_loops")
        }
        return replace(self, **{n: min(a, 1.0) if n in SHARES else a for n, a in amounts.items()})


class PoseError:
    """The error of a mapper's pose estimate.

    One part is shared with the map: its frame, which drifts with the way. The other belongs to the
    newest scan alone.
    """

    def __init__(self, noise: MapperNoise, rng: Generator) -> None:
        self._noise = noise
        self._rng = rng
        self._frame = self._match = NOWHERE

    def believed(self, pose: Pose2D) -> Pose2D:
        """Return the mapper's estimate for a robot at ``pose``."""
        drifted, match = composed(self._frame, pose), self._match
        yaw = math.remainder(drifted.yaw + match.yaw, math.tau)
        return Pose2D(drifted.x + match.x, drifted.y + match.y, yaw)

    def true_place(self, x: float, y: float) -> tuple[float, float]:
        """Return the true position of a place on the map [m]."""
        pose = composed(inverse(self._frame), Pose2D(x - self._match.x, y - self._match.y))
        return pose.x, pose.y

    def drift(self, pose: Pose2D, way_m: float) -> None:
        """Let the frame drift while the robot drives on to ``pose``; it turns about the robot."""
        x, y, yaw = (math.sqrt(way_m) * self._rng.standard_normal(3)).tolist()
        noise, at = self._noise, composed(self._frame, pose)
        moved = Pose2D(
            at.x + noise.drift_m * x, at.y + noise.drift_m * y, at.yaw + noise.drift_rad * yaw
        )
        self._frame = composed(moved, inverse(pose))

    def match(self) -> None:
        """Draw the pose error of another scan."""
        noise, (x, y, yaw) = self._noise, self._rng.standard_normal(3).tolist()
        chance, towards = self._rng.random(2).tolist()
        self._match = Pose2D(noise.match_m * x, noise.match_m * y, noise.match_rad * yaw)
        if chance < noise.jumps:
            towards *= math.tau
            self._match = Pose2D(
                self._match.x + noise.jump_m * math.cos(towards),
                self._match.y + noise.jump_m * math.sin(towards),
                self._match.yaw,
            )

    def place(self, pose: Pose2D, there: Pose2D) -> None:
        """Move the frame so that ``pose`` lies ``there``, without the newest scan's error."""
        self._frame = composed(there, inverse(pose))
