"""The data in a run's samples: poses, map, published paths, statuses, commands and plans."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeVar

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.config.reading import renamed
from fasaco_edge.errors import BadConfiguration, FasacoError, MalformedMessage
from fasaco_edge.grid.geometry import Polygon
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.coverage.ledger import JUMP_CELLS
from fasaco_edge.mission.orders.commands import read_command
from fasaco_edge.mission.orders.mask import mask_polygons
from fasaco_edge.mission.orders.order import Command
from fasaco_edge.recording.read.robot_clock import RobotClock
from fasaco_edge.recording.read.run import RecordedSamples, RunRecord
from fasaco_edge.wire.documents.json_text import Settings, decode_json, decode_tolerant
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST, PathAttachment
from fasaco_edge.wire.documents.replies import CoverageReport, FloorReport
from fasaco_edge.wire.documents.rooms import Rooms
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.messages.maps import decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.schemas import POSE_STAMPED

Part = TypeVar("Part")
# Smaller areas may come from the noise of poses and times [m2].
SURELY_SWEPT_M2 = 0.1


@dataclass(frozen=True, slots=True)
class PathSample:
    """A path's attachment, and the path's arrival since the recording began [s]."""

    at_s: float
    about: PathAttachment

    @property
    def plan_ms(self) -> float | None:
        """Duration of planning [ms]; None if no plan was needed."""
        return self.about.plan_ms if self.about.planner else None


@dataclass(frozen=True, slots=True)
class StatusSample:
    """A status, and its arrival since the recording began [s]."""

    at_s: float
    status: Status


@dataclass(slots=True)
class RunData:
    """All data in the samples; times are the robot's [s] since the recording began.

    Attributes:
        pose_s, poses: arrival of each pose, and its x [m], y [m], yaw [rad].
        map_s: arrival of each map and map update.
        paths, statuses: newest last.
        commands: arrival of each, and the command.
        grid: the map at the end, with all updates.
        ordered_keep_out: keep-out polygons of the last order [m].
        zones: zone polygons of the last order [m]; empty without an order, or for everything.
        rooms: the rooms at the end; empty if none were recorded.
        config, version, robot: configuration, version and name in the daemon's last status.
        undecodable: number of samples that could not be decoded, by topic.
        last_s: arrival of the last sample.
        time_scale: simulated seconds per second; 1 for a real robot.
    """

    pose_s: list[float] = field(default_factory=list)
    poses: list[tuple[float, float, float]] = field(default_factory=list)
    map_s: list[float] = field(default_factory=list)
    paths: list[PathSample] = field(default_factory=list)
    statuses: list[StatusSample] = field(default_factory=list)
    commands: list[tuple[float, Command]] = field(default_factory=list)
    grid: OccupancyGrid | None = None
    ordered_keep_out: tuple[Polygon, ...] = ()
    zones: tuple[Polygon, ...] = ()
    rooms: Rooms = field(default_factory=Rooms)
    config: Settings = field(default_factory=dict)
    version: str = ""
    robot: str = ""
    undecodable: Counter[str] = field(default_factory=Counter)
    last_s: float = 0.0
    time_scale: float = 1.0

    @property
    def restored_cells(self) -> int:
        """Number of cells covered before a restart of the daemon."""
        return max((each.status.ledger.restored_cells for each in self.statuses), default=0)

    @property
    def swept_before_m2(self) -> float:
        """Floor of the order swept before the recording began [m2], approximately.

        It is the swept floor of the first report, minus what the tool can have swept since the
        beginning; 0 if the order began later.
        """
        reports = [(each.at_s, each.status.floor) for each in self.statuses]
        swept = [(at_s, floor.swept_m2) for at_s, floor in reports if floor is not None]
        anew = any(later < m2 - SURELY_SWEPT_M2 for (_, m2), (_, later) in pairwise(swept))
        if not swept or anew:
            return 0.0
        at_s, m2 = swept[0]
        tool_m = known_settings(self.config).robot.tool_width_m or 0.0
        length_m = float(self.lengths_m[self.times[1:] <= at_s].sum())
        before_m2 = m2 - tool_m * (length_m + tool_m)
        return before_m2 if before_m2 > SURELY_SWEPT_M2 else 0.0

    def last(self, part: Callable[[Status], Part | None]) -> Part | None:
        """Return a part of the last status that has it; None if none has."""
        found = (part(each.status) for each in reversed(self.statuses))
        return next((one for one in found if one is not None), None)

    @property
    def counts(self) -> CoverageReport | None:
        """The daemon's last count of cells."""
        return self.last(lambda status: status.coverage)

    @property
    def ledger_floor(self) -> FloorReport | None:
        """The daemon's last report of the floor."""
        return self.last(lambda status: status.floor)

    @property
    def ordered_floor(self) -> FloorReport | None:
        """The daemon's last report before a cancellation, after which no floor has to be swept."""
        held = self.last(lambda s: s.floor if s.floor and s.floor.reachable_m2 else None)
        return held or self.ledger_floor

    @property
    def keep_out(self) -> tuple[Polygon, ...]:
        """Keep-out zones in force at the end, of the last order, configuration and operator [m]."""
        always = known_settings(self.config).mission
        polygons = self.ordered_keep_out + always.keep_out
        drawn = self.statuses[-1].status.mission.keep_outs if self.statuses else ()
        polygons += tuple(each.polygon for each in drawn if each.by == "operator" and each.polygon)
        with suppress(BadConfiguration):
            polygons += mask_polygons(always.keep_out_mask)
        return polygons

    @property
    def footprint(self) -> Footprint | None:
        """Tool, robot and thresholds of the configuration; None if unknown."""
        known = known_settings(self.config)
        cell_m, radius_m = known.cell_m, known.robot.radius_m
        if not cell_m or not radius_m:
            return None
        free, occupied = known.map.free_at_most, known.map.occupied_at_least
        usual = Footprint(cell_m, radius_m)
        return Footprint(
            cell_m,
            radius_m,
            usual.free_at_most if free is None else free,
            usual.occupied_at_least if occupied is None else occupied,
        )

    @property
    def lengths_m(self) -> NDArray[np.float64]:
        """Distance from each pose to the next [m], float64 (n - 1,)."""
        return np.asarray(np.hypot(*np.diff(self.track[:, :2], axis=0).T), np.float64)

    @property
    def jumps(self) -> NDArray[np.bool_]:
        """Whether the robot jumped from each pose to the next, bool (n - 1,)."""
        jump_m = JUMP_CELLS * self.footprint.cell_m if self.footprint else math.inf
        return self.lengths_m > jump_m

    @property
    def ways_m(self) -> NDArray[np.float64]:
        """Driven distance from each pose to the next, 0 for jumps [m], float64 (n - 1,)."""
        return np.where(self.jumps, 0.0, self.lengths_m)

    @property
    def lost_pose_s(self) -> float:
        """Longest gap between poses that counts as driven [s]; 0 for no limit."""
        # The daemon's timeout is in real seconds.
        return self.time_scale * known_settings(self.config).mission.lost_pose_s

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Whether the robot drove from each pose to the next, bool (n - 1,), as in the ledger.

        False for jumps and for gaps without poses, where no floor counts as swept.
        """
        return ~self.jumps & (np.diff(self.times) <= (self.lost_pose_s or math.inf))

    @property
    def times(self) -> NDArray[np.float64]:
        """Arrival of each pose [s], float64 (n,)."""
        return np.array(self.pose_s, np.float64)

    @property
    def track(self) -> NDArray[np.float64]:
        """All poses: x [m], y [m], yaw [rad], float64 (n, 3)."""
        return np.array(self.poses, np.float64).reshape(-1, 3)


def gather(samples: Iterable[Arrival], clock: RobotClock) -> RunData:
    """Return the data of ``samples``; samples that cannot be decoded are only counted."""
    reader = _SampleReader(clock)
    for arrival in samples:
        reader.read(arrival)
    return reader.data


def maps_of(record: RunRecord) -> Iterator[tuple[float, OccupancyGrid]]:
    """Yield each version of the map, and its arrival since the recording began [s]."""
    reader = _SampleReader(record.clock)
    for arrival in RecordedSamples((), record.batches, ("map", "map_update")):
        reader.read(arrival)
        if reader.data.grid is not None:
            yield reader.data.map_s[-1], reader.data.grid


class _SampleReader:
    """Adds the data of samples, one by one; keeps only the newest map."""

    def __init__(self, clock: RobotClock) -> None:
        self.data = RunData(time_scale=clock.scale)
        self._clock = clock
        self._now = 0.0
        self._poses = PoseDecoder(POSE_STAMPED)
        self._readers: dict[str, Callable[[Arrival], None]] = {
            "map": self._map,
            "map_update": self._map_update,
            "pose": self._pose,
            "tf_static": self._pose,
            "command": self._command,
            "status": self._status,
            "rooms": self._rooms,
            PATH_DIGEST: self._path,
        }

    def read(self, arrival: Arrival) -> None:
        # Samples in force at the beginning of a part are older than the recording.
        self._now = max(self._clock.seconds(arrival.wall_ns), 0.0)
        self.data.last_s = max(self.data.last_s, self._now)
        reader = self._readers.get(arrival.topic)
        if reader is None:
            return
        try:
            reader(arrival)
        except FasacoError:
            self.data.undecodable[arrival.topic] += 1

    def _map(self, arrival: Arrival) -> None:
        self.data.grid = decode_occupancy_grid(arrival.sample.payload)
        self.data.map_s.append(self._now)

    def _map_update(self, arrival: Arrival) -> None:
        patch = decode_map_update(arrival.sample.payload)
        if self.data.grid is None:
            raise MalformedMessage("an update before any map")
        self.data.grid = self.data.grid.patched(patch)
        self.data.map_s.append(self._now)

    def _pose(self, arrival: Arrival) -> None:
        sample, is_static = arrival.sample, arrival.topic == "tf_static"
        stamped = self._poses.decode(sample.payload, sample.schema, is_static=is_static)
        if stamped is None:
            return
        pose = stamped.pose
        self.data.pose_s.append(self._now)
        self.data.poses.append((pose.x, pose.y, pose.yaw))

    def _command(self, arrival: Arrival) -> None:
        command = read_command(decode_json(arrival.sample.payload))
        self.data.commands.append((self._now, command))
        if command.name == "start":
            zones = command.order.zones
            self.data.ordered_keep_out = command.order.keep_out
            self.data.zones = tuple(zone.polygon for zone in zones if zone.polygon)

    def _status(self, arrival: Arrival) -> None:
        status, data = decode_tolerant(arrival.sample.payload, Status), self.data
        data.config = renamed(status.config) or data.config
        data.version = status.version or data.version
        data.robot = status.robot or data.robot
        # The order may name a zone or room; the status then has its polygon.
        data.zones = tuple(z.polygon for z in status.mission.zones if z.polygon) or data.zones
        known = known_settings(data.config)
        self._poses.schema = known.pose.schema or self._poses.schema
        if frames := known.ros2.frames:
            self._poses.follow((frames.map, frames.robot))
        data.statuses.append(StatusSample(self._now, status))

    def _rooms(self, arrival: Arrival) -> None:
        self.data.rooms = decode_tolerant(arrival.sample.payload, Rooms)

    def _path(self, arrival: Arrival) -> None:
        about = decode_tolerant(arrival.sample.attachment, PathAttachment)
        paths = self.data.paths
        # Ignore a path published again, and revision 0, which a daemon publishes before a mission.
        if not about.revision or (paths and paths[-1].about.revision == about.revision):
            return
        planner = known_settings(self.data.config).planner.name
        if (about.planner, planner) == ("fasaco", "colony-search"):  # see ``renamed``
            about = structs.replace(about, planner=planner)
        paths.append(PathSample(self._now, about))
