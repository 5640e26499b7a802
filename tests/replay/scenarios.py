"""Scenarios derived from the samples of one recording, and what must hold in each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import COVERABLE
from fasaco_edge.grid.occupancy import UNKNOWN, OccupancyGrid
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.replay.mission_drive import ReplayStep
from fasaco_edge.replay.replay import Replay, read_run
from fasaco_edge.wire.messages.maps import (
    decode_map_update,
    decode_occupancy_grid,
    encode_occupancy_grid,
)
from fasaco_edge.wire.messages.poses import decode_pose
from fasaco_edge.wire.schemas import OCCUPANCY_GRID, POSE_STAMPED
from tests import naive

Cell = tuple[int, int]
Samples = list[Arrival]
# Two poses further apart than so many cells are no drive.
JUMP_CELLS = 2.0
# How far a mapper that was started anew has seen around the robot [m].
SIGHT_M = 1.2
# It sends a map with every so many-th pose, with so much around it.
MAP_EVERY, MARGIN_PX = 5, 2


@dataclass(frozen=True)
class Story:
    """What became of a scenario."""

    mission: Mission
    news: list[ReplayStep]

    @property
    def faults(self) -> list[str]:
        """Codes of all that was refused."""
        return [
            fault.code for step in self.news for fault in (*step.refused, *step.decision.faults)
        ]

    @property
    def visited(self) -> set[Cell]:
        """Cells that the mission holds for covered, of those on its map."""
        return visited(self.mission)

    def outline(self) -> list[tuple]:
        """Return all that was decided, for comparison."""
        return [
            (
                step.at_s,
                step.state,
                step.reason,
                step.decision.plan and step.decision.plan.reason,
                step.decision.path and (step.decision.path.revision, step.decision.path.reason),
                step.decision.path and step.decision.path.cells.tobytes(),
            )
            for step in self.news
        ]


def played(samples: Samples, config: DaemonConfig) -> Story:
    """Play ``samples``; whatever they are, no path is illegal and no claim false."""
    replay = Replay(config, read_run(samples).ready_ns)
    mission, news, map_revision = replay.mission, [], 0
    for step in replay.steps(samples):
        if step.is_news:
            news.append(step)
        if step.decision.path is not None or mission.map_revision != map_revision:
            map_revision = mission.map_revision
            assert_legal(mission)
    assert visited(mission) <= under_tool(samples, config.robot.tool_width_m)
    return Story(mission, news)


def assert_legal(mission: Mission) -> None:
    """Check that the rest of the path passes nothing that is blocked on the newest map."""
    lattice, ahead = mission.lattice, mission.route.path.ahead
    if lattice is None or not len(ahead):
        return
    around = naive.neighbours(lattice.steps)
    cells = [lattice.local((row, col)) for row, col in ahead.tolist()]
    assert all(lattice.states[cell] == COVERABLE for cell in cells)
    for here, there in pairwise(cells):
        assert there in around[here].values(), f"{here} -> {there} at map {mission.map_revision}"


def visited(mission: Mission) -> set[Cell]:
    """Return the cells of the mission's map that it holds for covered."""
    window = mission.lattice.window
    cells = np.argwhere(mission.ledger.visits(window) > 0)
    return {(row + window.row0, col + window.col0) for row, col in cells.tolist()}


def left(mission: Mission) -> set[Cell]:
    """Return the cells that a robot at the newest pose can come to, and that it has to cover."""
    lattice, pose = mission.lattice, mission.pose.pose
    window = lattice.window
    here = lattice.local(lattice.cell_at(pose.x, pose.y))
    found = naive.distances(lattice.steps, here)
    return {(row + window.row0, col + window.col0) for row, col in found} - visited(mission)


def stands_on_unknown(mission: Mission) -> bool:
    """Tell whether the map does not know part of the ground around the robot's cell."""
    pose, grid, cell_m = mission.pose.pose, mission.grid, mission.lattice.cell_m
    x, y = ((math.floor(at / cell_m) + 0.5) * cell_m for at in (pose.x, pose.y))
    col0, row0 = grid.geometry.to_pixels(x - 0.5 * cell_m, y - 0.5 * cell_m)
    col1, row1 = grid.geometry.to_pixels(x + 0.5 * cell_m, y + 0.5 * cell_m)
    around = grid.cells[math.floor(row0) : math.ceil(row1), math.floor(col0) : math.ceil(col1)]
    return bool(np.any(around == UNKNOWN))


def driven_m(samples: Samples, poses: Sequence[int]) -> float:
    """Return how far the robot drives over some of its poses [m]."""
    way = [decode_pose(samples[index].sample.payload, POSE_STAMPED).pose for index in poses]
    return sum(math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(way))


def under_tool(samples: Iterable[Arrival], tool_m: float) -> set[Cell]:
    """Return the cells whose centre the tool has passed over, drive by drive."""
    poses = [decode_pose(s.sample.payload, POSE_STAMPED).pose for s in samples if s.topic == "pose"]
    cells: set[Cell] = set()
    for before, pose in pairwise([poses[0], *poses]):
        apart = math.hypot(pose.x - before.x, pose.y - before.y)
        start = before if apart <= JUMP_CELLS * tool_m else pose
        for share in np.linspace(0.0, 1.0, 1 + math.ceil(apart / 0.005)):
            x, y = start.x + share * (pose.x - start.x), start.y + share * (pose.y - start.y)
            cell = (math.floor(y / tool_m), math.floor(x / tool_m))
            centre = ((cell[1] + 0.5) * tool_m, (cell[0] + 0.5) * tool_m)
            if math.dist(centre, (x, y)) <= 0.5 * tool_m:
                cells.add(cell)
    return cells


def places(samples: Samples, topic: str) -> list[int]:
    """Return where in ``samples`` those of a topic are."""
    return [index for index, sample in enumerate(samples) if sample.topic == topic]


def without(samples: Samples, dropped: Sequence[int]) -> Samples:
    """Drop some."""
    return [sample for index, sample in enumerate(samples) if index not in set(dropped)]


def repeated(samples: Samples, index: int, later: int) -> Samples:
    """Let one come again at the time of one that came ``later``."""
    again = moved(samples[index], samples[later].wall_ns - samples[index].wall_ns)
    return [*samples[: later + 1], again, *samples[later + 1 :]]


def swapped(samples: Samples, one: int, other: int) -> Samples:
    """Exchange what came at two times."""
    result = list(samples)
    for index, source in ((one, other), (other, one)):
        result[index] = replace(samples[index], sample=samples[source].sample)
    return result


def late(samples: Samples, topic: str, by_ns: int) -> Samples:
    """Let all of a topic come later."""
    result = [moved(s, by_ns) if s.topic == topic else s for s in samples]
    return sorted(result, key=lambda sample: sample.wall_ns)


def changed(samples: Samples, index: int, change: Callable[[bytes], bytes]) -> Samples:
    """Change the bytes of one."""
    result = list(samples)
    sample = samples[index].sample
    another = Sample(sample.key, change(sample.payload), sample.schema, sample.attachment)
    result[index] = replace(samples[index], sample=another)
    return result


def mapper_restarted(samples: Samples, index: int) -> Samples:
    """Start the mapper anew before sample ``index``: from there on it sends whole maps.

    It knows only what it has seen since, so its maps have another origin.
    """
    return [*samples[:index], *_new_mapper(samples, index)]


def moved(sample: Arrival, by_ns: int) -> Arrival:
    """Return a sample at a later time."""
    return replace(sample, at_ns=sample.at_ns + by_ns, wall_ns=sample.wall_ns + by_ns)


def _new_mapper(samples: Samples, index: int) -> Iterator[Arrival]:
    known: OccupancyGrid | None = None
    seen: set[Cell] = set()
    poses = 0
    for number, arrival in enumerate(samples):
        sample = arrival.sample
        if arrival.topic == "map":
            known = decode_occupancy_grid(sample.payload)
        elif arrival.topic == "map_update":
            known = known.patched(decode_map_update(sample.payload))
        elif arrival.topic == "pose" and number >= index:
            pose = decode_pose(sample.payload, POSE_STAMPED).pose
            resolution = known.geometry.resolution
            seen |= _disc(pose.x / resolution, pose.y / resolution, SIGHT_M / resolution)
            poses += 1
            if poses % MAP_EVERY == 1:
                payload = encode_occupancy_grid(_cropped(known, seen))
                whole = Sample(sample.key, payload, OCCUPANCY_GRID)
                yield replace(arrival, topic="map", sample=whole)
        if number >= index and arrival.topic not in ("map", "map_update"):
            yield arrival


def _disc(x: float, y: float, radius: float) -> set[Cell]:
    rows = range(math.floor(y - radius), math.ceil(y + radius) + 1)
    cols = range(math.floor(x - radius), math.ceil(x + radius) + 1)
    return {(r, c) for r in rows for c in cols if math.hypot(c - x, r - y) < radius}


def _cropped(grid: OccupancyGrid, seen: set[Cell]) -> OccupancyGrid:
    """Return what was seen of a map, pixels (row, col) counted from the frame's origin."""
    geometry = grid.geometry
    row0 = round(geometry.origin.y / geometry.resolution)
    col0 = round(geometry.origin.x / geometry.resolution)
    mask = np.zeros(grid.cells.shape, bool)
    for row, col in seen:
        if 0 <= row - row0 < geometry.rows and 0 <= col - col0 < geometry.cols:
            mask[row - row0, col - col0] = True
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    window = slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)
    cells = np.where(mask, grid.cells, UNKNOWN).astype(np.int8)[window]
    cells = np.pad(cells, MARGIN_PX, constant_values=UNKNOWN)
    origin = Pose2D(*geometry.to_map(int(cols[0]) - MARGIN_PX, int(rows[0]) - MARGIN_PX))
    placed = GridGeometry(*cells.shape, geometry.resolution, origin)
    return OccupancyGrid(placed, cells, grid.frame, grid.stamp_ns)
