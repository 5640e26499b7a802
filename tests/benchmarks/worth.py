"""Missions with half of the time they need: how much of the floor that matters is swept.

``python -m tests.benchmarks.worth flat office``: a robot drives lines over known maps, with every
third room of a priority above the others, or with a map of dirt, and without; judged by where it
has been.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.mission.core.events import (
    CommandReceived,
    Event,
    MapReceived,
    PlanReady,
    PlanRequest,
    PriorityReceived,
    State,
)
from fasaco_edge.mission.map.room_book import Room
from fasaco_edge.mission.orders.order import CommandName, read_order
from fasaco_edge.mission.orders.room_requests import RoomRequest
from fasaco_edge.mission.orders.zones import cells_of
from fasaco_edge.planners.grids import read_grid
from tests.benchmarks.online.mission import CountedPlanning
from tests.mission.line_robot import CONFIG, SPEED_M_S, TOOL_M, LineRobot

QUARTER_TURN_S, STEERED_RAD = 1.5, 0.02
PROPOSALS = 500_000
GROUPS, HIGH = 3, 90
# Spots of dirt have this radius [m], and in all this share of the floor.
SPOT_M, DIRTY = 0.7, 0.25
# After so long all rooms are known; a mission that takes longer than this hangs [s].
SETTLED_S, LONGEST_S = 60.0, 30_000.0


class TurningRobot(LineRobot):
    """A robot that turns on the spot, in a building whose map it has."""

    def __init__(self, name: str) -> None:
        grid = read_grid(name)
        ((x, y),) = grid.lattice.centres(np.array([grid.start], np.int32)).tolist()
        self.grid = read_map(find_map(name))
        self._turn_s, self._seat = 0.0, CountedPlanning(0, PROPOSALS)
        super().__init__(self.grid.cells, (x, y), replace(CONFIG))
        self.ask("cancel")
        self.wait(SETTLED_S, lambda robot: False)

    def ask(self, name: CommandName, order: object = None, room: RoomRequest | None = None) -> None:
        """Give a command."""
        self._commands += 1
        event = CommandReceived(self._commands, name, read_order(order), discard=True, room=room)
        self.step(event)

    def planned(self, request: PlanRequest) -> PlanReady:
        return self._seat(request)

    def arrived(self, events: list[Event]) -> list[Event]:
        return [MapReceived(self.grid) if isinstance(at, MapReceived) else at for at in events]

    def _drive(self, way: float) -> None:
        left_s = way / SPEED_M_S
        while left_s > 1e-9 and (self._turn_s or self.path):
            spent_s = min(self._turn_s, left_s)
            self._turn_s, left_s = self._turn_s - spent_s, left_s - spent_s
            if self._turn_s or not self.path:
                continue
            dx, dy = self.path[0][0] - self.x, self.path[0][1] - self.y
            far = math.hypot(dx, dy)
            turn = abs(math.remainder(math.atan2(dy, dx) - self.yaw, math.tau))
            if far > 1e-6 and turn > STEERED_RAD:
                self.yaw = math.atan2(dy, dx)
                self._turn_s = QUARTER_TURN_S * turn / (0.5 * math.pi)
                continue
            step = min(far, left_s * SPEED_M_S)
            share = step / far if far else 1.0
            self.x, self.y, left_s = (
                self.x + share * dx,
                self.y + share * dy,
                left_s - step / SPEED_M_S,
            )
            if step >= far:
                del self.path[0]


class Run(NamedTuple):
    """A mission: how long it took [s], and which pixels it swept, bool (rows, cols)."""

    seconds: float
    swept: NDArray[np.bool_]
    reason: str


def run(
    name: str,
    high: tuple[int, ...] = (),
    until_s: float = 0.0,
    dirt: NDArray[np.bool_] | None = None,
) -> tuple[Run, TurningRobot]:
    """Sweep everything; ``high``: numbers of the rooms, ``dirt``: pixels, that matter."""
    robot = TurningRobot(name)
    if dirt is not None:
        robot.step(
            PriorityReceived(replace(robot.grid, cells=np.where(dirt, HIGH, -1).astype(np.int8)))
        )
    for number in high:
        robot.ask("room_set", room=RoomRequest(number, priority=HIGH))
    robot.ask("start", {"return_home": True, "until_min": until_s / 60.0})
    began, robot.track = robot.now, []
    assert robot.wait(LONGEST_S, lambda robot: robot.mission.state is State.DONE), (
        robot.mission.reason
    )
    return Run(robot.now - began, swept(robot), robot.mission.reason), robot


def swept(robot: TurningRobot) -> NDArray[np.bool_]:
    """Return the pixels under the tool along the robot's track, bool (rows, cols)."""
    geometry, shape = robot.grid.geometry, robot.grid.cells.shape
    reach = 0.5 * TOOL_M / geometry.resolution
    span = np.arange(-math.ceil(reach), math.ceil(reach) + 1)
    rows, cols = np.meshgrid(span, span, indexing="ij")
    disc = np.stack((rows, cols), -1)[rows**2 + cols**2 <= reach**2]
    at = np.array([geometry.to_pixels(*place)[::-1] for place in robot.track])
    pixels = (np.unique(np.floor(at).astype(int), axis=0)[:, None] + disc).reshape(-1, 2)
    found = np.zeros(shape, bool)
    found[tuple(pixels[((pixels >= 0) & (pixels < shape)).all(axis=1)].T)] = True
    found &= robot.grid.cells == 0
    return found


def inside(room: Room, robot: TurningRobot) -> NDArray[np.bool_]:
    """Return the pixels of a room, bool (rows, cols)."""
    geometry = robot.grid.geometry
    book = robot.mission.rooms
    outlines = [
        tuple(geometry.to_pixels(*corner) for corner in outline)
        for outline in (room.outline, *book.holes(room))
    ]
    return cells_of(outlines[0], tuple(outlines[1:]), Window(0, 0, *robot.grid.cells.shape), 1.0)


def judged(name: str) -> Iterator[str]:
    """Yield a line for each choice of rooms."""
    whole, robot = run(name)
    rooms = robot.mission.rooms.rooms
    until_s = 0.5 * whole.seconds
    plain, _ = run(name, until_s=until_s)
    half = f"in half of it {_share(plain, whole):.1%}"
    yield f"{name}: {len(rooms)} rooms, {whole.seconds:.0f} s; {half}"
    for group in range(GROUPS if len(rooms) > 1 else 0):
        chosen = [room for room in rooms if room.id % GROUPS == group]
        wanted = np.zeros_like(whole.swept)
        for room in chosen:
            wanted |= inside(room, robot)
        first, _ = run(name, tuple(room.id for room in chosen), until_s)
        yield f"  {len(chosen)} rooms, " + _compared(whole, plain, first, wanted, until_s)
    for seed in range(GROUPS):
        spots = spots_of(whole.swept, robot.grid.geometry.resolution, seed)
        first, _ = run(name, until_s=until_s, dirt=spots)
        yield "  spots of dirt, " + _compared(whole, plain, first, spots, until_s)


def spots_of(floor: NDArray[np.bool_], pixel_m: float, seed: int) -> NDArray[np.bool_]:
    """Return spots with a share of some floor, bool (rows, cols)."""
    rng, found = np.random.Generator(np.random.PCG64(seed)), np.zeros_like(floor)
    rows, cols = np.mgrid[: floor.shape[0], : floor.shape[1]]
    places = np.argwhere(floor)
    while (found & floor).sum() < DIRTY * floor.sum():
        row, col = places[rng.integers(len(places))]
        found |= (rows - row) ** 2 + (cols - col) ** 2 <= (SPOT_M / pixel_m) ** 2
    return found


def _compared(whole: Run, plain: Run, first: Run, wanted: NDArray[np.bool_], until_s: float) -> str:
    floor = float((whole.swept & wanted).sum()) / float(whole.swept.sum())
    return (
        f"{floor:.0%} of the floor: swept of these "
        f"{_share(plain, whole, wanted):.1%} without, {_share(first, whole, wanted):.1%} with; "
        f"of all {_share(plain, whole):.1%}, {_share(first, whole):.1%}; home after "
        f"{first.seconds / until_s:.1%} of the time"
    )


def _share(one: Run, whole: Run, where: NDArray[np.bool_] | None = None) -> float:
    floor = whole.swept if where is None else whole.swept & where
    return float((one.swept & floor).sum()) / max(float(floor.sum()), 1.0)


if __name__ == "__main__":
    for each in sys.argv[1:] or ["flat", "office"]:
        for line in judged(each):
            print(line, flush=True)
