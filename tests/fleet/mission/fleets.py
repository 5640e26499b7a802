"""Robots of one fleet in one building, each with a mission of its own, and the bus between them."""

from random import Random

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.fleet.mission.message import Messages
from fasaco_edge.mission.events import MapReceived
from tests.mission.world import CONFIG, Drive, building, pose_at, reachable_cells

MOST_TILES = 4


class FleetRobot(Drive):
    """A robot that plans at once, drives a cell a tick, and tells the others of itself.

    Attributes:
        hangs: whether it stands.
        cannot: cells that it comes to the edge of: its tool does not sweep them.
    """

    def __init__(self, name, cell, rows, config=CONFIG, before=None):
        self.name, self.hangs, self.cannot = name, False, ()
        self.messages = Messages(name, CONFIG.footprint.robot_radius_m)
        super().__init__(cell, config=config, kind=FleetKind(name))
        if before is not None:
            self.mission.restore(before)
        self.mission.covered.shared.begin_epoch(1)
        self.tell(MapReceived(building(*rows)), pose_at(*cell))

    def report(self):
        return self.messages.next(self.mission, MOST_TILES, MOST_TILES)

    def tick(self, after=1.0):
        if self.request is not None:
            self.plan()
        if not self.hangs and self.walk:
            self.cell = self.walk.pop(0)
            self.driven.append(self.cell)
        row, col = self.cell
        short = 0.48 * (self.cell in self.cannot)
        self.tell(pose_at(row - short, col - short), after=after)


class FleetDrive:
    """Robots that get each other's messages once a second, as far as ``hears`` lets them.

    Attributes:
        robots: by name; those that are killed are gone.
        hears: whether a message from one comes to another.
        seconds: how long it took.
    """

    def __init__(self, rows, starts, config=CONFIG):
        self.rows, self.seconds = rows, 0
        self.robots = {name: FleetRobot(name, cell, rows, config) for name, cell in starts.items()}
        self.hears = lambda speaker, listener: True
        self.swept = set(starts.values())

    def run(self, seconds):
        for _ in range(seconds):
            self.tick()

    def tick(self, copies=1, random=None):
        self.seconds += 1
        for robot in self.robots.values():
            robot.tick()
            self.swept.add(robot.cell)
        for speaker in self.robots.values():
            report = speaker.report()
            for listener in self.robots.values():
                if listener is speaker or not self.hears(speaker.name, listener.name):
                    continue
                if random is None or random.random() < 0.7:
                    listener.tell(*[report] * copies, after=0.0)

    def finish(self, most=2000, **how):
        while not all(robot.mission.state == "done" for robot in self.robots.values()):
            assert self.seconds < most, {
                name: (robot.mission.state, robot.mission.reason)
                for name, robot in self.robots.items()
            }
            self.tick(**how)

    def finish_one(self, robot, most=2000):
        while robot.mission.state != "done":
            assert self.seconds < most, robot.mission.reason
            self.tick()

    def left_out(self):
        (first, *_) = self.robots.values()
        whole = reachable_cells(building(*self.rows), first.cell)
        return whole - self.swept


def flaky(seed):
    """A bus that loses three messages in ten and repeats the others."""
    return {"copies": 2, "random": Random(seed)}
