"""A mission in the lab: base, mapper and product in one process, tick by tick, and what is noted.

Each tick the base moves by the last command; its pose goes to the product, a scan to the mapper if
that keeps it, the map to the product every three seconds; the product's command moves the base with
the next tick. Nothing reads a clock.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.core.path_exit import PublishedPath
from tests.campaigns.lab.building import Building
from tests.campaigns.lab.own import FRAME, OwnBase, OwnMapper
from tests.campaigns.lab.product import Product, ProductReport
from tests.campaigns.lab.settings import LabSettings, stamp_ns

if TYPE_CHECKING:
    from tests.campaigns.lab.base import Base
    from tests.campaigns.lab.mapper import Mapper

DONE = "done"
# A mission that is done for so long is over [s]: a map may yet bring it more to do.
SURE_S = 5.0
# A robot that has not moved for so long will not move again [s].
GIVE_UP_S = 300.0
MOVED_M, MOVED_RAD = 0.01, 0.03
# The follower gets a scan every so many ticks: ten a second.
SIGHT_TICKS = 2
COLUMNS = (
    "t", "x", "y", "yaw", "speed", "turn_rate", "grip", "touches", "px", "py", "pyaw", "done",
    "touches_person",
)  # fmt: skip


@dataclass(slots=True)
class Trace:
    """What happened tick by tick.

    Attributes:
        rows: of ``COLUMNS``: time [s], true pose, wheels [m/s, rad/s], grip, contact, the pose that
            the product has, whether its mission is done, and who is touched, as of the base.
        paths: the paths published, each with the number of ticks before it.
        states: states of the mission with their reasons, and of the follower, and when each began
            [s].
        maps: the maps, each with the number of ticks before it.
        loops: loops that the mapper closed.
    """

    rows: list[tuple[float, ...]] = field(default_factory=list)
    paths: list[tuple[int, PublishedPath]] = field(default_factory=list)
    states: list[tuple[float, str, str, str]] = field(default_factory=list)
    maps: list[tuple[int, OccupancyGrid]] = field(default_factory=list)
    loops: int = 0

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the columns, each float64 (ticks,)."""
        return dict(zip(COLUMNS, np.array(self.rows, np.float64).T, strict=True))

    def digest(self) -> str:
        """Return a hash over ticks and paths: equal only for missions that are, bit for bit."""
        digest = hashlib.sha256(np.array(self.rows, np.float64).tobytes())
        for tick, path in self.paths:
            digest.update(f"{tick} {path.revision} {path.reason}".encode())
            digest.update(np.ascontiguousarray(path.xy, np.float64).tobytes())
        return digest.hexdigest()[:16]


@dataclass(frozen=True, slots=True, eq=False)
class LabRun:
    """A mission that is over.

    Attributes:
        building, settings: where and how it was made.
        trace: what happened.
        report: what the product says at its end.
    """

    building: Building
    settings: LabSettings
    trace: Trace
    report: ProductReport


def run_mission(building: Building, settings: LabSettings) -> LabRun:
    """Run a mission to its end, or the limit of time."""
    mission = _Running(building, settings)
    while not mission.is_over():
        mission.tick()
    return mission.ended()


class _Running:
    def __init__(self, building: Building, settings: LabSettings) -> None:
        self._building, self._settings = building, settings
        self._base, self._mapper = _base_and_mapper(building, settings)
        self._product = Product(settings.config)
        self._trace = Trace()
        self._limit_s = settings.limit_s(building.free_m2)
        self._pose_ticks = settings.ticks(settings.pose_hz)
        self._scan_ticks = settings.ticks(settings.scan_hz)
        # Since when the mission is done, and the robot has not moved [s].
        self._done_at = math.inf
        self._stood_from, self._stood_at = self._base.truth, 0.0

    def is_over(self) -> bool:
        """Return whether there is nothing more to be seen."""
        now = self._base.now
        return (
            now >= self._limit_s or now - self._done_at > SURE_S or now - self._stood_at > GIVE_UP_S
        )

    def tick(self) -> None:
        base, mapper, product, trace = self._base, self._mapper, self._product, self._trace
        base.tick()
        now, tick = base.now, len(trace.rows) + 1
        pose = mapper.corrected(base.odometry)
        if tick % self._pose_ticks == 0:
            product.hear_pose(StampedPose(pose, FRAME, stamp_ns(now)), now, self._settings.left_m)
        sees = self._settings.scan and tick % SIGHT_TICKS == 0
        is_wanted = tick % self._scan_ticks == 0 and mapper.wants(base.odometry)
        ranges = base.scan() if sees or is_wanted else None
        if sees and ranges is not None:
            product.hear_scan(ranges, now)
        if is_wanted and ranges is not None:
            mapper.take(ranges, base.odometry)
        if (grid := mapper.map_due(now)) is not None:
            product.hear_map(grid)
            trace.maps.append((len(trace.rows), grid))
        command = product.step(now)
        if command is not None:
            base.command(command)
        trace.paths += [(len(trace.rows), path) for path in product.paths]
        product.paths.clear()
        self._note(pose.x, pose.y, pose.yaw)

    def _note(self, px: float, py: float, pyaw: float) -> None:
        base, product, trace = self._base, self._product, self._trace
        now, truth, wheels = base.now, base.truth, base.wheels
        is_done = product.state == DONE
        trace.rows.append(
            (now, truth.x, truth.y, truth.yaw, wheels.speed, wheels.turn_rate, base.grip,
             base.touches, px, py, pyaw, is_done, base.touches_person)
        )  # fmt: skip
        states = product.state, product.reason, product.follower.state.value
        if not trace.states or trace.states[-1][1:] != states:
            trace.states.append((now, *states))
        self._done_at = min(self._done_at, now) if is_done else math.inf
        before = self._stood_from
        turned = abs(math.remainder(truth.yaw - before.yaw, math.tau))
        if math.hypot(truth.x - before.x, truth.y - before.y) > MOVED_M or turned > MOVED_RAD:
            self._stood_from, self._stood_at = truth, now

    def ended(self) -> LabRun:
        self._trace.loops = self._mapper.loops
        return LabRun(self._building, self._settings, self._trace, self._product.report())


def _base_and_mapper(
    building: Building, settings: LabSettings
) -> tuple[Base | OwnBase, Mapper | OwnMapper]:
    if settings.own:
        own = OwnBase(building, settings)
        return own, OwnMapper(own)
    # They are of others, and not everywhere.
    from tests.campaigns.lab.base import Base
    from tests.campaigns.lab.mapper import Mapper

    return Base(building, settings), Mapper()
