"""Buildings drawn in text, and a robot that drives cell by cell.

One letter is one lattice cell of 2 x 2 pixels: ``.`` free, ``#`` occupied, anything
else unknown. The last line is the southernmost. All lengths are powers of two, so
that a cell's border is where it looks to be.
"""

from dataclasses import replace

import numpy as np
from msgspec import structs

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.core.company_kind import ALONE
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import (
    CommandReceived,
    MapReceived,
    PatchReceived,
    PlanReady,
    PoseReceived,
    State,
)
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.paper.fasaco import Fasaco
from tests import naive

CELL, PIXELS = 0.25, 2
FOOTPRINT = Footprint(cell_m=CELL, robot_radius_m=CELL / 2)
CONFIG = MissionConfig(FOOTPRINT)
VALUES = {".": 0, "#": 100}
TICK_S = 0.1
IDLE = OrderState.idle("no order yet")


def with_policy(config, **changes):
    """``config`` with a mission's policy changed."""
    return replace(config, policy=structs.replace(config.policy, **changes))


def pixels(*rows):
    """Occupancy values of a drawing, int8."""
    cells = [[VALUES.get(letter, -1) for letter in row] for row in rows[::-1]]
    return np.array(cells, np.int8).repeat(PIXELS, axis=0).repeat(PIXELS, axis=1)


def building(*rows, at=(0, 0), frame="map"):
    """A map whose first pixel is the corner of lattice cell ``at``."""
    return placed(pixels(*rows), at, frame)


def placed(cells, at, frame="map"):
    origin = Pose2D(at[1] * CELL, at[0] * CELL)
    return OccupancyGrid(GridGeometry(*cells.shape, CELL / PIXELS, origin), cells, frame)


def patch(*rows, at=(0, 0), frame="map"):
    """An update of a map's cells from lattice cell ``at`` of that map on."""
    cells = pixels(*rows)
    row, col = at[0] * PIXELS, at[1] * PIXELS
    window = Window(row, col, row + cells.shape[0], col + cells.shape[1])
    return PatchReceived(MapPatch(window, cells, frame))


def pose_at(row, col, frame="map"):
    """The robot in the middle of a cell; fractions lie between."""
    return PoseReceived(StampedPose(Pose2D((col + 0.5) * CELL, (row + 0.5) * CELL), frame))


def answer(request, ants=16):
    """Really plan what was asked for."""
    planner = Fasaco(ColonyConfig(ants=ants, velocities=(8, 4, 2, 1)))
    return PlanReady(request.number, planner.plan(request.problem), seconds=0.25)


class Drive:
    """A mission and a robot; each tick is a step of the mission.

    Attributes:
        config: of the mission.
        cell: where the robot is.
        walk: the cells it still has to drive, by the last path published.
        driven: all it has driven.
        decisions: all decisions, in order.
        request: the plan asked for and not yet answered.
        revision: of the last path published.
        commands: how many were given.
        refused: why the last one was; None if it was not.
    """

    refused = None

    def __init__(self, cell, *first_events, config=CONFIG, order_state=None, kind=ALONE):
        self.config = config
        self.mission = Mission(config, order_state, kind)
        self.cell = cell
        self.now = 0.0
        self.walk = []
        self.driven = [cell]
        self.decisions = []
        self.request = None
        self.revision = 0
        self.commands = 0
        self.tell(*first_events)

    @property
    def updates(self):
        """All paths published."""
        return [decision.path for decision in self.decisions if decision.path is not None]

    @property
    def visited(self):
        """The cells the mission holds for covered."""
        window = self.mission.lattice.window
        visits = self.mission.covered.current.visits(window)
        return {
            (row + window.row0, col + window.col0) for row, col in np.argwhere(visits > 0).tolist()
        }

    def tell(self, *events, after=TICK_S):
        """Step the mission; the robot hears of the path at once."""
        self.now += after
        decision = self.mission.step(events, self.now)
        self.decisions.append(decision)
        if decision.plan is not None:
            assert self.request is None, "one plan at a time"
            self.request = decision.plan
        if decision.path is not None:
            assert decision.path.revision > self.revision
            self.revision = decision.path.revision
            walk = [tuple(cell) for cell in decision.path.cells.tolist()]
            self.walk = walk[1:] if walk and walk[0] == self.cell else walk
        return decision

    def command(self, name, order=None, after=TICK_S, *, keep_out=None, discard=True, room=None):
        """Give a command; the order as a document. Return what the mission decides."""
        self.commands += 1
        event = CommandReceived(self.commands, name, read_order(order), keep_out, discard, room)
        decision = self.tell(event, after=after)
        (answer,) = decision.answers
        assert answer.number == self.commands
        self.refused = answer.error
        return decision

    def plan(self):
        """Answer the plan asked for."""
        request, self.request = self.request, None
        return self.tell(answer(request))

    def go(self, *events, times=1):
        """Drive so many cells of the path, by legal steps, and report each pose."""
        for _ in range(times):
            if self.walk:
                there = self.walk.pop(0)
                lattice = self.mission.lattice
                around = naive.neighbours(lattice.steps)[lattice.local(self.cell)]
                assert lattice.local(there) in around.values(), f"{self.cell} -> {there}"
                self.cell = there
                self.driven.append(there)
            decision = self.tell(pose_at(*self.cell), *events)
        return decision

    def tick(self, *events, times=1):
        """Answer the plan asked for, if there is one, and drive a cell; so many times."""
        for _ in range(times):
            if self.request is not None:
                self.plan()
            self.go(*events)

    def restarted(self, *events):
        """A robot in the same place whose mission continues from what this one keeps on disk."""
        kept = self.mission.snapshot()
        order = OrderState.from_json(kept.note)
        again = Drive(self.cell, config=self.config, order_state=order)
        again.mission.restore(kept, order)
        again.tell(*events)
        return again

    def finish(self, ticks=500):
        """Drive on until the mission is done."""
        self.run(State.DONE, ticks)

    def run(self, until, ticks=300):
        """Drive on, with a plan whenever one is asked for, until the mission is in a state."""
        for _ in range(ticks):
            if self.mission.state is until:
                return
            self.tick()
        raise AssertionError(f"{self.mission.state} after {ticks} ticks: {self.mission.reason}")


def rectangle(row0, col0, row1, col1):
    """The polygon around some cells, from (row0, col0) up to and without (row1, col1)."""
    x0, y0, x1, y1 = (CELL * value for value in (col0, row0, col1, row1))
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]


def cells(row0, col0, row1, col1):
    """All cells from (row0, col0) up to and without (row1, col1)."""
    return {(row, col) for row in range(row0, row1) for col in range(col0, col1)}


def robot_in(*rows, cell=(0, 0), **members):
    """A robot in a building, with further members of ``Drive``."""
    return Drive(cell, MapReceived(building(*rows)), pose_at(*cell), **members)


def idle(*rows, **members):
    """A robot that waits for an order."""
    return robot_in(*rows, order_state=IDLE, **members)


def started(*rows, cell=(0, 0), **members):
    """A robot that drives by its first plan over a building."""
    drive = robot_in(*rows, cell=cell, **members)
    drive.plan()
    return drive


def reachable_cells(occupancy, start):
    """All cells a robot at ``start`` can come to, of a map as it is."""
    lattice = CoverageLattice.from_map(occupancy, FOOTPRINT)
    found = naive.distances(lattice.steps, lattice.local(start))
    return {(row + lattice.window.row0, col + lattice.window.col0) for row, col in found}
