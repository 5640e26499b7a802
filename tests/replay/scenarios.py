"""Scenarios derived from the samples of one recording, and what must hold in each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.grid.lattice import COVERABLE
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.replay.mission_drive import ReplayStep
from fasaco_edge.replay.replay import Replay, read_run
from fasaco_edge.wire.messages.poses import decode_pose
from fasaco_edge.wire.schemas import POSE_STAMPED
from tests import naive

Cell = tuple[int, int]
Samples = list[Arrival]
# Two poses further apart than so many cells are no drive.
JUMP_CELLS = 2.0


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
        if step.decision.path is not None or mission.map.map_revision != map_revision:
            map_revision = mission.map.map_revision
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
        assert there in around[here].values(), (
            f"{here} -> {there} at map {mission.map.map_revision}"
        )


def visited(mission: Mission) -> set[Cell]:
    """Return the cells of the mission's map that it holds for covered."""
    window = mission.lattice.window
    cells = np.argwhere(mission.covered.current.visits(window) > 0)
    return {(row + window.row0, col + window.col0) for row, col in cells.tolist()}


def left(mission: Mission) -> set[Cell]:
    """Return the cells that a robot at the newest pose can come to, and that it has to cover."""
    lattice, pose = mission.lattice, mission.pose.pose
    window = lattice.window
    here = lattice.local(lattice.cell_at(pose.x, pose.y))
    found = naive.distances(lattice.steps, here)
    return {(row + window.row0, col + window.col0) for row, col in found} - visited(mission)


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


def changed(samples: Samples, index: int, change: Callable[[bytes], bytes]) -> Samples:
    """Change the bytes of one."""
    result = list(samples)
    sample = samples[index].sample
    another = Sample(sample.key, change(sample.payload), sample.schema, sample.attachment)
    result[index] = replace(samples[index], sample=another)
    return result


def moved(sample: Arrival, by_ns: int) -> Arrival:
    """Return a sample at a later time."""
    return replace(sample, at_ns=sample.at_ns + by_ns, wall_ns=sample.wall_ns + by_ns)
